"""What became of the claims, for readers: a web page, Markdown, a badge."""
