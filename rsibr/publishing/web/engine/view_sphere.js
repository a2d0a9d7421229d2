"use strict";
// Stored views on the sphere: the nearest one, the triangle around a view, and the weights in it.
rsibr.ViewSphere = class ViewSphere {
  constructor(directions, triangles, frames) {
    Object.assign(this, { directions, triangles, frames });
    this.count = directions.length / 3;
  }

  direction(index) {
    return Array.from(this.directions.subarray(3 * index, 3 * index + 3));
  }

  /** Frame of a stored map, columns x, y, v. */
  frame(index) {
    return this.frames.subarray(9 * index, 9 * index + 9);
  }

  /** Index of the stored view nearest to a direction; the first of several. */
  nearest(view) {
    let best = 0, most = -2;
    for (let k = 0; k < this.count; k++) {
      const cosine = rsibr.vector.dot(view, this.direction(k));
      if (cosine > most) [best, most] = [k, cosine];
    }
    return best;
  }

  /** Indices of the three views whose triangle holds a direction: the one whose nearest side is farthest inside. */
  surrounding(view) {
    const { dot, cross, minus } = rsibr.vector;
    let best = 0, deepest = -Infinity;
    for (let t = 0; t < this.triangles.length; t += 3) {
      const corners = [0, 1, 2].map((k) => this.direction(this.triangles[t + k]));
      let depth = Infinity;
      for (let k = 0; k < 3; k++) {
        const p = corners[k], q = corners[(k + 1) % 3], side = minus(q, p);
        const inside = dot(view, cross(minus(p, view), minus(q, view))) / Math.sqrt(dot(side, side));
        depth = Math.min(depth, inside);
      }
      if (depth > deepest) [best, deepest] = [t, depth];
    }
    return Array.from(this.triangles.subarray(best, best + 3));
  }

  /** Areas of the sub-triangles of a direction over that of the triangle (Cabral et al. 1999, section 3.4). */
  areaWeights(view, indices) {
    const { dot, cross, minus } = rsibr.vector;
    const area = (a, b, c) =>
      2 * Math.atan2(dot(a, cross(minus(b, a), minus(c, a))), 1 + dot(a, b) + dot(b, c) + dot(c, a));
    return this._weights(view, indices, area);
  }

  /** Barycentric weights of the direction's gnomonic projection onto the triangle's plane. */
  gnomonicWeights(view, indices) {
    const { dot, cross, minus } = rsibr.vector;
    return this._weights(view, indices, (v, p, q) => dot(v, cross(minus(p, v), minus(q, v))));
  }

  _weights(view, indices, measure) {
    const [a, b, c] = indices.map((index) => Array.from(rsibr.vector.column(this.frame(index), 2)));
    const raw = [measure(view, b, c), measure(view, c, a), measure(view, a, b)].map((one) => Math.max(one, 0));
    const total = raw[0] + raw[1] + raw[2];
    return raw.map((one) => one / total);
  }
};
