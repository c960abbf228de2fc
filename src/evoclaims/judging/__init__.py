"""Judging claims: exact tests, attainability first, and exactly one of five outcomes."""
