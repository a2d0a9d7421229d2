"use strict";
// What a bundle takes on the graphics card, and whether there is room for it.
(() => {
  const area = (side) => (side + 2) * (side + 2);
  const sum = (numbers) => numbers.reduce((total, one) => total + one, 0);

  /** Bytes on the graphics card with maps of `size` texels of all methods: so that a page can say it before. */
  rsibr.memory = function memory(bundle, size) {
    const { arrays, stored, model, light, methods } = bundle, wide = bundle.precision === "half" ? 8 : 16;
    const maps = size * size * (16 + (methods.length * wide * 4) / 3);
    const layers = stored ? stored.views * area(stored.resolution) : 0, mirrored = arrays["stored.mirrored"];
    const sources = layers * (mirrored ? 16 : wide) + (model && mirrored ? layers * 16 : 0);
    const residuals = model && model.carries ? layers * wide : 0;
    const levels = model && light ? sum(light.sides.slice(0, model.lightLevels).map(area)) * 16 : 0;
    const image = light ? area(light.sides[0]) * 16 : 0;
    const pyramid = model && model.hasLevels ? 6 * area(model.side) * 16 : 0;
    return Math.round(maps + sources + residuals + levels + image + pyramid);
  };

  /** Throw `Unsupported` where the graphics card cannot keep the stored maps or the light of a bundle. */
  rsibr.requireRoom = function requireRoom(gl, bundle) {
    const { stored, light } = bundle;
    const mostLayers = gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS), mostTexels = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (stored && stored.views > mostLayers) {
      throw new rsibr.Unsupported(
        `This graphics card keeps at most ${mostLayers} maps, the page holds ${stored.views}. Export it from a bake of fewer views.`);
    }
    const widest = Math.max(stored ? stored.resolution + 2 : 0, light ? 2 * (light.sides[0] + 2) : 0);
    if (widest > mostTexels) {
      throw new rsibr.Unsupported(
        `This graphics card draws at most ${mostTexels} texels a side, the page needs ${widest}. Export it with smaller maps.`);
    }
  };
})();
