// Stored maps warped and blended for a pixel with a view of its own; see warp_blend.glsl for whole maps.
#include <constants>
#include <sphere_map>
#include <bilinear>
#include <view_sphere>

uniform sampler2DArray maps;
uniform float mapHalf, mapScale;

#define NONE 0
#define MIRROR 1
#define NORMAL 2

vec3 storedRadianceAt(int view, vec2 p) {
    return bilinear(maps, placeInSphereMap(p, mapHalf), view).rgb * mapScale;
}

// Point of a stored map, and the confidence of its lookup
vec3 warpedTo(int view, vec3 n, vec3 v) {
    vec3 stored = storedColumn(view, 2);
#if WARP == MIRROR
    vec3 shift = stored - v, singular = -shift * inversesqrt(max(dot(shift, shift), 1e-30));
    vec3 away = n - singular;
    away -= v * dot(away, v);
    return vec3(mirrorNormalOf(view, n, v).xy, min(length(away) / FADE_RADIUS, 1.0) + LEAST_CONFIDENCE);
#elif WARP == NORMAL
    vec3 local = intoStored(view, n);
    return vec3(diskFromNormal(local), max(local.z, LEAST_CONFIDENCE));
#else
    vec3 axis = cross(v, stored);
    float cosine = dot(v, stored);
    vec3 carried = n * cosine + cross(axis, n) + axis * (dot(axis, n) / max(1.0 + cosine, 1e-7));
    return vec3(diskFromNormal(intoStored(view, carried)), 1.0);
#endif
}

vec3 blendedAt(vec3 n, vec3 v, ivec3 views, vec3 shares) {
    vec3 total = vec3(0.0);
    float weight = 0.0;
    for (int k = 0; k < 3; k++) {
        vec3 place = warpedTo(views[k], n, v);
        total += shares[k] * place.z * storedRadianceAt(views[k], place.xy);
        weight += shares[k] * place.z;
    }
    return total / weight;
}
