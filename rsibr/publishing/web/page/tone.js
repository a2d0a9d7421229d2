"use strict";
/* From radiance to colours of the screen: exposure, tone curve, false colour with its scale. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.toneCurves = {
  linear: "Linear, clipped",
  filmic: "Filmic (ACES-like)",
  luminance: "False colour of luminance",
};

/** Stops that the scale of luminance spans below and above the radiance that is white. */
rsibr.luminanceStops = { below: 8, above: 4 };

/** GLSL: `vec4 pageShown(vec3 radiance, float alpha)`, sRGB with premultiplied alpha. Filmic: Narkowicz (2015). */
rsibr.toneGlsl = `
uniform float pageExposure;
uniform int pageToneCurve;            // in the order of rsibr.toneCurves
uniform vec2 pageLuminanceStops;      // below, above
uniform sampler2D pageColours;        // row 0: luminance, row 1: error
vec3 pageEncoded(vec3 x) { return mix(12.92 * x, 1.055 * pow(max(x, 1e-8), vec3(1.0 / 2.4)) - 0.055, step(0.0031308, x)); }
vec3 pageFilmic(vec3 x) { return clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0); }
vec3 pageColour(float place, float row) {
  float n = float(textureSize(pageColours, 0).x);
  return texture(pageColours, vec2((clamp(place, 0.0, 1.0) * (n - 1.0) + 0.5) / n, row)).rgb;
}
vec3 pageToned(vec3 light) {
  vec3 x = max(light, 0.0) * pageExposure;
  if (pageToneCurve == 0) return pageEncoded(min(x, 1.0));
  if (pageToneCurve == 1) return pageEncoded(pageFilmic(min(x, 1e4)));
  float stops = log2(max(dot(x, vec3(0.2126, 0.7152, 0.0722)), 1e-20));
  return pageColour((stops + pageLuminanceStops.x) / (pageLuminanceStops.x + pageLuminanceStops.y), 0.25);
}
vec4 pageShown(vec3 light, float alpha) { return vec4(pageToned(light) * alpha, alpha); }
`;

rsibr.formatted = function (value) {
  const text = Math.abs(value) >= 1e4 || Math.abs(value) < 1e-3 ? value.toExponential(1) : String(+value.toPrecision(2));
  return text.replace("e+", "e").replace("-", "−");
};

/** Ticks of the scale of luminance: [place in 0 … 1, label], whole powers of ten of radiance. */
rsibr.luminanceTicks = function (exposure) {
  const { below, above } = rsibr.luminanceStops, ticks = [];
  const low = 2 ** -below / exposure, high = 2 ** above / exposure;
  for (let k = Math.ceil(Math.log10(low)); 10 ** k <= high; k++) {
    ticks.push([(Math.log2(10 ** k * exposure) + below) / (below + above), rsibr.formatted(10 ** k)]);
  }
  return ticks;
};
