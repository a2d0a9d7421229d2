"""Response curves: what a camera stores for an exposure, a curve a file."""
