// Environment at rising blur, all levels in one texture; see rsibr/light/environment_pyramid.py.
#include <octahedral>
#include <bilinear>

uniform sampler2D lightTexels;
uniform ivec3 lightLevels[LIGHT_LEVELS];      // corner of each level, and texels a side without its border
uniform float lightVariances[LIGHT_LEVELS];   // [rad²]
uniform float lightFinest;                    // standard deviation of level 1 [rad]

vec3 fetchLight(vec3 d, int level) {
    ivec3 at = lightLevels[level];
    return bilinear(lightTexels, placeInSquare(squareFromDirection(d), float(at.z)), at.xy).rgb;
}

float levelOf(float width) {
    return 2.0 * log2(max(width, 1e-9) / lightFinest) + 1.0;
}

// Between two levels, with the variance of the width
vec3 blurredLight(vec3 d, float width) {
    int lower = int(clamp(levelOf(width), 0.0, float(LIGHT_LEVELS - 2)));
    float below = lightVariances[lower], above = lightVariances[lower + 1];
    float share = clamp((width * width - below) / (above - below), 0.0, 1.0);
    return mix(fetchLight(d, lower), fetchLight(d, lower + 1), share);
}

vec3 nearestBlurredLight(vec3 d, float width) {
    return fetchLight(d, int(clamp(levelOf(width) + 0.5, 0.0, float(LIGHT_LEVELS - 1))));
}
