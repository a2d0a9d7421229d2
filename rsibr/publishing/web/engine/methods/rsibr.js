"use strict";
// `rsibr`: prediction of all lobes from the environment, plus residuals of the stored maps; docs/method.md.
(() => {
  const ROWS = ["albedo", "trust", "weight", "wide", "mirror", "sharp"];

  const WORLD = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  const FEW = 42, NEAR = 0.5;  // views whose residuals are all made, and the cosine up to which those of more are

  /** Sum over tables of the same nodes. */
  function summed(tables, count) {
    const one = tables.length / count, total = new Float32Array(one);
    tables.forEach((value, i) => { total[i % one] += value; });
    return total;
  }

  class Rsibr {
    constructor(engine) {
      const { gpu, bundle } = engine, { model, arrays } = bundle;
      Object.assign(this, { engine, gpu, model, array: (name) => arrays[`model.${name}`] });
      this.sized = new Map();
      const { widths, sides, blurs } = bundle.light, ladder = Object.entries({ widths, sides, blurs });
      const used = Object.fromEntries(ladder.map(([name, list]) => [name, list.slice(0, model.lightLevels)]));
      this.light = model.lightLevels ? new rsibr.LightPyramid(gpu, engine.light, used, arrays["light.taps"].data) : null;
      const needsPyramid = model.hasLevels || this.array("points");
      this.pyramid = needsPyramid ? new rsibr.HalfVectorPyramid(gpu, model.side, model.ladder) : null;
      this.wide = this.array("points") ? new rsibr.WideLight(gpu, this.array("points")) : null;
      if (model.carries) this._makeRoomForResiduals();
      this.irradiance = this._irradiance();
      this.mirror = this._mirror();
      this.delta = this._delta();
    }

    /** Work before the first map, in steps, so that a page stays alive between them. */
    *preparing() {
      if (!this.light) return;
      while (!this.light.isWhole) {
        this.light.step();
        yield this.light.made / this.light.count;
      }
    }

    draw(frame, target) {
      for (const _ of this.preparing());
      const size = target.width, { model } = this;
      const carrying = model.carries ? this._carrying(frame) : {};  // before, for residuals are made with the same pyramid
      const values = { ...this._predicting(frame, size), ...carrying, size };
      this.gpu.draw(this.gpu.program("rsibr_map", this._defines(size)), target, values);
    }

    /** Shader of a pixel, and its uniforms around a middle view; see `Engine.pixelShader`. Tables are those of the
     *  largest maps, whose texels are nearest to points. */
    pixel() {
      const { engine, model } = this, size = Math.max(...engine.sizes), { pixelViews } = engine;
      const defines = { ...this._defines(size), ...(model.carries ? pixelViews.defines : {}) };
      return {
        glsl: rsibr.source("pixel_rsibr", { ...defines, LEVEL_SUM_ROW: this._tables(size).sumRow }),
        uniforms: (view) => {
          for (const _ of this.preparing());
          const frame = engine.frame(view), carrying = model.carries ? this._carryingAll(view) : {};
          return { ...this._predicting(frame, size), ...(this.delta ? this.delta.uniforms(WORLD) : {}), ...carrying };
        },
      };
    }

    /** Uniforms of the residuals for pixels whose views lie around a middle one. */
    _carryingAll(view) {
      const { sphere, sources, pixelViews } = this.engine;
      for (let k = 0; k < sphere.count; k++) {
        const isNear = rsibr.vector.dot(sphere.direction(k), view) > NEAR;
        if ((isNear || sphere.count <= FEW) && !this.known.has(k)) this._makeResidual(k);
      }
      sphere.surrounding(view).forEach((k) => this.known.has(k) || this._makeResidual(k));
      return { ...sources.uniforms, ...pixelViews.uniforms(view), residuals: this.residuals };
    }

    /** Uniforms of the residuals around a view; those of a stored view are made when it is first met. */
    _carrying(frame) {
      const { sphere, sources } = this.engine, v = rsibr.vector.column(frame, 2), indices = sphere.surrounding(v);
      const gnomonic = sphere.gnomonicWeights(v, indices), areas = sphere.areaWeights(v, indices);
      indices.forEach((index, k) => {
        if (gnomonic[k] > 0 && !this.known.has(index)) this._makeResidual(index);
      });
      const warps = rsibr.warpUniforms(sphere, indices, areas, frame);
      return { ...sources.uniforms, ...warps, residuals: this.residuals, gnomonic };
    }

    /** Prediction for the view of a frame: the pyramid is filled, and the uniforms are returned that read it. */
    _predicting(frame, size) {
      const tables = this._tables(size);
      const values = { tables: tables.texture, frame, ...(this.light ? this.light.uniforms : {}) };
      if (this.pyramid) {
        if (this.model.hasLevels) this.pyramid.balance(tables, size);
        this.pyramid.fill(frame, this.light);
        if (this.model.hasLevels) {
          Object.assign(values, { collapsed: this.pyramid.collapsed(tables, size), collapsedHalf: this.pyramid.side / 2 });
        }
        if (this.wide) {
          this.wide.fill(this.pyramid);
          values.wideLight = this.wide.grid;
        }
      }
      if (this.irradiance) Object.assign(values, { irradiance: this.irradiance.texture, irradianceSide: this.irradiance.side });
      if (this.mirror) Object.assign(values, this.mirror);
      if (this.delta) Object.assign(values, this.delta.uniforms(frame));
      return values;
    }

    _defines(size) {
      const { model, mirror, delta } = this, flag = (value) => (value ? 1 : 0);
      return {
        WARP: this.engine.bundle.stored ? this.engine.bundle.stored.warp.toUpperCase() : "NONE",
        NARROW: flag(model.hasLevels), WIDE: flag(this.wide), MATTE: model.matte, SHARP: flag(this._tables(size).isSharp),
        MIRROR_LOBE: flag(mirror), ...(mirror && mirror.mirrorImage ? { MIRROR_IMAGE: 1 } : {}),
        DELTA_LIGHTS: delta ? delta.count : 0, DELTA_LOBES: delta ? delta.lobes : 0,
        ...(this.light ? { LIGHT_LEVELS: this.light.count } : {}),
        ...(this.pyramid ? this.pyramid.defines : {}),
        RESIDUALS: flag(model.carries), BELIEVES: flag(model.believes), HEDGED: flag(model.isHedged),
        KEEPS_NEGATIVES: flag(model.keepsNegatives), CARRIES_MIRROR: flag(model.carriesMirror),
        ...Object.fromEntries(ROWS.map((name, row) => [`${name.toUpperCase()}_ROW`, row])), MATTE_ROW: ROWS.length,
      };
    }

    /** Tables by cosine for maps of a size, as rows of one texture. */
    _tables(size) {
      if (!this.sized.has(size)) {
        const rows = ROWS.map((name) => this.array(name === "sharp" ? `sharp.${size}` : name));
        for (let k = 0; k < this.model.matte; k++) rows.push(this.array(`matte.${k}`));
        const levelRow = rows.length, levels = this.array(`levels.${size}`), { NODES, ALBEDO_NODES } = rsibr.constants;
        for (let k = 0; levels && k < levels.shape[0]; k++) {
          rows.push({ data: levels.data.subarray(4 * NODES * k, 4 * NODES * (k + 1)) });
        }
        const sumRow = rows.length;
        if (levels) rows.push({ data: summed(levels.data, levels.shape[0]) });
        const four = new Float32Array(4 * ALBEDO_NODES * rows.length);
        rows.forEach((row, k) => row && four.set(row.data, 4 * ALBEDO_NODES * k));
        const texture = this.gpu.texture(ALBEDO_NODES, rows.length, "RGBA32F");
        this.gpu.upload(texture, four);
        this.sized.set(size, { texture, levelRow, sumRow, isSharp: Boolean(this.array(`sharp.${size}`)) });
      }
      return this.sized.get(size);
    }

    /** Residuals of a stored view, made at its own texels when it is first met. */
    _makeResidual(view) {
      const { gpu, engine, carried } = this, { bundle, sphere } = engine, size = bundle.stored.resolution;
      const values = this._predicting(sphere.frame(view), size), largest = bundle.precision === "half" ? 65504 : 3e38;
      gpu.draw(gpu.program("residual_map", this._defines(size)), this.raw,
        { ...values, maps: carried.texture, mapScale: carried.scale, view, size });
      const filling = { map: this.raw, filling: this.filling, largest };
      gpu.draw(gpu.program("fill_stored"), this.residuals, filling, { layer: view });
      this.known.add(view);
    }

    _makeRoomForResiduals() {
      const { gpu, engine } = this, { bundle } = engine, { resolution, views } = bundle.stored;
      const side = resolution + 2, texels = side * side;
      this.carried = bundle.arrays["stored.mirrored"] ? new rsibr.SourceMaps(gpu, bundle, true) : engine.sources;
      this.residuals = gpu.texture(side, side, bundle.precision === "half" ? "RGBA16F" : "RGBA32F", { layers: views });
      this.known = new Set();
      this.raw = gpu.texture(resolution, resolution, "RGBA32F");
      this.filling = gpu.texture(side, side, "RG16I");
      const { data } = bundle.arrays["stored.filling"], two = new Int16Array(2 * texels);
      for (let i = 0; i < texels; i++) [two[2 * i], two[2 * i + 1]] = [data[texels + i], data[i]];
      gpu.upload(this.filling, two);
    }

    /** Irradiance maps of the matte parts, one above the other. */
    _irradiance() {
      const maps = Array.from({ length: this.model.matte }, (_, k) => this.array(`irradiance.${k}`));
      if (!maps.length) return null;
      const images = maps.map((one) => rsibr.LightImage.bordered(one)), { side, stride } = images[0];
      const four = new Float32Array(4 * stride * stride * images.length);
      images.forEach((one, k) => four.set(one.four, 4 * stride * stride * k));
      const texture = this.gpu.texture(stride, stride * images.length, "RGBA32F");
      this.gpu.upload(texture, four);
      return { texture, side };
    }

    /** What a delta lobe mirrors: the environment's own image, or the finest level of the pyramid. */
    _mirror() {
      if (!this.array("mirror")) return null;
      const { fineness, toImage } = this.model.mirror, image = this.array("mirrorImage");
      if (!image) return { fineness };
      const [height, width] = image.shape.slice(-2), plane = width * height;
      const numbers = image.type === "half" ? image.data : rsibr.numbers(image);
      const four = new numbers.constructor(4 * (width + 1) * (height + 1));
      for (let row = 0; row <= height; row++) {
        for (let column = 0; column <= width; column++) {
          const from = Math.min(row, height - 1) * width + (column % width), at = 4 * (row * (width + 1) + column);
          for (let k = 0; k < 3; k++) four[at + k] = numbers[k * plane + from];
        }
      }
      const texture = this.gpu.texture(width + 1, height + 1, image.type === "half" ? "RGBA16F" : "RGBA32F");
      this.gpu.upload(texture, four);
      const mirrorScale = image.type === "half" ? image.scale : 1;
      return { fineness, mirrorImage: texture, mirrorSize: [width, height], mirrorScale, toImage };
    }

    /** Delta lights, and the proxies that reflect them. */
    _delta() {
      const lights = this.array("lights");
      if (!lights) return null;
      const [proxies, ratio] = ["proxies", "ratio"].map((name) => this.array(name));
      const [terms, ratios] = [proxies, ratio].map(({ shape, data }) => {
        const texture = this.gpu.texture(shape[1], shape[0], "RGBA32F");
        this.gpu.upload(texture, data);
        return texture;
      });
      const { directions, irradiance } = rsibr.deltaLights(lights);
      return {
        count: directions.length, lobes: proxies.shape[0],
        uniforms: (frame) => ({
          proxies: terms, proxyRatio: ratios, narrowest: this.model.narrowest, lightIrradiance: irradiance.flat(),
          lightDirections: directions.flatMap((d) => rsibr.vector.into(frame, d)),
        }),
      };
    }
  }

  rsibr.METHODS = rsibr.METHODS || {};
  rsibr.METHODS.rsibr = Object.assign((engine) => new Rsibr(engine), { prepares: true });
})();
