"""Keys, trees, canonical JSON, files, errors and provenance: what every layer above needs."""
