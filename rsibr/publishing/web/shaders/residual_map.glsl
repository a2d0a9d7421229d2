// Residual of a stored map over the albedo, (S − P)/E, at its own texels (docs/method.md, eq. 32).
#include <prediction>

uniform sampler2DArray maps;
uniform float mapScale;
uniform int view, size;
out vec4 texel;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec3 n = normalFromDisk(coveredMiddle(texelCentre(at, size), size));
    vec3 stored = texelFetch(maps, ivec3(at + 1, view), 0).rgb * mapScale;
    texel = vec4((stored - predicted(n, size, CARRIES_MIRROR == 1)) / byCosine(ALBEDO_ROW, ALBEDO_NODES - 1, n.z).rgb, 1.0);
}
