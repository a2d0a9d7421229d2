"""Limits of a picture's size, which the command line knows without Mitsuba."""

MOST_PIXELS = 16384
"""Most pixels of a picture's side."""
