// Sum of the lanes of each node of the polar grid.
uniform sampler2D lanes;
out vec4 texel;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec3 light = vec3(0.0);
    for (int k = 0; k < LANES; k++) light += texelFetch(lanes, ivec2(LANES * at.x + k, at.y), 0).rgb;
    texel = vec4(light, 1.0);
}
