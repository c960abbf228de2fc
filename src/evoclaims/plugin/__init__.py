"""The pytest plugin: claims as tests, tiers as markers, verdicts as outcomes."""
