"""Verdicts of claims: their reports, the accepted ones, and how two sets of them differ."""
