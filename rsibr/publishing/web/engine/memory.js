"use strict";
/** Bytes on the graphics card that a bundle takes with maps of `size` texels: so that a page can say it before. */
rsibr.memory = function memory(bundle, size) {
  const wide = bundle.precision === "half" ? 8 : 16, kept = bundle.methods.length;
  const maps = size * size * (16 + (kept * wide * 4) / 3);
  if (!bundle.stored) return Math.round(maps);
  const { resolution, views } = bundle.stored, layers = views * (resolution + 2) ** 2;
  const stored = layers * (bundle.arrays["stored.mirrored"] ? 16 : wide);
  const residuals = bundle.methods.includes("rsibr") ? layers * wide : 0;
  return Math.round(maps + stored + residuals);
};
