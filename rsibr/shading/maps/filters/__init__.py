"""Filters of a reconstructed map over the footprint of a ray, one a file; each registers itself by name."""
