"""Comparison of systems: all methods on the same scenes, at equal time and equal memory."""
