// One step of the collapse of the half-vector pyramid (docs/method.md, eq. 29): weighted radiance of the levels of one
// size, plus the sum of all coarser ones; with BALANCED times the factors of eq. 30, with BALANCING these factors.
#include <half_vector_map>
#include <tables>

uniform int side;
#ifdef COARSER
uniform sampler2D coarser;
#endif
#ifdef BALANCED
uniform sampler2D balance;
#endif
out vec4 texel;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec2 p = withinDisk(halfVectorTexel(at, side));
    float cosine = halfVector(p).z;
    vec3 total = vec3(0.0);
    for (int level = FIRST_LEVEL; level <= LAST_LEVEL; level++) {
        vec4 share = byCosine(LEVEL_ROW + level, NODES - 1, cosine);
        vec4 light = halfVectorLevel(p * share.w, level);
        total += share.rgb * light.rgb / max(light.w, 1e-6);
    }
#ifdef COARSER
    total += bilinear(coarser, placeInSphereMap(p, 0.25 * float(side))).rgb;
#endif
#ifdef BALANCED
    total *= texelFetch(balance, at, 0).rgb;
#endif
#ifdef BALANCING
    vec3 wanted = vec3(0.0);
    for (int level = 0; level < LEVELS; level++) wanted += byCosine(LEVEL_ROW + level, NODES - 1, cosine).rgb;
    total = wanted / max(total, 1e-20);
#endif
    texel = vec4(total, 1.0);
}
