// Lookups in cubes, each of six faces with a border of one texel, one above the other in one texture.
#include <bilinear>

uniform sampler2D cubeTexels;
uniform ivec2 cubes[CUBES];  // column at which a cube begins, and texels a side of its faces without the border

// Face and place of a direction; see rsibr/geometry/projections/cube.py
vec3 placeInCube(vec3 d) {
    vec3 s = abs(d);
    bool isY = s.y > s.x && s.y >= s.z, isZ = s.z > s.x && s.z > s.y;
    float along = isZ ? d.z : isY ? d.y : d.x;
    float ahead = along < 0.0 ? -1.0 : 1.0;
    float u = isZ ? ahead * d.x : isY ? d.x : -ahead * d.z, w = isY ? -ahead * d.z : d.y;
    float face = (isZ ? 4.0 : isY ? 2.0 : 0.0) + (along < 0.0 ? 1.0 : 0.0);
    return vec3(0.5 + 0.5 * u / abs(along), 0.5 - 0.5 * w / abs(along), face);
}

vec3 onCube(int k, vec3 place) {
    int side = cubes[k].y;
    vec2 texel = min(place.xy * float(side) + 0.5, float(side) + 0.999999);
    return bilinear(cubeTexels, texel, ivec2(cubes[k].x, int(place.z) * (side + 2))).rgb;
}
