"""Missing trials, run by this process or by several on this host."""
