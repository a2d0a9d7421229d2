// Stored maps warped to a new view and blended; see rsibr/methods/warp_blend/warp_blend.py.
#include <constants>
#include <warp>

#define NONE 0
#define MIRROR 1
#define NORMAL 2

#ifndef COUNT
#define COUNT 3
#endif

vec3 warpedAndBlended(vec3 n) {
    vec3 radiance = vec3(0.0);
    float total = 0.0;
    for (int k = 0; k < COUNT; k++) {
#if WARP == MIRROR
        vec2 p = mirrorNormal(n, k).xy;
        float trusted = min(length(n.xy - singular[k]) / FADE_RADIUS, 1.0) + LEAST_CONFIDENCE;
#else
        vec3 local = rotations[k] * n;
        vec2 p = diskFromNormal(local);
        float trusted = WARP == NORMAL ? max(local.z, LEAST_CONFIDENCE) : 1.0;
#endif
        trusted *= weights[k];
        radiance += trusted * storedRadiance(p, k);
        total += trusted;
    }
    return radiance / total;
}
