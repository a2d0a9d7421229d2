"use strict";
// Stored views as textures, for pixels that each have a view of their own; the other half is view_sphere.glsl.
rsibr.PixelViews = class PixelViews {
  static ROW = 1024;

  constructor(gpu, sphere) {
    this.sphere = sphere;
    const frames = [];
    for (let k = 0; k < 3 * sphere.count; k++) frames.push(...rsibr.vector.column(sphere.frames, k), 0);
    const triangles = PixelViews.withNeighbours(sphere.triangles);
    this.values = {
      viewFrames: PixelViews._texture(gpu, Float32Array.from(frames), "RGBA32F"),
      viewTriangles: PixelViews._texture(gpu, triangles, "RGBA32I"),
      viewCount: sphere.count,
    };
    this.defines = { ROW: PixelViews.ROW, MOST_STEPS: sphere.triangles.length / 3 };
  }

  /** Uniforms of a picture around a middle view, at whose triangle the search of each pixel begins. */
  uniforms(view) {
    const corners = this.sphere.surrounding(view), { triangles } = this.sphere;
    let first = 0;
    while (corners.some((one, k) => triangles[3 * first + k] !== one)) first++;
    return { ...this.values, firstTriangle: first };
  }

  /** Corners of each triangle and its neighbours across the sides that begin at them, two rows of four. */
  static withNeighbours(triangles) {
    const owner = new Map(), count = triangles.length / 3, key = (a, b) => `${a} ${b}`;
    for (let i = 0; i < triangles.length; i++) {
      const next = triangles[i - (i % 3) + ((i + 1) % 3)];
      owner.set(key(triangles[i], next), Math.floor(i / 3));
    }
    const rows = new Int32Array(8 * count);
    for (let i = 0; i < triangles.length; i++) {
      const t = Math.floor(i / 3), k = i % 3, next = triangles[3 * t + ((k + 1) % 3)];
      rows[8 * t + k] = triangles[i];
      rows[8 * t + 4 + k] = owner.get(key(next, triangles[i]));
    }
    return rows;
  }

  static _texture(gpu, numbers, format) {
    const width = PixelViews.ROW, height = Math.ceil(numbers.length / 4 / width);
    const padded = new numbers.constructor(4 * width * height);
    padded.set(numbers);
    const texture = gpu.texture(width, height, format);
    gpu.upload(texture, padded);
    return texture;
  }
};
