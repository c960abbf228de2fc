"""Algorithms: pure functions of an explicit state, one a file."""
