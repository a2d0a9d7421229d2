// Angles to the last bits of a single number; the functions of the language may err by 1e-4.
const float PI = 3.14159265358979323846;

// Arctangent of a number in [0, 1] (Cephes, atanf)
float arctangent(float x) {
    bool isUpper = x > 0.4142135623730950;
    float t = isUpper ? (x - 1.0) / (x + 1.0) : x, z = t * t;
    float series = (((8.05374449538e-2 * z - 1.38776856032e-1) * z + 1.99777106478e-1) * z - 3.33329491539e-1) * z * t + t;
    return isUpper ? series + 0.25 * PI : series;
}

// Angle of the point (x, y), in (−π, π]
float angleOf(float y, float x) {
    float a = abs(x), b = abs(y), most = max(a, b);
    float angle = most > 0.0 ? arctangent(min(a, b) / most) : 0.0;
    angle = b > a ? 0.5 * PI - angle : angle;
    angle = x < 0.0 ? PI - angle : angle;
    return y < 0.0 ? -angle : angle;
}
