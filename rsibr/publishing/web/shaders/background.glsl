// The environment as a latitude–longitude image in Mitsuba's convention: −Z, +X, +Z, −X at u = 0, ¼, ½, ¾, the first
// and the last row on the poles.
#include <octahedral>
#include <bilinear>

uniform sampler2D light;
uniform float side, largest;
uniform ivec2 size;
out vec4 texel;

void main() {
    float turn = gl_FragCoord.x / float(size.x) * 6.283185307179586;
    float polar = (gl_FragCoord.y - 0.5) / float(size.y - 1) * 3.141592653589793;
    vec3 d = vec3(sin(polar) * sin(turn), cos(polar), -sin(polar) * cos(turn));
    texel = vec4(min(bilinear(light, placeInSquare(squareFromDirection(d), side)).rgb, largest), 1.0);
}
