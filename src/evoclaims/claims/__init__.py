"""A paper's sentences as tests: what a claim is, what it reads from trials, and the session that judges it."""
