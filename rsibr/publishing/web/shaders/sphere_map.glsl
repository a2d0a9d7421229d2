// Sphere map: orthographic picture of the unit sphere; see rsibr/geometry/projections/sphere_map.py.
// Row 0 of a texture is the top of the map.

vec2 withinDisk(vec2 p) {
    return p * min(1.0, inversesqrt(max(dot(p, p), 1e-30)));
}

vec3 normalFromDisk(vec2 p) {
    vec2 q = withinDisk(p);
    return vec3(q, sqrt(max(1.0 - dot(q, q), 0.0)));
}

vec2 diskFromNormal(vec3 n) {
    return n.z >= 0.0 ? n.xy : n.xy * inversesqrt(max(dot(n.xy, n.xy), 1e-30));
}

vec2 texelCentre(ivec2 texel, int size) {
    float pace = 2.0 / float(size);
    return vec2((float(texel.x) + 0.5) * pace - 1.0, 1.0 - (float(texel.y) + 0.5) * pace);
}

bool touchesDisk(vec2 p, int size) {
    float reach = 1.0 + sqrt(2.0) / float(size);
    return dot(p, p) < reach * reach;
}

// Middle of the part of a texel inside the disk
vec2 coveredMiddle(vec2 p, int size) {
    float radius = length(p), halved = 1.0 / float(size);
    float middle = 0.5 * (radius - halved + min(radius + halved, 1.0));
    return radius + halved > 1.0 ? p * (middle / max(radius, halved)) : p;
}
