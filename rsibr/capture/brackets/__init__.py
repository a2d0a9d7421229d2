"""Exposure brackets: photographs of one view, merged into radiance with its variance."""
