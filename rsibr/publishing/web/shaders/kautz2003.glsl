// (1 − F) k_d (diffuse) + F k_s (glossy) (Kautz et al. 2003, eq. 8; rsibr/methods/kautz2003/schlick_mix.py).
#include <cubes>
#include <harmonics>
#include <ggx>

uniform vec3 fLambda, kD, kS;
uniform float shares[1];

vec3 shaded(vec3 n, vec3 v) {
    float cosine = dot(n, v);
    vec3 fresnel = (1.0 - fLambda) * schlick(cosine) + fLambda;
    vec3 place = placeInCube(2.0 * cosine * n - v);
    vec3 glossy = mix(onCube(0, place), onCube(1, place), shares[0]);
    return (1.0 - fresnel) * kD * harmonicRadiance(n) + fresnel * kS * glossy;
}
