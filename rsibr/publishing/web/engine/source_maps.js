"use strict";
// Stored maps as layers of one texture, each with a border of one texel and extended beyond the disk.
rsibr.SourceMaps = class SourceMaps {
  /** With `carried`, the maps of which residuals are carried: without the layer of a delta lobe. */
  constructor(gpu, bundle, carried = false) {
    const { resolution, views, arrays } = { ...bundle.stored, arrays: bundle.arrays };
    const maps = arrays["stored.maps"], mirrored = carried ? undefined : arrays["stored.mirrored"];
    const side = resolution + 2, texels = side * side;
    const isHalf = maps.type === "half" && !mirrored;
    this.resolution = resolution;
    this.scale = isHalf ? maps.scale : 1;
    this.texture = gpu.texture(side, side, isHalf ? "RGBA16F" : "RGBA32F", { layers: views });
    const from = rsibr.SourceMaps.sources(bundle), plane = resolution * resolution;
    const layers = [maps, mirrored].filter(Boolean);
    const four = isHalf ? new Uint16Array(4 * texels) : new Float32Array(4 * texels);
    for (let view = 0; view < views; view++) {
      const start = 3 * plane * view, end = start + 3 * plane;
      const parts = layers.map((one) =>
        isHalf ? one.data.subarray(start, end) : rsibr.numbers({ ...one, data: one.data.subarray(start, end) }));
      for (let i = 0; i < texels; i++) {
        for (let k = 0; k < 3; k++) {
          four[4 * i + k] = parts.reduce((sum, one) => sum + one[k * plane + from[i]], 0);
        }
      }
      gpu.upload(this.texture, four, view);
    }
  }

  /** Uniforms of `warp.glsl`. */
  get uniforms() {
    return { maps: this.texture, mapHalf: this.resolution / 2, mapScale: this.scale };
  }

  /** For each texel of a map with its border the texel inside the disk, without a border, that it takes its value from. */
  static sources(bundle) {
    const { resolution } = bundle.stored, side = resolution + 2, texels = side * side;
    const offsets = bundle.arrays["stored.filling"].data;
    return Uint32Array.from({ length: texels }, (_, i) => {
      const row = Math.floor(i / side) + offsets[i], column = (i % side) + offsets[texels + i];
      return (row - 1) * resolution + column - 1;
    });
  }
};
