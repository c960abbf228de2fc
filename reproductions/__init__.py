"""Reproduced papers: their conditions and committed reference trials."""
