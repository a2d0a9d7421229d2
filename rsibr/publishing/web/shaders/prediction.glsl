// Prediction P of all lobes at texels of a sphere map (docs/method.md, eq. 31; rsibr/methods/rsibr/half_vector_lobes.py).
#include <constants>
#include <sphere_map>
#include <bilinear>
#include <tables>
#include <polar_grid>
#if SHARP
#include <footprint>
#endif

uniform mat3 frame;  // columns x, y, v

#if NARROW
#include <half_vector_map>
uniform sampler2D collapsed;
uniform float collapsedHalf;  // half its texels a side
#endif
#if WIDE
uniform sampler2D wideLight;
#endif
#if MATTE
#include <octahedral>
uniform sampler2D irradiance;     // maps one above the other, each with a border of one texel
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

// Radiance of all lobes but the delta lobe over a part of a texel that is `spacing` wide
vec3 smoothPart(vec3 n, float spacing) {
    vec3 radiance = vec3(0.0);
#if NARROW
    radiance += bilinear(collapsed, placeInSphereMap(halfVectorPoint(n), collapsedHalf)).rgb;
#endif
#if WIDE
    radiance += byCosine(WIDE_ROW, NODES - 1, n.z).rgb * onPolarGrid(wideLight, n);
#endif
#if MATTE
    vec2 place = placeInSquare(squareFromDirection(frame * n), float(irradianceSide));
    for (int k = 0; k < MATTE; k++) {
        vec3 share = byCosine(MATTE_ROW + k, NODES - 1, n.z).rgb;
        radiance += share * bilinear(irradiance, place, ivec2(0, k * (irradianceSide + 2))).rgb;
    }
#endif
#if SHARP
    Shading shading = shadingInMap(n, frame);
    vec4 seen = byCosine(SHARP_ROW, NODES - 1, shading.cosine);
    if (max(seen.r, max(seen.g, seen.b)) > 0.0) radiance += seen.rgb * threeTaps(shading, seen.w, spacing);
#endif
    return radiance;
}

// Mean along the radius over the part of a texel inside the disk (docs/method.md, section 6.5)
vec3 radialMean(vec3 n, float spacing) {
    int points = int(clamp(ceil(spacing / (RADIAL_STEP * max(n.z, RADIAL_FLATTEST))), 1.0, RADIAL_MOST));
    float width = spacing / float(points);
    if (points == 1) return smoothPart(n, width);
    float radius = length(n.xy), halved = 0.5 * spacing;
    float reach = radius + halved > 1.0 ? 1.0 - radius : halved, outward = 1.0 / max(radius, 1e-6);
    vec3 total = vec3(0.0);
    for (int k = 0; k < points; k++) {
        float r = radius + reach * ((2.0 * float(k) + 1.0) / float(points) - 1.0);
        total += smoothPart(vec3(n.xy * (r * outward), sqrt(max(1.0 - r * r, 0.0))), width);
    }
    return total / float(points);
}

// Prediction at the middle n of the covered part of a texel of a map of so many texels a side
vec3 predicted(vec3 n, int size, bool withMirror) {
    float spacing = 2.0 / float(size);
    vec3 radiance = float(size) >= FINE_MAP ? smoothPart(n, spacing) : radialMean(n, spacing);
#if MIRROR_LOBE
    if (withMirror) radiance += mirrorMean(n, spacing);
#endif
#if DELTA_LIGHTS
    radiance += deltaMean(n, spacing);
#endif
    return radiance;
}
