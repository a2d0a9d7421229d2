// A stored map with its border, extended beyond the disk from the nearest texel inside.
uniform sampler2D map;        // without the border
uniform isampler2D filling;   // columns and rows to that texel
uniform float largest;        // that the target's numbers hold
out vec4 texel;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    texel = clamp(texelFetch(map, at + texelFetch(filling, at, 0).xy - 1, 0), -largest, largest);
}
