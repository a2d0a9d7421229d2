// Prefiltered cubes times albedos, and irradiance (rsibr/methods/split_sum/split_shading.py, delta_highlights.py).
#include <tables>
#include <harmonics>
#if GLOSSY
#include <cubes>
uniform float shares[GLOSSY];
#endif
#if DELTA_LIGHTS
#include <ggx>
uniform vec3 lightDirections[DELTA_LIGHTS];
uniform vec3 lightIrradiance[DELTA_LIGHTS];
#if DELTA_LOBES
uniform vec3 lobes[3 * DELTA_LOBES];  // α, F₀ and F₉₀ of each
#endif

vec3 highlights(vec3 n, vec3 v) {
    float s = n.z < 0.0 ? -1.0 : 1.0, a = -1.0 / (s + n.z), b = n.x * n.y * a;
    mat3 axes = mat3(1.0 + s * n.x * n.x * a, s * b, -s * n.x, b, s + n.y * n.y * a, -n.y, n);
    vec3 wo = v * axes, total = vec3(0.0), matte = byCosine(0, ALBEDO_NODES - 1, wo.z).rgb / 3.14159265358979;
    for (int k = 0; k < DELTA_LIGHTS; k++) {
        vec3 wi = lightDirections[k] * axes;
        if (wi.z <= 0.0) continue;
        vec3 reflected = matte * wi.z;
#if DELTA_LOBES
        for (int lobe = 0; lobe < DELTA_LOBES; lobe++) {
            vec2 plain = ggx(wi, wo, lobes[3 * lobe].x);
            reflected += lobes[3 * lobe + 1] * (plain.x - plain.y) + lobes[3 * lobe + 2] * plain.y;
        }
#endif
        total += reflected * lightIrradiance[k];
    }
    return total;
}
#endif

vec3 shaded(vec3 n, vec3 v) {
    float cosine = dot(n, v);
    vec3 total = byCosine(0, ALBEDO_NODES - 1, cosine).rgb * harmonicRadiance(n);
#if GLOSSY
    vec3 place = placeInCube(2.0 * cosine * n - v);
    for (int k = 0; k < GLOSSY; k++) {
        vec3 light = onCube(2 * k, place);
        if (shares[k] > 0.0) light = mix(light, onCube(2 * k + 1, place), shares[k]);
        total += byCosine(1 + k, ALBEDO_NODES - 1, cosine).rgb * light;
    }
#endif
#if DELTA_LIGHTS
    total += highlights(n, v);
#endif
    return total;
}
