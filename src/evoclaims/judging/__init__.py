"""Judging claims: exact tests, attainable p values first, and exactly one of six outcomes."""
