// A map extended beyond the disk, without which MIP levels have a dark rim.
#include <sphere_map>

uniform sampler2D map;
uniform int size;
uniform float largest;  // that the target's numbers hold
out vec4 texel;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec2 p = texelCentre(at, size);
    float radius = length(p), rim = 1.0 - 0.5 / float(size);
    if (!touchesDisk(p, size)) {
        vec2 q = p * (rim / radius);
        at = clamp(ivec2((q.x + 1.0) * 0.5 * float(size), (1.0 - q.y) * 0.5 * float(size)), 0, size - 1);
    }
    texel = vec4(clamp(texelFetch(map, at, 0).rgb, -largest, largest), 1.0);
}
