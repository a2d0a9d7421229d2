// W_d(E·N) D[N] + W_s(E·N) S[R] (Miller & Hoffman 1984, section 3; rsibr/methods/miller1984/two_maps.py).
#include <angles>
#include <bilinear>
#include <tables>

#if HAS_DIFFUSE
uniform sampler2D diffuseMap;
uniform ivec2 diffuseSize;   // columns and rows without the border
uniform float diffuseScale;
#endif
#if HAS_SPECULAR
uniform sampler2D specularMap;
uniform ivec2 specularSize;
uniform float specularScale;
#endif

// Lookup by direction in a polar table: +Z, +X, −Z, −X at p = 0, ¼, ½, ¾
vec3 onPolarTable(sampler2D table, ivec2 size, vec3 d) {
    float turn = angleOf(d.x, d.z) / (2.0 * PI), theta = angleOf(length(d.xz), d.y) / PI;
    vec2 place = vec2(turn - floor(turn), theta) * vec2(size) + 0.5;
#if IS_NEAREST
    return texelFetch(table, clamp(ivec2(place + 0.5), ivec2(1), size), 0).rgb;
#else
    return bilinear(table, min(place, vec2(size) + 0.999999)).rgb;
#endif
}

vec3 shaded(vec3 n, vec3 v) {
    float cosine = dot(n, v);
    vec3 radiance = vec3(0.0);
#if HAS_DIFFUSE
    radiance += byCosine(0, NODES - 1, cosine).rgb * onPolarTable(diffuseMap, diffuseSize, n) * diffuseScale;
#endif
#if HAS_SPECULAR
    vec3 r = 2.0 * cosine * n - v;
    radiance += byCosine(1, NODES - 1, cosine).rgb * onPolarTable(specularMap, specularSize, r) * specularScale;
#endif
    return radiance;
}
