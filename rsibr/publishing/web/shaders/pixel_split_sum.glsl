// Radiance of a pixel by `split-sum`.
#include <constants>
#include <split_sum>

vec3 radiance(vec3 n, vec3 v) {
    return shaded(n, v);
}
