"""Method of Miller & Hoffman (1984): one diffuse and one specular reflection map, convolved from an illumination map."""
