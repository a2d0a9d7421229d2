"""Ways to look up the radiance of a surface, one a file; each registers itself by name."""
