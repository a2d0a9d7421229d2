"use strict";
/* Radiance of a surface: from one map for the camera's central direction, or from the view of each pixel. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.lookups = {
  pixel: "Each pixel's view",
  "map-reflection": "Map by reflection",
  "map-normal": "Map by normal",
};

/** Texture units of the page; the engine's own start at 4. */
rsibr.mapUnit = 0;
rsibr.colourUnit = 1;
rsibr.referenceUnit = 2;
rsibr.environmentUnit = 3;
rsibr.engineUnit = 4;

/** GLSL of a safe normal: unit, on the viewer's side of the face, not below its horizon. See rsibr/shading/surfaces.py. */
rsibr.safeNormalGlsl = `
const float PAGE_LEAST_COSINE = 1e-3;
vec3 pageSafeNormal(vec3 shading, vec3 face, vec3 v) {
  vec3 facing = dot(face, v) < 0.0 ? -face : face;
  float size = length(shading);
  vec3 n = size > 0.1 ? shading / size : facing;
  if (dot(n, facing) < 0.0) n = -n;
  float cosine = dot(n, v);
  if (cosine >= PAGE_LEAST_COSINE) return n;
  vec3 along = n - v * cosine;
  float squared = dot(along, along);
  if (squared < 1e-8) along = normalize(cross(v, abs(v.y) < 0.9 ? vec3(0, 1, 0) : vec3(1, 0, 0)));
  else along *= inversesqrt(squared);
  return along * sqrt(1.0 - PAGE_LEAST_COSINE * PAGE_LEAST_COSINE) + v * PAGE_LEAST_COSINE;
}
`;

/** GLSL `vec3 pageRadianceAt(vec3 n, vec3 v)` from the map of the view `frame[2]`; row 0 of its texture is the top.

    The paper's mirror index takes the normal that sends the pixel's mirror direction to the map's viewer. */
rsibr.mapLookupGlsl = (byReflection) => `
uniform sampler2D pageMap;
uniform mat3 pageFrame;               // columns x, y, view
vec3 pageRadianceAt(vec3 n, vec3 v) {
  vec3 index = ${byReflection ? "normalize(reflect(-v, n) + pageFrame[2] * (1.0 + 1e-6))" : "n"};
  vec3 local = index * pageFrame;
  if (local.z < 0.0) local.xy = normalize(local.xy);
  return texture(pageMap, vec2(0.5 + 0.5 * local.x, 0.5 - 0.5 * local.y)).rgb;
}
`;

/** GLSL `pageRadianceAt` of a lookup; of the view of each pixel it is the engine's, which goes before all of the page. */
rsibr.lookupGlsl = function (shader, lookup) {
  if (lookup !== "pixel") return rsibr.mapLookupGlsl(lookup === "map-reflection");
  return `${shader.glsl}\nvec3 pageRadianceAt(vec3 n, vec3 v) { return radiance(n, v); }\n`;
};
