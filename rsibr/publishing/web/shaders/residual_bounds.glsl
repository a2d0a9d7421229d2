// Trust in residuals and their bounds, from the weights of the three stored views; see
// rsibr/methods/rsibr/residual_transport.py.

float trusted(float trust, vec3 weights) {
    return pow(max(trust, LEAST_TRUST), max(1.0 - dot(weights, weights), 0.0));
}

vec3 clampedResidual(vec3 residual, vec3 prediction, vec3 weights) {
    float apart = 1.0 - max(weights.x, max(weights.y, weights.z));
    if (apart <= AT_A_STORED_VIEW) return residual;
    return max(min(residual, prediction * (BRIGHTEST / apart)), prediction * (DARKEST * apart - 1.0));
}
