"""Tasks: what a method is tried on."""
