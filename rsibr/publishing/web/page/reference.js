"use strict";
/* Path-traced references of a validation, and the error of a map against them. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

const COVERED = 0.5; // texels with less coverage are not judged, as in rsibr.validation.metrics

/** References of the page: descriptions with their radiance (3, N, N planar) and coverage. */
rsibr.referencesOf = function (page, arrays) {
  const sizes = new Set(page.references.map(({ size }) => size));
  const coverages = new Map(Array.from(sizes, (size) => [size, rsibr.diskCoverage(size)]));
  return page.references.map((told, k) => {
    const { size } = told, texels = size * size, radiance = rsibr.numbers(arrays[`reference${k}`]), rgba = new Float32Array(4 * texels);
    const coverage = coverages.get(size);
    for (let t = 0; t < texels; t++) {
      for (let c = 0; c < 3; c++) rgba[4 * t + c] = radiance[c * texels + t];
      rgba[4 * t + 3] = coverage[t];
    }
    return { ...told, frame: new Float32Array(told.frame), rgba };
  });
};

/** Whether at least half of each texel lies in the disk: 1 or 0, by 8 × 8 points where the rim crosses it. */
rsibr.diskCoverage = function (size) {
  const inside = new Float32Array(size * size), points = 8;
  for (let row = 0; row < size; row++) {
    for (let column = 0; column < size; column++) {
      let count = 0;
      for (let i = 0; i < points; i++) {
        for (let j = 0; j < points; j++) {
          const x = (2 * (column + (i + 0.5) / points)) / size - 1, y = (2 * (row + (j + 0.5) / points)) / size - 1;
          count += x * x + y * y < 1 ? 1 : 0;
        }
      }
      inside[row * size + column] = count / points ** 2 >= COVERED ? 1 : 0;
    }
  }
  return inside;
};

rsibr.referenceTexture = function (gl, reference) {
  const { size, rgba } = reference;
  const texture = rsibr.gl.texture(gl, gl.NEAREST, size, size, gl.RGBA32F, gl.RGBA, gl.FLOAT, rgba);
  return { ...reference, texture };
};

/** relMSE of a map, texels of the disk, and the relative error of each texel (NaN outside). */
rsibr.errorAgainst = function (reference, image) {
  const { size, rgba, floors } = reference, errors = new Float32Array(size * size).fill(NaN);
  let sum = 0, count = 0;
  for (let t = 0; t < size * size; t++) {
    if (rgba[4 * t + 3] < COVERED) continue;
    let squared = 0;
    for (let c = 0; c < 3; c++) {
      const truth = rgba[4 * t + c];
      squared += (image[3 * t + c] - truth) ** 2 / (truth ** 2 + floors[c]) / 3;
    }
    errors[t] = Math.sqrt(squared);
    sum += squared;
    count += 1;
  }
  return { relMse: sum / count, errors };
};
