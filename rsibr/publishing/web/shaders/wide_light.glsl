// Light of the wide Gaussians at the nodes of a polar grid of normals (docs/method.md, section 6.2). LANES neighbouring
// texels share the points of a node; wide_sum.glsl adds them up.
#include <constants>
#include <half_vector_map>

uniform sampler2D points;  // for each ring and point: place, level; weight
uniform int count;
uniform vec2 turns[int(SECTORS)];  // cosine and sine of each sector's azimuth
out vec4 texel;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec2 turn = turns[at.x / LANES];
    vec3 light = vec3(0.0);
    for (int k = at.x % LANES; k < count; k += LANES) {
        vec4 point = texelFetch(points, ivec2(2 * k, at.y), 0);
        vec2 p = vec2(turn.x * point.x - turn.y * point.y, turn.y * point.x + turn.x * point.y);
        vec4 found = halfVectorLevel(p, int(point.z));
        light += texelFetch(points, ivec2(2 * k + 1, at.y), 0).rgb * (found.rgb / max(found.w, 1e-6));
    }
    texel = vec4(light, 1.0);
}
