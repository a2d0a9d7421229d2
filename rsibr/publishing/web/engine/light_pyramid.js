"use strict";
// The environment at rising blur: each level is blurred from the one before it, as rsibr/light/environment_pyramid.py does.
rsibr.LightPyramid = class LightPyramid {
  /** `light`: the image, a `LightImage`; `ladder`: widths, sides and blurs of the levels, from the bundle. */
  constructor(gpu, light, ladder, taps) {
    const { widths, sides, blurs } = ladder, strides = sides.map((side) => side + 2);
    const { width, height, corners } = rsibr.atlas(strides);
    Object.assign(this, { gpu, light, ladder, taps, strides, corners });
    this.texture = gpu.texture(width, height, "RGBA32F");
    this.count = sides.length;
    this.uniforms = {
      lightTexels: this.texture,
      lightLevels: corners.flatMap(([x, y], k) => [x, y, sides[k]]),
      lightVariances: widths.map((one) => Math.fround(one * one)),
      lightFinest: widths[Math.min(1, widths.length - 1)],
    };
    gpu.copy(light.texture, this.texture, [...corners[0], strides[0], strides[0]]);
    this.made = 1;
    this.scratch = gpu.texture(strides[0], strides[0], "RGBA32F");
  }

  get isWhole() {
    return this.made === this.count;
  }

  /** Blur the next level. */
  step() {
    const { gpu, ladder, corners, strides } = this, k = this.made, side = ladder.sides[k];
    const program = gpu.program("blur_light", { TAPS: this.taps.length / 3 });
    const taps = [];
    for (let i = 0; i < this.taps.length; i += 3) {
      const x = this.taps[i] * ladder.blurs[k], y = this.taps[i + 1] * ladder.blurs[k], angle = Math.hypot(x, y);
      const ratio = angle > 0 ? Math.sin(angle) / angle : 1;
      taps.push(x * ratio, y * ratio, Math.cos(angle), this.taps[i + 2]);
    }
    const values = { source: this.texture, level: [...corners[k - 1], ladder.sides[k - 1]], side, taps };
    gpu.draw(program, this.scratch, values, { part: [0, 0, strides[k], strides[k]] });
    gpu.copy(this.scratch, this.texture, [...corners[k], strides[k], strides[k]]);
    this.made++;
    if (this.isWhole) {
      gpu.free(this.scratch);
      this.scratch = null;
    }
  }

  finish() {
    while (!this.isWhole) this.step();
  }
};
