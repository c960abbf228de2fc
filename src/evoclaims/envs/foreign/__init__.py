"""Environments of other libraries as tasks, and tasks as environments of another library."""
