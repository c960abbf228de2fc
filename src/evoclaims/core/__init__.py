"""Keys, trees, canonical JSON, files, errors and provenance: what every layer above needs."""

from evoclaims.core import forked as forked  # it has to be there before a fork
