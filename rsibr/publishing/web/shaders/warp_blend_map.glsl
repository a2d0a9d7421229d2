// A whole map by warping and blending.
#include <warp_blend>

uniform int size;
out vec4 texel;

void main() {
    vec2 p = texelCentre(ivec2(gl_FragCoord.xy), size);
    if (!touchesDisk(p, size)) {
        texel = vec4(0.0);
        return;
    }
    texel = vec4(warpedAndBlended(normalFromDisk(p)), 1.0);
}
