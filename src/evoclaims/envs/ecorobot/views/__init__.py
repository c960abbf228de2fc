"""What robots do, to look at: pictures, animations, and a page in three dimensions."""
