"""Jobs of a cluster: what each asks for and does, the files that name them, and what has become of them."""
