"use strict";
// The environment's image on the graphics card, with a border of one texel.
rsibr.LightImage = class LightImage {
  constructor(gpu, { data, shape, type, scale }) {
    const side = shape[shape.length - 1], plane = side * side, stride = side + 2;
    const numbers = rsibr.numbers({ data, type, scale });
    const four = new Float32Array(4 * stride * stride);
    const flip = (k) => side - 1 - k, inner = (k) => Math.min(Math.max(k, 0), side - 1);
    for (let row = -1; row <= side; row++) {
      for (let column = -1; column <= side; column++) {
        const beyondRow = row < 0 || row === side, beyondColumn = column < 0 || column === side;
        // Across an edge the projection folds back on itself; at a corner twice
        let [r, c] = [inner(row), inner(column)];
        if (beyondRow) c = flip(c);
        if (beyondColumn) r = flip(r);
        const from = r * side + c, at = 4 * ((row + 1) * stride + column + 1);
        for (let k = 0; k < 3; k++) four[at + k] = numbers[k * plane + from];
      }
    }
    this.side = side;
    this.texture = gpu.texture(stride, stride, "RGBA32F");
    gpu.upload(this.texture, four);
  }
};
