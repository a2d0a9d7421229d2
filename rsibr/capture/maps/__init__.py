"""Sphere maps of photographs of a painted sphere, or of any other renderer, as a bake."""
