"""Maps between directions and images: one file a projection."""
