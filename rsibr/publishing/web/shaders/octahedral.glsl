// Octahedral projection; see rsibr/geometry/projections/octahedral.py. Images have a border of one texel.

float signed1(float x) {
    return floatBitsToInt(x) < 0 ? -1.0 : 1.0;
}

vec2 squareFromDirection(vec3 d) {
    vec2 p = d.xy / (abs(d.x) + abs(d.y) + abs(d.z));
    vec2 folded = (1.0 - abs(p.yx)) * vec2(signed1(p.x), signed1(p.y));
    return d.z < 0.0 ? folded : p;
}

vec3 directionFromSquare(vec2 p) {
    float z = 1.0 - abs(p.x) - abs(p.y);
    vec2 folded = (1.0 - abs(p.yx)) * vec2(signed1(p.x), signed1(p.y));
    return normalize(vec3(z < 0.0 ? folded : p, z));
}

// Place in a bordered image of so many texels a side, in texels; whole numbers are texel centres
vec2 placeInSquare(vec2 p, float side) {
    return p * (0.5 * side) + (0.5 * side + 0.5);
}

// Texel inside an image, without its border, that a texel of the border takes its value from: across the fold
ivec2 beyondTheFold(ivec2 texel, int side) {
    ivec2 inside = texel - 1;
    if (texel.y == 0 || texel.y == side + 1) inside = ivec2(side - 1 - inside.x, clamp(inside.y, 0, side - 1));
    if (texel.x == 0 || texel.x == side + 1) inside = ivec2(clamp(inside.x, 0, side - 1), side - 1 - inside.y);
    return inside;
}
