// Radiance of a pixel by `kautz2003`.
#include <constants>
#include <kautz2003>

vec3 radiance(vec3 n, vec3 v) {
    return shaded(n, v);
}
