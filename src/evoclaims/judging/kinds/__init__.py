"""The kinds of assertions, one file each."""
