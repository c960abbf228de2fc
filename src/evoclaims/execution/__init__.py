"""Missing trials of conditions, run by this process or by several: for commands and for claims."""
