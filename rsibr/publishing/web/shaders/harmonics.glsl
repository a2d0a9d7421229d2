// Irradiance over π from nine spherical-harmonic coefficients; see rsibr/light/harmonic_irradiance.py.
uniform vec3 harmonics[9];

vec3 harmonicRadiance(vec3 n) {
    vec3 total = 0.28209479177387814 * harmonics[0];
    total += 0.4886025119029199 * (n.y * harmonics[1] + n.z * harmonics[2] + n.x * harmonics[3]);
    total += 1.0925484305920792 * (n.x * n.y * harmonics[4] + n.y * n.z * harmonics[5] + n.x * n.z * harmonics[7]);
    total += 0.31539156525252005 * (3.0 * n.z * n.z - 1.0) * harmonics[6];
    total += 0.5462742152960396 * (n.x * n.x - n.y * n.y) * harmonics[8];
    return max(total, 0.0);
}
