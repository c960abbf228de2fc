"""A paper under test: its conditions at every tier, the variants of its protocol, its committed reference trials."""
