"""Method of Miller & Hoffman (1984): a diffuse and a specular map, convolved from an illumination map."""
