"""Projections between directions and image points, one file each."""
