// A whole map of a system that shades by lookups: the mean of POINTS² points a texel (rsibr/methods/shading_method.py).
// Included after `vec3 shaded(vec3 n, vec3 v)`, the radiance toward v of surfaces with normal n, in world coordinates.
#include <sphere_map>
#include <texel_mean>

uniform mat3 frame;  // columns x, y, v
uniform int size;
out vec4 texel;

vec3 shadedInMap(vec3 n) {
    return shaded(frame * n, frame[2]);
}

MEAN(shadedOverTexel, shadedInMap)

void main() {
    vec2 p = texelCentre(ivec2(gl_FragCoord.xy), size);
    if (!touchesDisk(p, size)) {
        texel = vec4(0.0);
        return;
    }
    vec3 n = normalFromDisk(coveredMiddle(p, size));
    texel = vec4(POINTS == 1 ? shadedInMap(n) : shadedOverTexel(n, 2.0 / float(size), POINTS, POINTS), 1.0);
}
