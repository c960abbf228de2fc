"""Running trials: specification, run loop, records and store."""
