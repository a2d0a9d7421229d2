// Level 0 of the half-vector pyramid: environment mirrored by each half-vector times h·v, and h·v (docs/method.md, eq. 22).
// With EVEN an environment of radiance 1.
#include <constants>
#include <half_vector_map>
#ifndef EVEN
#include <light_pyramid>
uniform mat3 frame;
#endif

uniform int side;
out vec4 texel;

void main() {
    vec2 p = halfVectorTexel(ivec2(gl_FragCoord.xy), side);
    vec3 h = halfVector(p);
    float seen = max(h.z, 0.0);
#ifdef EVEN
    texel = vec4(seen);
#else
    vec3 direction = frame * vec3(2.0 * h.z * h.xy, 2.0 * h.z * h.z - 1.0);
    float blur = 2.0 * sqrt(FIRST_VARIANCE) * (2.0 / float(side));
    float width = blur * (2.0 / (1.0 + dot(p, p))) * sqrt(max(seen, LEAST_HEIGHT));
    texel = vec4(blurredLight(direction, width) * seen, seen);
#endif
}
