"""Papers under test: what is run, and the committed reference trials."""
