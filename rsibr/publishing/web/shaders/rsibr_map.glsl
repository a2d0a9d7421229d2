// A whole map by `rsibr`: prediction plus carried residuals (rsibr/methods/rsibr/residual_method.py).
#include <prediction>
#if RESIDUALS
#include <warp_blend>
#include <residual_transport>
#endif

uniform int size;
out vec4 texel;

void main() {
    vec2 p = texelCentre(ivec2(gl_FragCoord.xy), size);
    if (!touchesDisk(p, size)) {
        texel = vec4(0.0);
        return;
    }
    vec3 middle = normalFromDisk(coveredMiddle(p, size)), radiance = predicted(middle, size, true);
#if RESIDUALS
    vec3 n = normalFromDisk(p);
    vec3 residual = byCosine(ALBEDO_ROW, ALBEDO_NODES - 1, middle.z).rgb * carriedResidual(n);
    vec3 nearness = vec3(gnomonic[0], gnomonic[1], gnomonic[2]);
    residual *= trusted(byCosine(TRUST_ROW, BELIEF_NODES - 1, n.z).x, nearness);
#if BELIEVES && !KEEPS_NEGATIVES
    residual = clampedResidual(residual, radiance, nearness);
#endif
    radiance += residual;
#if HEDGED
    radiance = mix(warpedAndBlended(n), radiance, byCosine(WEIGHT_ROW, BELIEF_NODES - 1, n.z).rgb);
#endif
#endif
#if !KEEPS_NEGATIVES
    radiance = max(radiance, 0.0);
#endif
    texel = vec4(radiance, 1.0);
}
