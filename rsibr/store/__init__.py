"""A bake on disk: manifest, map and light files, atomic writes. No rendering."""
