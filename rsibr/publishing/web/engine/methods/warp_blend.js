"use strict";
// `nearest`, `blend` and `cabral1999`: stored maps, warped or not, and blended.
(() => {
  const { dot, cross, minus, plus, times, column, into } = rsibr.vector;

  /** Rotation from a frame to the stored one, and what a warp needs besides; see rsibr/methods/warp_blend/warp.py. */
  rsibr.mirrorWarp = function mirrorWarp(stored, frame) {
    const v = column(frame, 2), shift = minus(column(stored, 2), v);
    const singular = times(shift, -1 / Math.sqrt(Math.max(dot(shift, shift), 1e-30)));
    return {
      rotation: rsibr.rotation(stored, frame),
      shift: into(stored, shift),
      singular: [dot(column(frame, 0), singular), dot(column(frame, 1), singular)],
    };
  };

  rsibr.rotation = (stored, frame) => [0, 1, 2].flatMap((k) => into(stored, column(frame, k)));

  /** Rotation without a warp: the frame is carried to the stored view along the great circle between the two. */
  function carried(stored, frame) {
    const from = column(frame, 2), to = column(stored, 2);
    const axis = cross(from, to), cosine = dot(from, to);
    const columns = [0, 1, 2].map((k) => {
      const n = column(frame, k);
      const along = dot(axis, n) / Math.max(1 + cosine, 1e-7);
      return plus(plus(times(n, cosine), cross(axis, n)), times(axis, along));
    });
    return columns.flatMap((one) => into(stored, one));
  }

  /** Uniforms of `warp.glsl` toward stored views. */
  rsibr.warpUniforms = function warpUniforms(sphere, indices, weights, frame, warp = "mirror") {
    const warps = indices.map((index) => {
      const stored = sphere.frame(index), mirror = rsibr.mirrorWarp(stored, frame);
      return warp === "none" ? { ...mirror, rotation: carried(stored, frame) } : mirror;
    });
    const three = (list) => [0, 1, 2].map((k) => list[Math.min(k, list.length - 1)]);
    return {
      views: three(indices),
      weights: three(weights),
      rotations: three(warps).flatMap((one) => one.rotation),
      shifts: three(warps).flatMap((one) => one.shift),
      singular: three(warps).flatMap((one) => one.singular),
    };
  };

  class WarpBlend {
    constructor(engine, warp, count) {
      Object.assign(this, { engine, warp, count });
    }

    draw(frame, target) {
      const { gpu, sphere, sources } = this.engine, v = column(frame, 2);
      const indices = this.count === 1 ? [sphere.nearest(v)] : sphere.surrounding(v);
      const weights = this.count === 1 ? [1] : sphere.areaWeights(v, indices);
      const program = gpu.program("warp_blend_map", { WARP: this.warp.toUpperCase(), COUNT: this.count });
      gpu.draw(program, target, {
        ...sources.uniforms, ...rsibr.warpUniforms(sphere, indices, weights, frame, this.warp), size: target.width,
      });
    }

    /** Shader of a pixel, and its uniforms around a middle view; see `Engine.pixelShader`. */
    pixel() {
      const { sources, pixelViews } = this.engine;
      const defines = { WARP: this.warp.toUpperCase(), COUNT: this.count, ...pixelViews.defines };
      return {
        glsl: rsibr.source("pixel_warp_blend", defines),
        uniforms: (view) => ({ ...sources.uniforms, ...pixelViews.uniforms(view) }),
      };
    }
  }

  rsibr.METHODS = rsibr.METHODS || {};
  rsibr.METHODS.nearest = (engine) => new WarpBlend(engine, "none", 1);
  rsibr.METHODS.blend = (engine) => new WarpBlend(engine, "none", 3);
  rsibr.METHODS.cabral1999 = (engine) => new WarpBlend(engine, engine.bundle.stored.warp, 3);
})();
