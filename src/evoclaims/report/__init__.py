"""Reports on the claims for readers: a web page, Markdown, a badge."""
