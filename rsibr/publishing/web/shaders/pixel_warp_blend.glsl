// Radiance of a pixel by `nearest`, `blend` or `cabral1999`.
#include <pixel_blend>

vec3 radiance(vec3 n, vec3 v) {
#if COUNT == 1
    int view = nearestView(v);
    return storedRadianceAt(view, warpedTo(view, n, v).xy);
#else
    ivec3 views = surrounding(v);
    return blendedAt(n, v, views, areaWeights(v, views));
#endif
}
