"""Whether a bake can be trusted: non-finite texels, holes, fireflies, energy drift."""
