// A level of the environment pyramid from the one before it: Gaussian taps in the tangent plane.
#include <octahedral>
#include <bilinear>

uniform sampler2D source;
uniform ivec3 level;        // corner of the level before, and its texels a side
uniform int side;           // of this level
uniform vec4 taps[TAPS];    // (sin a x/a, sin a y/a, cos a) of the tap at (x, y), with a = |(x, y)| [rad]; weight
out vec4 texel;

void main() {
    ivec2 inside = beyondTheFold(ivec2(gl_FragCoord.xy), side);
    vec3 d = directionFromSquare((vec2(inside) + 0.5) * (2.0 / float(side)) - 1.0);
    // Frame around d (Duff et al. 2017)
    float s = d.z < 0.0 ? -1.0 : 1.0, a = -1.0 / (s + d.z), b = d.x * d.y * a;
    vec3 x = vec3(1.0 + s * d.x * d.x * a, s * b, -s * d.x), y = vec3(b, s + d.y * d.y * a, -d.y);
    vec3 total = vec3(0.0);
    for (int k = 0; k < TAPS; k++) {
        vec4 tap = taps[k];
        vec3 around = x * tap.x + y * tap.y + d * tap.z;
        total += tap.w * bilinear(source, placeInSquare(squareFromDirection(around), float(level.z)), level.xy).rgb;
    }
    texel = vec4(total, 1.0);
}
