"use strict";
/* One WebGL2 context with what is drawn in it. A lost or released context takes its stage along; a new one is made. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

const LEAST_BACKGROUND_FOV = 45; // degrees: in the parallel projection all background would be one direction

rsibr.Stage = class {
  /**
   * @param canvas HTMLCanvasElement without a context
   * @param page description of the page, see rsibr/publishing/page/description.py
   * @param contents {{bundles: object[], mesh: object|null, references: object[]}}
   */
  constructor(canvas, page, contents) {
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: true, powerPreference: "high-performance" });
    if (!gl) throw new rsibr.Unsupported("This browser gives no WebGL2 context.");
    Object.assign(this, { canvas, gl, page });
    this.engines = contents.bundles.map((bundle) => new rsibr.Engine(gl, bundle));
    this.mesh = contents.mesh && new rsibr.Mesh(gl, page.object, contents.mesh);
    this.references = contents.references.map((reference) => rsibr.referenceTexture(gl, reference));
    this.colours = this.colourTexture();
    this.programs = new Map();
    this.pixelShaders = new Map();
    this.prepared = new Set();
    this.seen = new Set();
    this.nothing = gl.createVertexArray();
  }

  /** Methods that every bake serves. */
  get methods() {
    const [first, ...others] = this.engines;
    return first.methods.filter((name) => others.every((engine) => engine.methods.includes(name)));
  }

  get hasEnvironment() {
    return Boolean(this.engines[0].environment);
  }

  /** Whether a method can be drawn at once. */
  isReady(method) {
    return this.prepared.has(method) || !this.engines.some((engine) => engine.prepares(method));
  }

  /** Method that stands in for those that are not prepared: the last one that needs no preparation, or null. */
  get standIn() {
    return this.methods.filter((name) => this.isReady(name)).pop() ?? null;
  }

  /** Work of a method before its first frame; the page stays alive meanwhile. */
  async prepare(method, progress) {
    const { engines } = this;
    for (const [k, engine] of engines.entries()) {
      await engine.prepare(method, (share) => progress((k + share) / engines.length));
    }
    this.prepared.add(method);
  }

  /** Whether a choice is drawn for the first time, when the browser compiles its shaders. */
  isFirst({ method, against, lookup, size, show }) {
    const key = [method, against, lookup, size, show].join(), isFirst = !this.seen.has(key);
    this.seen.add(key);
    return isFirst;
  }

  /** Draw a frame: one method, or two with the wipe between them. */
  draw(camera, state) {
    const gl = this.gl, { width, height } = this.canvas, edge = Math.round(state.wipe * width);
    this.onto([0, 0, width, height]);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (state.background && state.show === "picture") this.background(camera, state);
    if (!state.against) return this.side(camera, state, state.method, [0, 0, width, height]);
    this.side(camera, state, state.method, [0, 0, edge, height]);
    this.side(camera, state, state.against, [edge, 0, width - edge, height]);
  }

  side(camera, state, method, rectangle) {
    if (rectangle[2] <= 0) return;
    if (state.show !== "picture") this.judged(camera, state, method, rectangle);
    else if (this.mesh) this.object(camera, state, method, rectangle);
    else this.sphere(camera, state, method, rectangle);
  }

  sphere(camera, state, method, rectangle) {
    const program = this.surface(rsibr.rayVertexGlsl, rsibr.sphereFragmentGlsl, this.engines[0], method, state.lookup);
    const lookup = this.lookup(this.engines[0], method, camera, state);
    this.onto(this.around(camera, rectangle));
    this.cast(program, camera, { ...lookup, ...this.tone(state) });
  }

  object(camera, state, method, rectangle) {
    const shared = this.meshUniforms(camera, state);
    this.engines.forEach((engine, bake) => {
      const program = this.surface(rsibr.meshVertexGlsl, rsibr.meshFragmentGlsl, engine, method, state.lookup);
      this.triangles(program, rectangle, bake, { ...this.lookup(engine, method, camera, state), ...shared });
    });
    if (!this.page.object.parts.some((part) => part.bake < 0)) return;
    this.triangles(this.program("unbaked", rsibr.meshVertexGlsl, rsibr.unbakedFragmentGlsl), rectangle, -1, shared);
  }

  triangles(program, rectangle, bake, { bind, ...uniforms }) {
    const gl = this.gl;
    this.onto(rectangle);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    bind?.(program);
    rsibr.gl.uniforms(gl, program, uniforms);
    this.mesh.draw(bake);
  }

  meshUniforms(camera, state) {
    const { width, height } = this.canvas, { lowest, extent } = this.page.object;
    const placed = { clip: camera.clip(width / height), eye: camera.eye, back: camera.view };
    return { ...placed, lowest, extent, parallel: camera.fov === 0 ? 1 : 0, ...this.tone(state) };
  }

  /** The reference of a view, or the error against it. */
  judged(camera, state, method, rectangle) {
    const gl = this.gl, reference = this.references[state.reference], { size, frame, floors } = reference;
    const map = this.engines[0].map(method, frame, size, { mips: false });
    this.onto(rectangle);
    this.unit(rsibr.mapUnit, map.texture);
    this.unit(rsibr.referenceUnit, reference.texture);
    this.cast(this.program("reference", rsibr.rayVertexGlsl, rsibr.referenceFragmentGlsl), camera, {
      frame,
      floors,
      errorRange: this.page.error.range,
      judge: state.show === "error" ? 1 : 0,
      map: { integer: rsibr.mapUnit },
      reference: { integer: rsibr.referenceUnit },
      ...this.tone(state),
    });
  }

  background(camera, state) {
    const gl = this.gl, environment = this.engines[0].environment, { width, height } = this.canvas;
    if (!environment) return;
    this.unit(rsibr.environmentUnit, environment.texture);
    const { right, up, back } = camera.axes, fov = Math.max(camera.fov, LEAST_BACKGROUND_FOV);
    const half = Math.tan((fov * Math.PI) / 360) / camera.zoom, aspect = width / height;
    const across = { right: right.map((x) => x * half * aspect), up: up.map((x) => x * half), forward: back.map((x) => -x) };
    const program = this.program("background", rsibr.rayVertexGlsl, rsibr.backgroundFragmentGlsl);
    gl.useProgram(program);
    const rays = { eye: [0, 0, 0], ...across, parallel: 0, environment: { integer: rsibr.environmentUnit } };
    rsibr.gl.uniforms(gl, program, { ...rays, ...this.tone(state) });
    gl.disable(gl.DEPTH_TEST);
    this.triangle();
  }

  /** Uniforms of the lookup; the map of the camera's central direction is made here. */
  lookup(engine, method, camera, state) {
    if (state.lookup === "pixel") {
      const shader = this.pixelShader(engine, method);
      shader.update(camera.view);
      return { bind: (program) => shader.bind(program, rsibr.engineUnit) };
    }
    const frame = engine.frame(camera.view);
    const map = engine.map(method, frame, state.size, { mips: true });
    this.unit(rsibr.mapUnit, map.texture);
    return { frame, map: { integer: rsibr.mapUnit } };
  }

  tone(state) {
    this.unit(rsibr.colourUnit, this.colours);
    return {
      exposure: this.page.exposure * 2 ** state.exposure,
      toneCurve: { integer: Object.keys(rsibr.toneCurves).indexOf(state.tone) },
      luminanceStops: [rsibr.luminanceStops.below, rsibr.luminanceStops.above],
      colours: { integer: rsibr.colourUnit },
    };
  }

  cast(program, camera, { bind, ...uniforms }) {
    const gl = this.gl;
    gl.useProgram(program);
    bind?.(program);
    rsibr.gl.uniforms(gl, program, { ...camera.rays(this.canvas.width / this.canvas.height), ...uniforms });
    gl.disable(gl.DEPTH_TEST);
    this.triangle();
  }

  triangle() {
    this.gl.bindVertexArray(this.nothing);
    this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
    this.gl.bindVertexArray(null);
  }

  /** Draw onto the canvas, inside a rectangle [x, y, width, height]; the engine leaves its own framebuffers bound. */
  onto(rectangle) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...rectangle);
    gl.disable(gl.CULL_FACE);
    gl.depthMask(true);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  /** Part of a rectangle that the unit sphere can cover. */
  around(camera, [x, y, width, height]) {
    const { width: w, height: h } = this.canvas, d = camera.distance;
    const outline = camera.fov === 0 ? 1 : d * Math.tan(Math.asin(Math.min(1 / d, 1)));
    const half = Math.ceil((outline / camera.halfHeight(w / h)) * (h / 2)) + 2;
    const [left, low] = [Math.max(x, Math.floor(w / 2) - half), Math.max(y, Math.floor(h / 2) - half)];
    const [right, high] = [Math.min(x + width, Math.ceil(w / 2) + half), Math.min(y + height, Math.ceil(h / 2) + half)];
    return [left, low, Math.max(right - left, 0), Math.max(high - low, 0)];
  }

  unit(number, texture) {
    this.gl.activeTexture(this.gl.TEXTURE0 + number);
    this.gl.bindTexture(this.gl.TEXTURE_2D, texture);
  }

  program(name, vertex, fragment) {
    if (!this.programs.has(name)) this.programs.set(name, rsibr.gl.program(this.gl, vertex, fragment()));
    return this.programs.get(name);
  }

  /** Program of a surface: one for all maps; for the view of each pixel one a bake and method. */
  surface(vertex, fragment, engine, method, lookup) {
    const kind = fragment === rsibr.sphereFragmentGlsl ? "sphere" : "mesh";
    const own = lookup === "pixel" ? ` ${this.engines.indexOf(engine)} ${method}` : "";
    const text = () => fragment(rsibr.lookupGlsl(lookup === "pixel" && this.pixelShader(engine, method), lookup));
    return this.program(`${kind} ${lookup}${own}`, vertex, text);
  }

  pixelShader(engine, method) {
    const key = `${this.engines.indexOf(engine)} ${method}`;
    if (!this.pixelShaders.has(key)) this.pixelShaders.set(key, engine.pixelShader(method));
    return this.pixelShaders.get(key);
  }

  colourTexture() {
    const rows = [this.page.colours.luminance, this.page.colours.error], count = rows[0].length;
    const bytes = rows.flat().flatMap((hex) => [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16)).concat(255));
    const gl = this.gl;
    return rsibr.gl.texture(gl, gl.LINEAR, count, 2, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(bytes));
  }

  /** Give the context back: a page may have 16. */
  release() {
    this.engines.forEach((engine) => engine.release());
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
};
