"""Keys, trees, canonical JSON, files, errors and provenance: what every floor above needs."""
