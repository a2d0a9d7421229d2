// A delta lobe: mean of the mirrored environment over a texel (docs/method.md, section 6.3).
#include <texel_mean>

uniform float fineness;  // points a side of a texel, over its width in radii of the disk
#ifdef MIRROR_IMAGE
#include <angles>
uniform sampler2D mirrorImage;  // latitude–longitude, a column and a row repeated
uniform ivec2 mirrorSize;       // columns and rows without the repeated ones
uniform float mirrorScale;
uniform mat3 toImage;

vec3 mirrored(vec3 d) {
    vec3 local = toImage * d;
    float turn = angleOf(local.x, -local.z) / (2.0 * PI);
    float column = (turn - floor(turn)) * float(mirrorSize.x) - 0.5;
    column = column < 0.0 ? column + float(mirrorSize.x) : column;
    float row = angleOf(length(local.xz), local.y) / PI * float(mirrorSize.y - 1);
    vec2 corner = min(floor(vec2(column, row)), vec2(mirrorSize - 1));
    return bilinear(mirrorImage, vec2(column, row)).rgb * mirrorScale;
}
#else
vec3 mirrored(vec3 d) {
    return fetchLight(d, 0);
}
#endif

vec3 seenInMirror(vec3 n) {
    return byCosine(MIRROR_ROW, NODES - 1, n.z).rgb * mirrored(frame * (2.0 * n.z * n - vec3(0.0, 0.0, 1.0)));
}

MEAN(mirrorOverTexel, seenInMirror)

vec3 mirrorMean(vec3 n, float spacing) {
    ivec2 points = sidesOf(n, fineness * spacing, MIRROR_FEWEST, MIRROR_MOST, MIRROR_FLATTEST);
    return mirrorOverTexel(n, spacing, points.x, points.y);
}
