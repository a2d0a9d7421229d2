// Convolution along the rows or the columns of a level, at the same side or to half of it (docs/method.md, eq. 23).
uniform sampler2D source;
uniform ivec2 start;      // corner of the source
uniform int before;       // texels along the axis before, without the border
uniform float taps[6];
uniform ivec2 target;     // corner of the target
out vec4 texel;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) - target;
    int place = BY_ROW == 1 ? at.x : at.y;
    int first = (HALVES == 1 ? 2 * place : place) - COUNT / 2;
    vec4 total = vec4(0.0);
    for (int k = 0; k < COUNT; k++) {
        int there = first + k;
        if (there >= 0 && there < before + 2) {
            ivec2 from = BY_ROW == 1 ? ivec2(there, at.y) : ivec2(at.x, there);
            total += taps[k] * texelFetch(source, start + from, 0);
        }
    }
    texel = total;
}
