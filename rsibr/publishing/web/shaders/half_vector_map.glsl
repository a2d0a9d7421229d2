// Half-vector map; see rsibr/methods/rsibr/half_vector_map.py and half_vector_pyramid.py.
#include <sphere_map>
#include <bilinear>

vec2 halfVectorPoint(vec3 n) {
    return n.xy / (1.0 + n.z);
}

vec3 halfVector(vec2 p) {
    float squared = dot(p, p);
    return vec3(2.0 * p, 1.0 - squared) / (1.0 + squared);
}

// Map point of a texel's centre in an image of so many texels a side with a border of one
vec2 halfVectorTexel(ivec2 texel, int side) {
    float pace = 2.0 / float(side);
    return vec2((float(texel.x - 1) + 0.5) * pace - 1.0, 1.0 - (float(texel.y - 1) + 0.5) * pace);
}

#ifdef LEVELS
uniform sampler2D halfVectors;           // all levels, each with a border of one texel
uniform ivec3 halfVectorLevels[LEVELS];  // corner of each level, and texels a side without its border

vec4 halfVectorLevel(vec2 p, int level) {
    ivec3 at = halfVectorLevels[level];
    return bilinear(halfVectors, placeInSphereMap(p, 0.5 * float(at.z)), at.xy);
}
#endif
