// Bilinear lookup in a polar grid of normals; see rsibr/methods/rsibr/polar_grid.py.
#include <angles>

vec3 onPolarGrid(sampler2D nodes, vec3 n) {
    float angle = angleOf(length(n.xy), n.z) * (2.0 / PI * RINGS);
    float azimuth = angleOf(n.y, n.x) * (SECTORS / (2.0 * PI));
    float turn = azimuth < 0.0 ? azimuth + SECTORS : azimuth;
    int ring = min(int(angle), int(RINGS) - 1), sector = min(int(turn), int(SECTORS) - 1);
    float outward = angle - float(ring), around = turn - float(sector);
    int following = sector + 1 == int(SECTORS) ? 0 : sector + 1;
    vec3 inner = mix(texelFetch(nodes, ivec2(sector, ring), 0).rgb, texelFetch(nodes, ivec2(following, ring), 0).rgb, around);
    vec3 outer = mix(texelFetch(nodes, ivec2(sector, ring + 1), 0).rgb, texelFetch(nodes, ivec2(following, ring + 1), 0).rgb, around);
    return mix(inner, outer, outward);
}
