// Means over the part of a texel inside the disk: `MEAN(name, seen)` defines vec3 name(n, spacing, across, down), the mean
// of vec3 seen(normal) on a regular grid of points; see rsibr/methods/texel_mean.py.
#define MEAN(name, seen)                                                                                   \
    vec3 name(vec3 n, float spacing, int across, int down) {                                               \
        vec2 corner = floor((n.xy + 1.0) / spacing) * spacing - 1.0;                                       \
        vec3 total = vec3(0.0);                                                                            \
        float weight = 0.0;                                                                                \
        for (int row = 0; row < down; row++) {                                                             \
            for (int column = 0; column < across; column++) {                                              \
                vec2 share = (vec2(column, row) + 0.5) / vec2(across, down);                               \
                vec2 p = share * spacing + corner;                                                         \
                float height = 1.0 - dot(p, p);                                                            \
                if (height > 0.0) {                                                                        \
                    total += seen(vec3(p, sqrt(height)));                                                  \
                    weight += 1.0;                                                                         \
                }                                                                                          \
            }                                                                                              \
        }                                                                                                  \
        return weight > 0.0 ? total / weight : seen(n);                                                    \
    }

// Points along the width and the height of a texel, in proportion to the angle that it spans
ivec2 sidesOf(vec3 n, float pace, float fewest, float most, float flattest) {
    float held = max(n.z, flattest);
    return ivec2(clamp(ceil(pace * sqrt(n.xy * n.xy / (held * held) + 1.0)), fewest, most));
}
