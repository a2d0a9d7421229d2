"use strict";
// Vectors of three numbers and matrices of nine, columns first, as WebGL takes them.
rsibr.vector = {
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  minus: (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]],
  plus: (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]],
  times: (a, s) => [a[0] * s, a[1] * s, a[2] * s],
  unit(a) {
    const largest = Math.max(...a.map(Math.abs));
    if (!(largest > 0 && largest < Infinity)) throw new RangeError(`${a} has no direction`);
    const scaled = rsibr.vector.times(a, 1 / largest);
    return rsibr.vector.times(scaled, 1 / Math.hypot(...scaled));
  },
  column: (matrix, k) => [matrix[3 * k], matrix[3 * k + 1], matrix[3 * k + 2]],
  /** Components of a vector along the columns of a frame: its transpose times the vector. */
  into: (frame, a) => [0, 1, 2].map((k) => rsibr.vector.dot(rsibr.vector.column(frame, k), a)),
};

/** Frame of a view: columns x, y, v. Without `up` the library's own, `rsibr.geometry.frame.view_frame`. */
rsibr.frame = function frame(view, up = [0, 1, 0]) {
  const { unit, cross } = rsibr.vector;
  const z = unit(view), horizontal = cross(up, z);
  const x = Math.max(...horizontal.map(Math.abs)) === 0 ? [1, 0, 0] : unit(horizontal);
  return Float32Array.from([...x, ...cross(z, x), ...z]);
};
