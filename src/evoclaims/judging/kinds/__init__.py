"""The kinds of assertion, one file each."""
