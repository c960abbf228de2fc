"""Stepping gates: truth tables with levels (§3.1 of the paper)."""
