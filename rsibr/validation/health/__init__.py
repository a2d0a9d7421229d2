"""Numerical health of a bake: non-finite texels, holes, fireflies, energy drift."""
