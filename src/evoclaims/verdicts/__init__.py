"""What became of claims: the report of each, the accepted ones, and how two sets of them differ."""
