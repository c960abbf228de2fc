"""Running trials: specification, the one loop, records and store."""
