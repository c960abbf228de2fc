"""Reports on the claims for readers: tables and a web page."""
