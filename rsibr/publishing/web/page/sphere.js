"use strict";
/* The unit sphere, the environment behind it, and maps of the error on it: shaders that cast a ray a pixel. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.rayVertexGlsl = `
uniform vec3 pageEye, pageRight, pageUp, pageForward;
uniform float pageParallel;
out vec3 pageOrigin, pageDirection;
void main() {
  vec2 place = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  vec3 across = place.x * pageRight + place.y * pageUp;
  pageOrigin = pageEye + pageParallel * across;
  pageDirection = pageForward + (1.0 - pageParallel) * across;
  gl_Position = vec4(place, 0.0, 1.0);
}
`;

/* The ray's closest point to the centre decides; the rim is blended over a pixel. */
const HIT_SPHERE = `
in vec3 pageOrigin, pageDirection;
out vec4 pageResult;
bool pageHitSphere(out vec3 n, out vec3 v, out float alpha) {
  vec3 d = normalize(pageDirection), closest = pageOrigin - d * dot(pageOrigin, d);
  float s = length(closest), width = max(fwidth(s), 1e-6);
  v = -d;
  alpha = clamp((1.0 - s) / width + 0.5, 0.0, 1.0);
  n = s < 1.0 ? normalize(closest + v * sqrt(max(1.0 - s * s, 0.0))) : closest / s;
  return alpha > 0.0;
}
`;

rsibr.sphereFragmentGlsl = (lookup) => `
${lookup}${rsibr.toneGlsl}${HIT_SPHERE}${rsibr.safeNormalGlsl}
void main() {
  vec3 n, v;
  float alpha;
  bool hit = pageHitSphere(n, v, alpha);
  vec3 found = pageRadianceAt(pageSafeNormal(n, n, v), v);
  if (!hit) discard;
  pageResult = pageShown(found, alpha);
}
`;

/** Reference of a view, or the error of the map against it; texel by texel, in the parallel projection of that view. */
rsibr.referenceFragmentGlsl = () => `
${rsibr.toneGlsl}${HIT_SPHERE}
uniform sampler2D pageMap, pageReference;
uniform mat3 pageFrame;
uniform vec3 pageFloors;              // added to the squared reference: (0.1 mean)² of each channel
uniform vec2 pageErrorRange;          // ends of the logarithmic scale
uniform float pageJudge;              // 1: the error, 0: the reference
void main() {
  vec3 n, v;
  float alpha;
  if (!pageHitSphere(n, v, alpha)) discard;
  vec3 local = n * pageFrame;
  float size = float(textureSize(pageReference, 0).x);
  ivec2 texel = ivec2(clamp(floor(vec2(0.5 + 0.5 * local.x, 0.5 - 0.5 * local.y) * size), 0.0, size - 1.0));
  vec4 truth = texelFetch(pageReference, texel, 0);
  if (pageJudge < 0.5) { pageResult = pageShown(truth.rgb, alpha); return; }
  if (truth.a < 0.5) discard;     // less than half of the texel lies in the disk: not judged
  vec3 off = texelFetch(pageMap, texel, 0).rgb - truth.rgb;
  vec3 squared = off * off / (truth.rgb * truth.rgb + pageFloors);
  float error = sqrt((squared.r + squared.g + squared.b) / 3.0);
  float place = log(max(error, pageErrorRange.x) / pageErrorRange.x) / log(pageErrorRange.y / pageErrorRange.x);
  pageResult = vec4(pageColour(place, 0.75) * alpha, alpha);
}
`;

/** The environment in Mitsuba's lat-long convention; its first and last rows lie on the poles. */
rsibr.backgroundFragmentGlsl = () => `
${rsibr.toneGlsl}
in vec3 pageOrigin, pageDirection;
out vec4 pageResult;
uniform sampler2D pageEnvironment;
void main() {
  vec3 d = normalize(pageDirection);
  float rows = float(textureSize(pageEnvironment, 0).y), polar = acos(clamp(d.y, -1.0, 1.0)) / 3.141592653589793;
  vec2 place = vec2(atan(d.x, -d.z) / 6.283185307179586, (polar * (rows - 1.0) + 0.5) / rows);
  pageResult = pageShown(textureLod(pageEnvironment, place, 0.0).rgb, 1.0);
}
`;
