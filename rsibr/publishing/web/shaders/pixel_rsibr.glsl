// Radiance of a pixel by `rsibr`. The light of narrow and wide Gaussians comes from the half-vector pyramid of one middle
// view v₀, at the half vector of v₀ and the pixel's mirror direction; shares, matte parts, the sharp part, triangle and
// residuals are the pixel's own.
#include <constants>
#include <sphere_map>
#include <bilinear>
#include <tables>
#include <polar_grid>
#if SHARP
#include <footprint>
#endif
#if RESIDUALS
#include <pixel_blend>
#include <residual_bounds>
uniform sampler2DArray residuals;
#endif

uniform mat3 frame;  // of the middle view

#if NARROW
#include <half_vector_map>
uniform sampler2D collapsed;
uniform float collapsedHalf;
#endif
#if WIDE
uniform sampler2D wideLight;
#endif
#if MATTE
#include <octahedral>
uniform sampler2D irradiance;
uniform int irradianceSide;
#endif
#if MIRROR_LOBE
#ifndef MIRROR_IMAGE
#include <light_pyramid>
#endif
#include <delta_lobe>
#endif
#if DELTA_LIGHTS
#include <delta_lights>
#endif

// Weights of all levels of the half-vector pyramid together
vec3 levelWeights(float cosine) {
    return byCosine(LEVEL_SUM_ROW, NODES - 1, cosine).rgb;
}

vec3 predictedAt(vec3 n, vec3 v) {
    float cosine = dot(n, v);
    vec3 r = 2.0 * cosine * n - v, between = r + frame[2], total = vec3(0.0);
    vec3 h = between * inversesqrt(max(dot(between, between), 1e-12)) * frame;  // in the middle view's frame
    h.z = max(h.z, 0.0);
#if NARROW
    vec3 found = bilinear(collapsed, placeInSphereMap(withinDisk(halfVectorPoint(h)), collapsedHalf)).rgb;
    total += found * levelWeights(cosine) / max(levelWeights(h.z), 1e-6);
#endif
#if WIDE
    total += byCosine(WIDE_ROW, NODES - 1, cosine).rgb * onPolarGrid(wideLight, h);
#endif
#if MATTE
    vec2 place = placeInSquare(squareFromDirection(n), float(irradianceSide));
    for (int k = 0; k < MATTE; k++) {
        vec3 share = byCosine(MATTE_ROW + k, NODES - 1, cosine).rgb;
        total += share * bilinear(irradiance, place, ivec2(0, k * (irradianceSide + 2))).rgb;
    }
#endif
#if SHARP
    float held = clamp(cosine, LEAST_VIEW_COSINE, 1.0);
    vec3 along = v - n * cosine;
    float squared = dot(along, along);
    vec3 x = squared > 1e-10 ? along * inversesqrt(squared) : vec3(0.0);  // head-on the footprint is round
    Shading shading = Shading(n, x, cross(n, x), held, sqrt(max(1.0 - held * held, 0.0)));
    vec4 seen = byCosine(SHARP_ROW, NODES - 1, held);
    total += seen.rgb * threeTaps(shading, seen.w, 0.0);
#endif
#if MIRROR_LOBE
    total += byCosine(MIRROR_ROW, NODES - 1, cosine).rgb * mirrored(r);
#endif
#if DELTA_LIGHTS
    total += deltaAt(n, v);
#endif
    return total;
}

#if RESIDUALS
vec3 carriedTo(vec3 n, vec3 v, ivec3 views, vec3 shares) {
    vec3 residual = vec3(0.0);
    float total = 0.0, here = max(dot(n, v), RESIDUAL_LEAST_COSINE);
    for (int k = 0; k < 3; k++) {
        vec3 normal = mirrorNormalOf(views[k], n, v);
        float there = max(normal.z, RESIDUAL_LEAST_COSINE), overlap = min(here, there) / max(here, there);
        float counted = shares[k] * there * there;
        float damping = BELIEVES == 1 ? overlap * overlap : 1.0;
        residual += counted * damping * bilinear(residuals, placeInSphereMap(normal.xy, mapHalf), views[k]).rgb;
        total += counted;
    }
    return residual / total;
}
#endif

vec3 radiance(vec3 n, vec3 v) {
    vec3 found = predictedAt(n, v);
#if RESIDUALS
    float cosine = dot(n, v);
    ivec3 views = surrounding(v);
    vec3 shares = gnomonicWeights(v, views);
    vec3 residual = byCosine(ALBEDO_ROW, ALBEDO_NODES - 1, cosine).rgb * carriedTo(n, v, views, shares);
    residual *= trusted(byCosine(TRUST_ROW, BELIEF_NODES - 1, cosine).x, shares);
#if BELIEVES && !KEEPS_NEGATIVES
    residual = clampedResidual(residual, found, shares);
#endif
    found += residual;
#if HEDGED
    vec3 plain = blendedAt(n, v, views, areaWeights(v, views));
    found = mix(plain, found, byCosine(WEIGHT_ROW, BELIEF_NODES - 1, cosine).rgb);
#endif
#endif
#if !KEEPS_NEGATIVES
    found = max(found, 0.0);
#endif
    return found;
}
