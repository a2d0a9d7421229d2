// Sharp part: one footprint with three lookups along the plane of incidence (docs/method.md, sections 6.1 and 7.6).
#include <light_pyramid>

// Axes of the shading frame of a normal in the map's frame, in world coordinates
struct Shading {
    vec3 n, x, y;
    float cosine, sine;
};

Shading shadingInMap(vec3 n, mat3 frame) {
    float sine = length(n.xy), outward = 1.0 / max(sine, 1e-6);
    vec2 around = n.xy * outward;  // zero head-on, where the footprint is round
    vec3 toward = frame * vec3(-n.z * around, sine);
    return Shading(frame * n, toward, frame * vec3(around.y, -around.x, 0.0), clamp(n.z, LEAST_VIEW_COSINE, 1.0), sine);
}

vec3 threeTaps(Shading shading, float sigma, float spacing) {
    float cosine = max(shading.cosine, GRAZING), box = spacing * spacing / 12.0;
    float across = sqrt(sigma * sigma + box);
    float shorter = cosine * across;
    float along = sqrt(max(sigma * sigma + box / (cosine * cosine) - shorter * shorter, 0.0));
    vec3 v = vec3(shading.sine, 0.0, shading.cosine), light = vec3(0.0);
    float total = 0.0;
    for (int k = -1; k <= 1; k++) {
        vec3 facet = normalize(vec3(float(k) * HERMITE_PLACE * along, 0.0, 1.0));
        float toward = dot(facet, v);
        vec3 w = 2.0 * toward * facet - v;
        float counted = toward > 0.0 && w.z > 0.0 ? (k == 0 ? HERMITE_MIDDLE : HERMITE_SIDE) * toward : 0.0;
        if (counted > 0.0) {
            float width = max(2.0 * toward * facet.z * across, LEAST_TAP * along);
            vec3 d = shading.x * w.x + shading.y * w.y + shading.n * w.z;
            light += counted * nearestBlurredLight(d, width);
        }
        total += counted;
    }
    return light / max(total, 1e-20);
}
