"use strict";
// Half-vector pyramid of a view: the mirrored environment, its levels, their weighted sum, and the light of wide
// Gaussians; see rsibr/methods/rsibr/half_vector_pyramid.py and wide_light.py.
rsibr.HalfVectorPyramid = class HalfVectorPyramid {
  /** `ladder`: [{halvings, taps}] of the levels, from the bundle; `side`: texels a side of level 0. */
  constructor(gpu, side, ladder) {
    Object.assign(this, { gpu, side, ladder });
    this.sides = ladder.map(({ halvings }) => side >> halvings);
    const { width, height, corners } = rsibr.atlas(this.sides.map((one) => one + 2));
    this.corners = corners;
    this.levels = gpu.texture(width, height, "RGBA32F");
    this.scratch = gpu.texture(side + 2, side + 2, "RGBA32F");
    const most = ladder[ladder.length - 1].halvings;
    this.sums = Array.from({ length: most + 1 }, (_, k) => gpu.texture((side >> k) + 2, (side >> k) + 2, "RGBA32F"));
    this.balances = new Map();
    this.uniforms = { halfVectors: this.levels, halfVectorLevels: corners.flatMap(([x, y], k) => [x, y, this.sides[k]]) };
    this.defines = { LEVELS: ladder.length };
  }

  /** Fill the levels for a view under a light pyramid; under an environment of radiance 1 without one. */
  fill(frame, light) {
    const { gpu, side, sides, corners, ladder } = this;
    const defines = light ? { ...this.defines, LIGHT_LEVELS: light.count } : { EVEN: 1 };
    const values = light ? { ...light.uniforms, frame, side } : { side };
    gpu.draw(gpu.program("half_vector_first", defines), this.scratch, values);
    gpu.copy(this.scratch, this.levels, [...corners[0], side + 2, side + 2]);
    for (let k = 0; k + 1 < ladder.length; k++) {
      const taps = ladder[k].taps, isHalved = ladder[k + 1].halvings > ladder[k].halvings ? 1 : 0;
      const [fine, coarse] = [sides[k], sides[k + 1]];
      const six = Array.from({ length: 6 }, (_, i) => taps[i] || 0), common = { HALVES: isHalved, COUNT: taps.length };
      gpu.draw(gpu.program("convolve", { ...common, BY_ROW: 1 }), this.scratch,
        { source: this.levels, start: corners[k], before: fine, taps: six, target: [0, 0] },
        { part: [0, 0, coarse + 2, fine + 2] });
      gpu.draw(gpu.program("convolve", { ...common, BY_ROW: 0 }), this.levels,
        { source: this.scratch, start: [0, 0], before: fine, taps: six, target: corners[k + 1] },
        { part: [...corners[k + 1], coarse + 2, coarse + 2] });
    }
  }

  /** Weighted sum of the levels over the map, for the tables of maps of one size. */
  collapsed(tables, size) {
    if (!this.balances.has(size)) throw new Error(`no balance for maps of ${size}`);
    return this._collapse(tables, { BALANCED: 1 }, this.balances.get(size));
  }

  /** Factors that make an environment of radiance 1 exact, once for the tables of maps of one size. */
  balance(tables, size) {
    if (this.balances.has(size)) return;
    this.fill(null, null);
    const sum = this._collapse(tables, { BALANCING: 1 });
    const kept = this.gpu.texture(this.side + 2, this.side + 2, "RGBA32F");
    this.gpu.copy(sum, kept, [0, 0, this.side + 2, this.side + 2]);
    this.balances.set(size, kept);
  }

  _collapse({ texture, levelRow }, last, balance) {
    const { gpu, side, ladder, sums } = this;
    for (let k = sums.length - 1; k >= 0; k--) {
      const members = ladder.map((one, level) => (one.halvings === k ? level : -1)).filter((level) => level >= 0);
      const defines = {
        ...this.defines, NODES: rsibr.constants.NODES, LEVEL_ROW: levelRow,
        FIRST_LEVEL: members[0], LAST_LEVEL: members[members.length - 1],
        ...(k + 1 < sums.length ? { COARSER: 1 } : {}), ...(k === 0 ? last : {}),
      };
      const values = { ...this.uniforms, tables: texture, side: side >> k };
      if (k + 1 < sums.length) values.coarser = sums[k + 1];
      if (k === 0 && balance) values.balance = balance;
      gpu.draw(gpu.program("collapse", defines), sums[k], values);
    }
    return sums[0];
  }
};

/** Mean light of the wide Gaussians over a polar grid of normals. */
rsibr.WideLight = class WideLight {
  constructor(gpu, points) {
    const [rings, count] = points.shape, lanes = 8, { SECTORS } = rsibr.constants;
    Object.assign(this, { gpu, count, lanes });
    this.points = gpu.texture(2 * count, rings, "RGBA32F");
    gpu.upload(this.points, rsibr.numbers(points));
    this.turns = Array.from({ length: SECTORS }, (_, k) => (2 * Math.PI * k) / SECTORS).flatMap((a) => [Math.cos(a), Math.sin(a)]);
    this.parts = gpu.texture(SECTORS * lanes, rings, "RGBA32F");
    this.grid = gpu.texture(SECTORS, rings, "RGBA32F");
  }

  fill(pyramid) {
    const { gpu, lanes } = this;
    const defines = { ...pyramid.defines, LANES: lanes };
    const values = { ...pyramid.uniforms, points: this.points, count: this.count, turns: this.turns };
    gpu.draw(gpu.program("wide_light", defines), this.parts, values);
    gpu.draw(gpu.program("wide_sum", { LANES: lanes }), this.grid, { lanes: this.parts });
  }
};
