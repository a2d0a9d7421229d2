// Radiance of a pixel by `miller1984`.
#include <constants>
#include <miller1984>

vec3 radiance(vec3 n, vec3 v) {
    return shaded(n, v);
}
