"""Silhouette of a sphere in a photograph: where its centre lies, and how far away."""
