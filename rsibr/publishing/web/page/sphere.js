"use strict";
/* The unit sphere, the environment behind it, and maps of the error on it: shaders that cast a ray a pixel. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.rayVertexGlsl = `
uniform vec3 eye, right, up, forward;
uniform float parallel;
out vec3 origin, direction;
void main() {
  vec2 place = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  vec3 across = place.x * right + place.y * up;
  origin = eye + parallel * across;
  direction = forward + (1.0 - parallel) * across;
  gl_Position = vec4(place, 0.0, 1.0);
}
`;

/* The ray's closest point to the centre decides; the rim is blended over a pixel. */
const HIT_SPHERE = `
in vec3 origin, direction;
out vec4 result;
bool hitSphere(out vec3 n, out vec3 v, out float alpha) {
  vec3 d = normalize(direction), closest = origin - d * dot(origin, d);
  float s = length(closest), width = max(fwidth(s), 1e-6);
  v = -d;
  alpha = clamp((1.0 - s) / width + 0.5, 0.0, 1.0);
  n = s < 1.0 ? normalize(closest + v * sqrt(max(1.0 - s * s, 0.0))) : closest / s;
  return alpha > 0.0;
}
`;

rsibr.sphereFragmentGlsl = (lookup) => `
${rsibr.toneGlsl}${HIT_SPHERE}${rsibr.safeNormalGlsl}${lookup}
void main() {
  vec3 n, v;
  float alpha;
  bool hit = hitSphere(n, v, alpha);
  vec3 radiance = radianceAt(safeNormal(n, n, v), v);
  if (!hit) discard;
  result = shown(radiance, alpha);
}
`;

/** Reference of a view, or the error of the map against it; texel by texel, in the parallel projection of that view. */
rsibr.referenceFragmentGlsl = () => `
${rsibr.toneGlsl}${HIT_SPHERE}
uniform sampler2D map, reference;
uniform mat3 frame;
uniform vec3 floors;              // added to the squared reference: (0.1 mean)² of each channel
uniform vec2 errorRange;          // ends of the logarithmic scale
uniform float judge;              // 1: the error, 0: the reference
void main() {
  vec3 n, v;
  float alpha;
  if (!hitSphere(n, v, alpha)) discard;
  vec3 local = n * frame;
  float size = float(textureSize(reference, 0).x);
  ivec2 texel = ivec2(clamp(floor(vec2(0.5 + 0.5 * local.x, 0.5 - 0.5 * local.y) * size), 0.0, size - 1.0));
  vec4 truth = texelFetch(reference, texel, 0);
  if (judge < 0.5) { result = shown(truth.rgb, alpha); return; }
  if (truth.a < 0.5) discard;     // less than half of the texel lies in the disk: not judged
  vec3 off = texelFetch(map, texel, 0).rgb - truth.rgb;
  vec3 squared = off * off / (truth.rgb * truth.rgb + floors);
  float error = sqrt((squared.r + squared.g + squared.b) / 3.0);
  float place = log(max(error, errorRange.x) / errorRange.x) / log(errorRange.y / errorRange.x);
  result = vec4(colour(place, 0.75) * alpha, alpha);
}
`;

/** The environment in Mitsuba's lat-long convention; its first and last rows lie on the poles. */
rsibr.backgroundFragmentGlsl = () => `
${rsibr.toneGlsl}
in vec3 origin, direction;
out vec4 result;
uniform sampler2D environment;
void main() {
  vec3 d = normalize(direction);
  float rows = float(textureSize(environment, 0).y), polar = acos(clamp(d.y, -1.0, 1.0)) / 3.141592653589793;
  vec2 place = vec2(atan(d.x, -d.z) / 6.283185307179586, (polar * (rows - 1.0) + 0.5) / rows);
  result = shown(textureLod(environment, place, 0.0).rgb, 1.0);
}
`;
