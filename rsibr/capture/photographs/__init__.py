"""Photographs: pixels, exposure and saturation of a file."""
