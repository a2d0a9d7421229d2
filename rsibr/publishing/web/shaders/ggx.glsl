// GGX lobe and Schlick's term; see rsibr/lobes/microfacet.py and basis.py.

float schlick(float cosine) {
    float graze = 1.0 - clamp(cosine, 0.0, 1.0), squared = graze * graze;
    return squared * squared * graze;
}

// BRDF times cosine of a GGX lobe, and the same times Schlick's grazing term
vec2 ggx(vec3 wi, vec3 wo, float alpha) {
    vec3 h = wi + wo;
    h *= inversesqrt(max(dot(h, h), 1e-12));
    float i = max(wi.z, 1e-6), o = max(wo.z, 1e-6), a = alpha * alpha;
    float base = h.z * h.z * (a - 1.0) + 1.0, density = a / (3.14159265358979 * base * base);
    float smith = o * sqrt(a + (1.0 - a) * i * i) + i * sqrt(a + (1.0 - a) * o * o);
    float plain = density * i / (2.0 * smith);
    return vec2(plain, plain * schlick(dot(h, wo)));
}
