"""Formats, one a file; each registers itself when it is imported."""
