"use strict";
// An octahedral image on the graphics card, with a border of one texel from across the folds.
rsibr.LightImage = class LightImage {
  constructor(gpu, image) {
    const { four, side, stride } = LightImage.bordered(image);
    this.side = side;
    this.texture = gpu.texture(stride, stride, "RGBA32F");
    gpu.upload(this.texture, four);
  }

  /** An image (3, N, N) of a bundle with its border, four numbers a texel. */
  static bordered({ data, shape, type, scale }) {
    const side = shape[shape.length - 1], plane = side * side, stride = side + 2;
    const numbers = rsibr.numbers({ data, type, scale }), four = new Float32Array(4 * stride * stride);
    const inner = (k) => Math.min(Math.max(k, 0), side - 1);
    for (let row = -1; row <= side; row++) {
      for (let column = -1; column <= side; column++) {
        const isBeyondRow = row < 0 || row === side, isBeyondColumn = column < 0 || column === side;
        const r = isBeyondColumn ? side - 1 - inner(row) : inner(row);
        const c = isBeyondRow ? side - 1 - inner(column) : inner(column);
        const at = 4 * ((row + 1) * stride + column + 1);
        for (let k = 0; k < 3; k++) four[at + k] = numbers[k * plane + r * side + c];
      }
    }
    return { four, side, stride };
  }
};
