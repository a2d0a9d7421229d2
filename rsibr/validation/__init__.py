"""Holds a reconstruction against path-traced truth: reference, metrics, novel views."""
