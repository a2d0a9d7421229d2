"""Objects shaded from bakes: primary hits, safe normals, radiance per pixel, pictures."""
