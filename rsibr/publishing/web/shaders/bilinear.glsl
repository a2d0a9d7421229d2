// Bilinear lookups by four fetches: graphics cards filter with some 8 bits of weight.

// Place in a sphere map with a border of one texel, in texels; whole numbers are texel centres
vec2 placeInSphereMap(vec2 p, float halfSide) {
    return vec2(p.x, -p.y) * halfSide + (halfSide + 0.5);
}

// Lookup in an image that begins at a texel of a texture
vec4 bilinear(sampler2D texels, vec2 place, ivec2 start) {
    ivec2 corner = ivec2(place);
    vec2 between = place - vec2(corner);
    corner += start;
    vec4 upper = mix(texelFetch(texels, corner, 0), texelFetch(texels, corner + ivec2(1, 0), 0), between.x);
    vec4 lower = mix(texelFetch(texels, corner + ivec2(0, 1), 0), texelFetch(texels, corner + ivec2(1, 1), 0), between.x);
    return mix(upper, lower, between.y);
}

vec4 bilinear(sampler2D texels, vec2 place) {
    return bilinear(texels, place, ivec2(0));
}

vec4 bilinear(sampler2DArray texels, vec2 place, int layer) {
    ivec3 corner = ivec3(ivec2(place), layer);
    vec2 between = place - vec2(corner.xy);
    vec4 upper = mix(texelFetch(texels, corner, 0), texelFetch(texels, corner + ivec3(1, 0, 0), 0), between.x);
    vec4 lower = mix(texelFetch(texels, corner + ivec3(0, 1, 0), 0), texelFetch(texels, corner + ivec3(1, 1, 0), 0), between.x);
    return mix(upper, lower, between.y);
}
