"""Cameras: chosen, fitted to an object, and along a path."""
