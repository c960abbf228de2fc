"""A paper under test: its conditions, its claims, and what became of them."""
