"""Budget of a bake: choice of resolution, views and samples for a given error or time, and the reached values."""
