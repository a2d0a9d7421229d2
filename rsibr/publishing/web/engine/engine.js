"use strict";
// The engine: sphere maps of any view from a bundle, on the graphics card.
rsibr.Engine = class Engine {
  /** `gl`: WebGL2 context of a canvas; `bundle`: from `rsibr.decodeBundle`. */
  constructor(gl, bundle) {
    this.gpu = new rsibr.Gpu(gl);
    this.gl = gl;
    this.bundle = bundle;
    this.methods = bundle.methods.filter((name) => name in rsibr.METHODS);
    const { arrays } = bundle;
    rsibr.requireRoom(gl, bundle);
    if (bundle.stored) {
      const { "stored.directions": directions, "stored.triangles": triangles, "stored.frames": frames } = arrays;
      this.sphere = new rsibr.ViewSphere(directions.data, triangles.data, frames.data);
    }
    this._forget();
    this._lost = (event) => event.preventDefault();
    this._restored = () => {
      this.gpu.reset();
      this._forget();
    };
    gl.canvas.addEventListener("webglcontextlost", this._lost);
    gl.canvas.addEventListener("webglcontextrestored", this._restored);
  }

  /** Unit vectors of the stored views, and the triangles between them. */
  get views() {
    return this.sphere ? this.sphere.directions : new Float32Array(0);
  }

  get triangles() {
    return this.sphere ? this.sphere.triangles : new Uint32Array(0);
  }

  /** Texels a side that maps may have. */
  get sizes() {
    return this.bundle.sizes;
  }

  /** The library's frame of a view: columns x, y, v. */
  frame(view, up) {
    return rsibr.frame(view, up);
  }

  /** Stored views around a view, and their weights as `cabral1999` has them. */
  triangle(view) {
    const v = rsibr.vector.unit(view), views = this.sphere.surrounding(v);
    return { views, weights: this.sphere.areaWeights(v, views) };
  }

  /** Whether a method has much to do before its first map. */
  prepares(method) {
    return Boolean(rsibr.METHODS[method].prepares);
  }

  /** Work of a method before its first map, in steps between which the page stays alive; `progress` is told the share
   *  that is done. Without it the first map takes that time. */
  async prepare(method, progress = () => {}) {
    const made = this.method(method);
    if (!made.preparing) return;
    for (const share of made.preparing()) {
      progress(share);
      this.gl.flush();
      await new Promise((done) => setTimeout(done));
      if (this.gl.isContextLost()) return;
    }
  }

  /** Sphere map of the view of a frame: {texture, target, size, levels}. Row 0 is the top of the library's map; beyond
   *  the disk the rim goes on. It is drawn into the same texture each time, one for a method, a size, and `mips`. Null while the
   *  context is lost. */
  map(method, frame, size, { mips = true } = {}) {
    if (this.gl.isContextLost()) return null;
    const { gpu } = this, made = this.method(method);
    if (!this.sizes.includes(size)) throw new RangeError(`maps of ${size} texels: there are ${this.sizes}`);
    const levels = mips ? Math.floor(Math.log2(size)) + 1 : 1;
    const raw = this._kept(`raw ${size}`, () => gpu.texture(size, size, "RGBA32F"));
    const map = this._kept(`map ${method} ${size} ${levels}`, () =>
      gpu.texture(size, size, this.mapFormat, { levels, linear: this.mapFormat === "RGBA16F" || gpu.filtersFloat }));
    made.draw(Float32Array.from(frame), raw);
    const largest = this.mapFormat === "RGBA16F" ? 65504 : 3e38;
    gpu.draw(gpu.program("fill_map"), map, { map: raw, size, largest });
    if (levels > 1) gpu.makeLevels(map);
    gpu.done();
    return { texture: map.texture, target: map.target, size, levels, own: map };
  }

  /** Shading of pixels that each have a view of their own (perspective): {glsl, update(view), bind(program, unit)}.
   *
   *  `glsl` defines `vec3 radiance(vec3 n, vec3 v)`, unit vectors in world coordinates; it stands after `#version 300 es`
   *  and before the page's own text, whose names should begin with `page`. Call `update` with the view of the middle of
   *  the picture once a frame, and `bind` while the program is in use: it takes the texture units from `unit` on and
   *  returns the next free one. Shaders of a lost context have to be made anew. */
  pixelShader(method) {
    const { glsl, uniforms } = this.method(method).pixel();
    let values = null;
    return {
      glsl,
      update: (view) => {
        values = uniforms(rsibr.vector.unit(view));
        this.gpu.done();
      },
      bind: (program, unit = 0) => this.gpu.set(this.gpu.described(program), values, unit),
    };
  }

  /** Stored views as textures, shared by the shaders of pixels. */
  get pixelViews() {
    return this._kept("pixel views", () => new rsibr.PixelViews(this.gpu, this.sphere));
  }

  /** Red, green and blue of a map's texels, row by row from the top. */
  read(map) {
    return this.gpu.read(map.own);
  }

  get mapFormat() {
    return this.bundle.precision === "half" ? "RGBA16F" : "RGBA32F";
  }

  method(name) {
    if (!this.methods.includes(name)) throw new RangeError(`no method '${name}': there are ${this.methods}`);
    return this._kept(`method ${name}`, () => rsibr.METHODS[name](this));
  }

  /** Stored maps on the graphics card, shared by the methods. */
  get sources() {
    return this._kept("sources", () => new rsibr.SourceMaps(this.gpu, this.bundle));
  }

  /** The environment for a background: {texture, target, width, height}, latitude–longitude in Mitsuba's convention;
   *  null where the bundle holds none. The first and the last row lie on the poles, columns are centred. */
  get environment() {
    if (!this.bundle.arrays["light.picture"]) return null;
    return this._kept("environment", () => {
      const { gpu, gl } = this, { light } = this, width = Math.min(4 * light.side, 1024), height = width / 2;
      const made = gpu.texture(width, height, "RGBA16F", { linear: true });
      gl.bindTexture(made.target, made.texture);
      gl.texParameteri(made.target, gl.TEXTURE_WRAP_S, gl.REPEAT);
      const values = { light: light.texture, side: light.side, size: [width, height], largest: 65504 };
      gpu.draw(gpu.program("background"), made, values);
      gpu.done();
      return made;
    });
  }

  /** Octahedral image of the environment, shared by the methods. */
  get light() {
    return this._kept("light", () => new rsibr.LightImage(this.gpu, this.bundle.arrays["light.picture"]));
  }

  /** Give all of the graphics card's memory back. */
  release() {
    this.gl.canvas.removeEventListener("webglcontextlost", this._lost);
    this.gl.canvas.removeEventListener("webglcontextrestored", this._restored);
    this.gpu.release();
    this._forget();
  }

  _forget() {
    this._made = new Map();
  }

  _kept(name, make) {
    if (!this._made.has(name)) this._made.set(name, make());
    return this._made.get(name);
  }
};
