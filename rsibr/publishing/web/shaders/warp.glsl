// Warps of a new view's map to stored ones; see rsibr/methods/warp_blend/warp.py.
#include <sphere_map>
#include <bilinear>

uniform sampler2DArray maps;      // stored maps, each with a border of one texel
uniform float mapHalf, mapScale;  // half the texels a side; factor on their numbers

uniform int views[3];
uniform float weights[3];
uniform mat3 rotations[3];  // from the new view's frame to the stored one
uniform vec3 shifts[3];     // v_s − v in the stored frame
uniform vec2 singular[3];   // point of the new map with the mirror direction −v_s

// Unit normal of the stored map with the mirror direction of n: its z is the cosine under which it is seen there
vec3 mirrorNormal(vec3 n, int k) {
    vec3 between = (rotations[k] * n) * max(2.0 * n.z, 1e-9) + shifts[k];
    return between * inversesqrt(max(dot(between, between), 1e-30));
}

vec3 storedRadiance(vec2 p, int k) {
    return bilinear(maps, placeInSphereMap(p, mapHalf), views[k]).rgb * mapScale;
}
