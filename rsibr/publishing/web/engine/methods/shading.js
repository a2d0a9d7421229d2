"use strict";
// `miller1984`, `kautz2003` and `split-sum`: systems that shade by lookups in tables of the light, without stored maps.
(() => {
  class Shading {
    constructor(engine, part) {
      const { bundle, gpu } = engine;
      Object.assign(this, { gpu, part, meta: bundle[part] });
      this.array = (name) => bundle.arrays[`${part}.${name}`];
      this.defines = { POINTS: this.meta.points };
      this.values = {};
    }

    draw(frame, target) {
      const program = this.gpu.program(`${this.part.replace("-", "_")}_map`, this.defines);
      this.gpu.draw(program, target, { ...this.values, frame, size: target.width });
    }

    /** Shader of a pixel, and its uniforms; see `Engine.pixelShader`. */
    pixel() {
      return { glsl: rsibr.source(`pixel_${this.part.replace("-", "_")}`, this.defines), uniforms: () => this.values };
    }

    /** Tables by the cosine, a row each. */
    addTables(rows, nodes) {
      const four = new Float32Array(4 * nodes * rows.length);
      rows.forEach((row, k) => four.set(row.data, 4 * nodes * k));
      this.values.tables = this.gpu.texture(nodes, rows.length, "RGBA32F");
      this.gpu.upload(this.values.tables, four);
    }

    /** An image with its border: {texture, size, scale}; half numbers stay as they are. */
    image({ data, shape, type, scale }) {
      const [height, width] = shape.slice(-2), plane = width * height, four = new data.constructor(4 * plane);
      for (let i = 0; i < plane; i++) for (let k = 0; k < 3; k++) four[4 * i + k] = data[k * plane + i];
      const texture = this.gpu.texture(width, height, type === "half" ? "RGBA16F" : "RGBA32F");
      this.gpu.upload(texture, four);
      return { texture, size: [width - 2, height - 2], scale };
    }

    /** Cubes side by side in one texture; one that is left out stands for the one before it. */
    addCubes(count) {
      const images = Array.from({ length: count }, (_, k) => this.array(`cube.${k}`)), known = images.filter(Boolean);
      const strides = known.map(({ shape }) => shape[3]), width = strides.reduce((a, b) => a + b, 0);
      const height = 6 * Math.max(...strides), four = new Float32Array(4 * width * height), starts = new Map();
      let start = 0;
      for (const one of known) {
        const stride = one.shape[3], plane = stride * stride, numbers = rsibr.numbers(one);
        for (let face = 0; face < 6; face++) {
          for (let i = 0; i < plane; i++) {
            const at = 4 * ((face * stride + Math.floor(i / stride)) * width + start + (i % stride));
            for (let k = 0; k < 3; k++) four[at + k] = numbers[(3 * face + k) * plane + i];
          }
        }
        starts.set(one, [start, stride - 2]);
        start += stride;
      }
      this.values.cubeTexels = this.gpu.texture(width, height, "RGBA32F");
      this.gpu.upload(this.values.cubeTexels, four);
      this.values.cubes = images.flatMap((one, k) => starts.get(one || images[k - 1]));
      this.values.shares = this.meta.shares;
      this.defines.CUBES = count;
    }
  }

  class Miller1984 extends Shading {
    constructor(engine) {
      super(engine, "miller1984");
      this.addTables([this.array("wD"), this.array("wS")], rsibr.constants.NODES);
      this.defines.IS_NEAREST = this.meta.isNearest ? 1 : 0;
      for (const name of ["diffuse", "specular"]) {
        const map = this.array(name) && this.image(this.array(name));
        this.defines[`HAS_${name.toUpperCase()}`] = map ? 1 : 0;
        if (map) Object.assign(this.values, { [`${name}Map`]: map.texture, [`${name}Size`]: map.size, [`${name}Scale`]: map.scale });
      }
    }
  }

  class Kautz2003 extends Shading {
    constructor(engine) {
      super(engine, "kautz2003");
      const { fLambda, kD, kS, harmonics } = this.meta;
      this.addCubes(2);
      Object.assign(this.values, { fLambda, kD, kS, harmonics });
    }
  }

  class SplitSum extends Shading {
    constructor(engine) {
      super(engine, "split-sum");
      const { glossy, harmonics, lobes } = this.meta, albedos = Array.from({ length: glossy }, (_, k) => this.array(`albedo.${k}`));
      this.addTables([this.array("diffuse"), ...albedos], rsibr.constants.ALBEDO_NODES);
      if (glossy) this.addCubes(2 * glossy);
      const lights = this.array("lights"), count = lights ? lights.shape[0] : 0;
      Object.assign(this.defines, { GLOSSY: glossy, DELTA_LIGHTS: count, DELTA_LOBES: count ? lobes.length : 0 });
      this.values.harmonics = harmonics;
      if (!count) return;
      const three = (row) => Array.from({ length: count }, (_, k) => Array.from(lights.data.subarray(6 * k + 3 * row, 6 * k + 3 * row + 3))).flat();
      Object.assign(this.values, { lightDirections: three(0), lightIrradiance: three(1), lobes: lobes.flat() });
    }
  }

  rsibr.METHODS = rsibr.METHODS || {};
  rsibr.METHODS.miller1984 = (engine) => new Miller1984(engine);
  rsibr.METHODS.kautz2003 = (engine) => new Kautz2003(engine);
  rsibr.METHODS["split-sum"] = (engine) => new SplitSum(engine);
})();
