"""A paper's sentences as tests: what a claim is, what it reads from trials, and the session in which it is judged."""
