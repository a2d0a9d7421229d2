// Delta lights reflected by the proxies of the lobes (docs/method.md, section 6.4; rsibr/lobes/basis.py, proxy_ratio.py).
#include <texel_mean>
#include <ggx>

uniform sampler2D proxies;     // a row a lobe: (α, is matte, terms, 0), bare, coated, then α and three colours a term
uniform sampler2D proxyRatio;  // ratio of each lobe to its proxy, side by side
uniform vec3 lightDirections[DELTA_LIGHTS];  // of a map in its frame
uniform vec3 lightIrradiance[DELTA_LIGHTS];
uniform float narrowest;       // width of the narrowest highlight

vec3 underCoat(vec3 w) {
    vec2 inside = w.xy / COAT_IOR;
    return vec3(inside, sqrt(max(1.0 - dot(inside, inside), 1e-6)));
}

float coatedGgx(vec3 wi, vec3 wo, float alpha) {
    vec3 i = underCoat(wi), o = underCoat(wo);
    float below = ggx(i, o, alpha).x * max(wi.z, 0.0) / (i.z * COAT_IOR * COAT_IOR);
    return below * (1.0 - schlick(wi.z)) * (1.0 - schlick(wo.z));
}

vec3 ratioOf(int lobe, vec3 wi, vec3 wo, float alpha, bool isMatte) {
    vec2 place;
    if (isMatte) {
        place = sqrt(clamp(vec2(wi.z, wo.z), 0.0, 1.0));
    } else {
        vec3 h = wi + wo;
        h *= inversesqrt(max(dot(h, h), 1e-12));
        float cosine = clamp(h.z, 1e-3, 1.0), tangent = sqrt(max(1.0 - cosine * cosine, 0.0)) / cosine;
        place = vec2(tangent / (tangent + alpha), sqrt(clamp(dot(h, wo), 0.0, 1.0)));
    }
    place *= float(NODES - 1);
    ivec2 corner = min(ivec2(place), NODES - 2);
    vec2 between = place - vec2(corner);
    corner.x += NODES * lobe;
    vec3 upper = mix(texelFetch(proxyRatio, corner, 0).rgb, texelFetch(proxyRatio, corner + ivec2(1, 0), 0).rgb, between.x);
    vec3 lower = mix(texelFetch(proxyRatio, corner + ivec2(0, 1), 0).rgb, texelFetch(proxyRatio, corner + ivec2(1, 1), 0).rgb, between.x);
    return mix(upper, lower, between.y);
}

vec3 reflectedBy(int lobe, vec3 wi, vec3 wo) {
    vec4 head = texelFetch(proxies, ivec2(0, lobe), 0);
    float bare = max(wi.z, 0.0) * 0.3183098861837907, coated = bare * (1.0 - schlick(wi.z)) * (1.0 - schlick(wo.z));
    vec3 total = bare * texelFetch(proxies, ivec2(1, lobe), 0).rgb + coated * texelFetch(proxies, ivec2(2, lobe), 0).rgb;
    for (int k = 0; k < int(head.z); k++) {
        float alpha = texelFetch(proxies, ivec2(3 + 4 * k, lobe), 0).x;
        vec2 plain = ggx(wi, wo, alpha);
        total += plain.x * texelFetch(proxies, ivec2(4 + 4 * k, lobe), 0).rgb;
        total += plain.y * texelFetch(proxies, ivec2(5 + 4 * k, lobe), 0).rgb;
        total += coatedGgx(wi, wo, alpha) * texelFetch(proxies, ivec2(6 + 4 * k, lobe), 0).rgb;
    }
    return total * ratioOf(lobe, wi, wo, head.x, head.y > 0.0);
}

// Radiance toward v of surfaces with normal n, in the frame of the lights
vec3 deltaAt(vec3 n, vec3 v) {
    float toward = dot(n, v), cosine = clamp(toward, LEAST_VIEW_COSINE, 1.0);
    vec3 along = v - n * toward;
    float squared = dot(along, along);
    vec3 other = abs(n.x) < 0.7 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);  // head-on any tangent serves
    vec3 x = squared > 1e-10 ? along * inversesqrt(squared) : normalize(cross(other, n)), y = cross(n, x);
    vec3 wo = vec3(sqrt(max(1.0 - cosine * cosine, 0.0)), 0.0, cosine), total = vec3(0.0);
    for (int k = 0; k < DELTA_LIGHTS; k++) {
        vec3 d = lightDirections[k], wi = vec3(dot(x, d), dot(y, d), dot(n, d));
        if (wi.z <= 0.0) continue;
        vec3 reflected = vec3(0.0);
        for (int lobe = 0; lobe < DELTA_LOBES; lobe++) reflected += reflectedBy(lobe, wi, wo);
        total += reflected * lightIrradiance[k];
    }
    return total;
}

vec3 deltaReflection(vec3 n) {
    return deltaAt(n, vec3(0.0, 0.0, 1.0));
}

MEAN(deltaOverTexel, deltaReflection)

vec3 deltaMean(vec3 n, float spacing) {
    float spread = spacing / max(n.z, DELTA_FLATTEST), away = 2.0;
    for (int k = 0; k < DELTA_LIGHTS; k++) {
        vec3 between = lightDirections[k] + vec3(0.0, 0.0, 1.0);
        away = min(away, length(n - between * inversesqrt(max(dot(between, between), 1e-12))));
    }
    away = max(away - spread, 0.0);
    float width = sqrt(narrowest * narrowest + away * away);
    int points = int(clamp(ceil(DELTA_DENSITY * spread / width), DELTA_FEWEST, DELTA_MOST));
    return deltaOverTexel(n, spacing, points, points);
}
