"""Pure Dr.Jit mathematics on the sphere: no scene, no file."""
