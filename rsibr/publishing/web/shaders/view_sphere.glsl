// Stored views on the sphere, for pixels that each have a view of their own: the triangle around it, the weights in it,
// the nearest view. Tables lie in rows of ROW texels.
#include <angles>

uniform sampler2D viewFrames;      // columns x, y and v of each view
uniform isampler2D viewTriangles;  // corners of each triangle, and its neighbours across the sides that begin at them
uniform int firstTriangle, viewCount;

vec3 storedColumn(int view, int k) {
    int at = 3 * view + k;
    return texelFetch(viewFrames, ivec2(at % ROW, at / ROW), 0).xyz;
}

ivec3 ofTriangle(int triangle, int k) {
    int at = 2 * triangle + k;
    return texelFetch(viewTriangles, ivec2(at % ROW, at / ROW), 0).xyz;
}

float volume(vec3 v, vec3 p, vec3 q) {
    return dot(v, cross(p - v, q - v));
}

// Corners of the triangle that holds a direction: a walk across the sides that it lies beyond, from triangle to triangle
ivec3 surrounding(vec3 v) {
    int triangle = firstTriangle;
    ivec3 corners = ofTriangle(triangle, 0);
    for (int k = 0; k < MOST_STEPS; k++) {
        vec3 a = storedColumn(corners.x, 2), b = storedColumn(corners.y, 2), c = storedColumn(corners.z, 2);
        vec3 inside = vec3(volume(v, a, b), volume(v, b, c), volume(v, c, a));
        float least = min(inside.x, min(inside.y, inside.z));
        if (least >= -1e-7) break;
        ivec3 beyond = ofTriangle(triangle, 1);
        triangle = inside.x == least ? beyond.x : inside.y == least ? beyond.y : beyond.z;
        corners = ofTriangle(triangle, 0);
    }
    return corners;
}

float solidAngle(vec3 a, vec3 b, vec3 c) {
    return 2.0 * angleOf(dot(a, cross(b - a, c - a)), 1.0 + dot(a, b) + dot(b, c) + dot(c, a));
}

vec3 sharesOf(vec3 raw) {
    raw = max(raw, 0.0);
    return raw / (raw.x + raw.y + raw.z);
}

vec3 areaWeights(vec3 v, ivec3 views) {
    vec3 a = storedColumn(views.x, 2), b = storedColumn(views.y, 2), c = storedColumn(views.z, 2);
    return sharesOf(vec3(solidAngle(v, b, c), solidAngle(v, c, a), solidAngle(v, a, b)));
}

vec3 gnomonicWeights(vec3 v, ivec3 views) {
    vec3 a = storedColumn(views.x, 2), b = storedColumn(views.y, 2), c = storedColumn(views.z, 2);
    return sharesOf(vec3(volume(v, b, c), volume(v, c, a), volume(v, a, b)));
}

int nearestView(vec3 v) {
    int best = 0;
    float most = -2.0;
    for (int k = 0; k < viewCount; k++) {
        float cosine = dot(v, storedColumn(k, 2));
        if (cosine > most) {
            best = k;
            most = cosine;
        }
    }
    return best;
}

vec3 intoStored(int view, vec3 w) {
    return vec3(dot(storedColumn(view, 0), w), dot(storedColumn(view, 1), w), dot(storedColumn(view, 2), w));
}

// Unit normal of a stored map with the mirror direction of a surface with normal n seen from v
vec3 mirrorNormalOf(int view, vec3 n, vec3 v) {
    vec3 between = n * max(2.0 * dot(n, v), 1e-9) + (storedColumn(view, 2) - v);
    return intoStored(view, between * inversesqrt(max(dot(between, between), 1e-30)));
}
