"""The systems: each makes the radiance of any normal and view from a bake, behind one protocol."""
