// Residuals of the stored views, carried to the new view of a map (docs/method.md, section 8).
#include <residual_bounds>

uniform sampler2DArray residuals;
uniform float gnomonic[3];

// Σ w c² ρ² R(p) / Σ w c² at the normal n of the new view
vec3 carriedResidual(vec3 n) {
    vec3 residual = vec3(0.0);
    float total = 0.0, here = max(n.z, RESIDUAL_LEAST_COSINE);
    for (int k = 0; k < 3; k++) {
        vec3 normal = mirrorNormal(n, k);
        float there = max(normal.z, RESIDUAL_LEAST_COSINE), overlap = min(here, there) / max(here, there);
        float counted = gnomonic[k] * there * there;
#if BELIEVES
        float damping = overlap * overlap;
#else
        float damping = 1.0;
#endif
        residual += counted * damping * bilinear(residuals, placeInSphereMap(normal.xy, mapHalf), views[k]).rgb;
        total += counted;
    }
    return residual / total;
}
