"use strict";
/* The viewer: its state, when it draws, and when it takes or gives back its WebGL context. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

/** Bytes on the GPU above which the page asks first: browsers do not say how much there is. */
rsibr.safeMemory = 2 ** 30;

const TURNTABLE = (12 * Math.PI) / 180; // a second
const RELEASE_AFTER = 2000; // ms out of sight
const ANEW_AFTER = 200; // ms after a context was lost
const TRIES = 3; // contexts that may be lost within a minute, before the page waits for the user

rsibr.Viewer = class {
  constructor(page, contents, elements) {
    Object.assign(this, { page, contents, elements });
    this.camera = new rsibr.OrbitCamera(page.camera);
    this.stage = null;
    this.listeners = []; // called at every change
    this.moved = []; // called at every frame, with a picture or not
    this.drawn = []; // called after every picture
    this.finished = 0; // when the GPU had finished the last frame
    this.losses = [];
    this.anew = 0; // timer of the next context
    this.isGivenUp = false; // contexts are asked for only when the user says so
    this.visible = true;
    this.state = {
      method: page.method,
      against: "",
      wipe: 0.5,
      lookup: "map-reflection",
      size: page.size,
      exposure: 0,
      tone: "linear",
      background: false,
      show: "picture",
      reference: 0,
      turntable: false,
    };
    this.methods = [];
  }

  /** Bytes on the GPU. */
  get memory() {
    const { bundles, mesh, references } = this.contents;
    const maps = bundles.reduce((sum, bundle) => sum + rsibr.memory(bundle, this.state.size), 0);
    const judged = references.reduce((sum, { size }) => sum + 16 * size * size, 0);
    return maps + judged + (mesh ? rsibr.Mesh.bytes(mesh) : 0);
  }

  /** Make a stage on a new canvas; throws rsibr.Unsupported. */
  open() {
    const old = this.elements.canvas, canvas = old.cloneNode(false), hasFocus = document.activeElement === old;
    canvas.addEventListener("webglcontextlost", (event) => {
      event.stopImmediatePropagation(); // unheard by the engine, so that the browser does not restore it beside the next
      if (this.stage?.canvas === canvas) this.lost();
    });
    const stage = new rsibr.Stage(canvas, this.page, this.contents); // may throw: the old canvas stays
    old.replaceWith(canvas);
    if (hasFocus) canvas.focus({ preventScroll: true });
    this.elements.canvas = canvas;
    this.stage = stage;
    this.methods = stage.methods;
    if (!this.methods.includes(this.state.method)) this.state.method = this.methods[this.methods.length - 1];
    rsibr.listenToGestures(canvas, this);
    this.resize();
    if (!this.isFramed) this.frameObject();
    this.changed();
  }

  /** Zoom to the object's bounding box. */
  frameObject() {
    this.isFramed = true;
    if (!this.page.object) return;
    const { lowest, extent } = this.page.object, { width, height } = this.elements.canvas;
    const corners = Array.from({ length: 8 }, (_, k) => lowest.map((x, axis) => x + ((k >> axis) & 1) * extent[axis]));
    this.camera.fit(corners, width / height);
  }

  /** A context that the browser took: make another, unless it keeps happening. */
  lost() {
    this.stage = null;
    const now = Date.now();
    this.losses = [...this.losses.filter((time) => now - time < 60000), now];
    if (this.losses.length > TRIES) return this.giveUp("The graphics context was lost again and again.");
    clearTimeout(this.anew);
    this.anew = setTimeout(() => {
      this.anew = 0;
      if (this.visible && !this.stage) this.reopen();
    }, ANEW_AFTER);
  }

  giveUp(reason) {
    this.isGivenUp = true;
    this.elements.say(reason, "Try again", () => this.reopen());
  }

  reopen() {
    try {
      this.open();
      this.isGivenUp = false;
      this.elements.say("");
    } catch (error) {
      if (!(error instanceof rsibr.Unsupported)) throw error;
      this.giveUp(error.message);
    }
  }

  /** Give the context back while the page is out of sight, and leave its picture in place. */
  release() {
    if (!this.stage) return;
    this.draw();
    this.elements.still.src = this.elements.canvas.toDataURL();
    this.elements.still.hidden = false;
    const { stage } = this;
    this.stage = null;
    stage.release();
  }

  watch() {
    const seen = new IntersectionObserver(([entry]) => {
      this.visible = entry.isIntersecting;
      clearTimeout(this.leaving);
      if (!this.visible) this.leaving = setTimeout(() => this.release(), RELEASE_AFTER);
      else if (!this.stage && !this.isGivenUp) this.reopen();
    });
    seen.observe(this.elements.frame);
    new ResizeObserver(() => this.resize()).observe(this.elements.frame);
  }

  resize() {
    const { canvas, frame } = this.elements, ratio = Math.min(globalThis.devicePixelRatio || 1, 2);
    const box = frame.getBoundingClientRect();
    const [width, height] = [box.width, box.height].map((x) => Math.max(1, Math.round(x * ratio)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    this.invalidate();
  }

  // ---- Changes ----

  set(changes) {
    Object.assign(this.state, changes);
    if (("show" in changes || "reference" in changes) && this.state.show !== "picture") this.toReference();
    this.changed();
  }

  /** Reference and error are pictures of one view in the parallel projection. */
  toReference() {
    const { frame } = this.page.references[this.state.reference];
    this.stopMotion();
    Object.assign(this.camera, { fov: 0, view: frame.slice(6) });
  }

  leaveReference() {
    if (this.state.show !== "picture") this.state.show = "picture";
  }

  orbit(azimuth, elevation) {
    this.leaveReference();
    this.camera.turn(azimuth, elevation);
    this.changed();
  }

  zoom(factor) {
    this.camera.magnify(factor);
    this.changed();
  }

  setFov(degrees) {
    this.leaveReference();
    this.camera.fov = degrees;
    this.changed();
  }

  home() {
    this.leaveReference();
    this.stopMotion();
    this.camera.reset();
    this.frameObject();
    this.changed();
  }

  /** Go to a view: at once where motion is not wanted. */
  goTo(view) {
    this.leaveReference();
    this.stopMotion();
    const start = { azimuth: this.camera.azimuth, elevation: this.camera.elevation };
    this.camera.view = view;
    const end = { azimuth: this.camera.azimuth, elevation: this.camera.elevation };
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) return this.changed();
    const turns = Math.round((end.azimuth - start.azimuth) / (2 * Math.PI));
    start.azimuth += 2 * Math.PI * turns; // the short way round
    const begun = performance.now();
    this.motion = (now) => {
      const t = Math.min((now - begun) / 350, 1), eased = t * t * (3 - 2 * t);
      for (const angle of ["azimuth", "elevation"]) this.camera[angle] = start[angle] + eased * (end[angle] - start[angle]);
      if (t === 1) this.motion = null;
    };
    this.changed();
  }

  toggleTurntable() {
    if (this.state.turntable) return this.set({ turntable: false });
    this.leaveReference();
    this.stopMotion();
    let last = performance.now();
    this.motion = (now) => {
      this.camera.turn((TURNTABLE * Math.min(now - last, 100)) / 1000, 0);
      last = now;
      if (!this.state.turntable) this.motion = null;
    };
    this.set({ turntable: true });
  }

  stopMotion() {
    this.motion = null;
    this.state.turntable = false;
  }

  /** Tell the controls, and draw. */
  changed() {
    this.listeners.forEach((listener) => listener());
    this.invalidate();
  }

  // ---- Frames ----

  /** Draw at the next frame of the browser, and as long as something moves. */
  invalidate() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame((now) => {
      this.waiting = false;
      this.motion?.(now);
      this.moved.forEach((act) => act());
      if (this.isAlive && this.visible) {
        this.timedDraw();
        if (!this.isReady()) this.prepare();
      }
      if (this.motion) this.changed();
    });
  }

  /** Draw the state, and say whether that was possible; until a method is prepared another stands in for it. */
  draw() {
    if (!this.isAlive) return false;
    const [method, against = ""] = this.shownMethods.map((name) => this.standIn(name));
    if (method === null || against === null) return false;
    const shown = { ...this.state, method, against };
    this.isFirst = this.stage.isFirst(shown);
    this.stage.draw(this.camera, shown);
    this.elements.still.hidden = true;
    return true;
  }

  /** What is drawn of a method; null where only waiting helps. Errors are never those of another method. */
  standIn(method) {
    if (this.stage.isReady(method)) return method;
    return this.state.show === "picture" ? this.stage.standIn : null;
  }

  /** Whether there is a context that works; one may be lost a moment before the browser tells. */
  get isAlive() {
    return Boolean(this.stage) && !this.stage.gl.isContextLost();
  }

  get shownMethods() {
    return [this.state.method, this.state.against].filter(Boolean);
  }

  isReady() {
    return this.shownMethods.every((method) => this.stage.isReady(method));
  }

  /** Prepare what is to be shown. */
  async prepare() {
    if (this.preparing) return;
    const { stage } = this, meanwhile = stage.standIn && this.state.show === "picture" ? `; ${stage.standIn} is shown until then` : "";
    this.preparing = true;
    try {
      for (const method of this.shownMethods.filter((name) => !stage.isReady(name))) {
        await stage.prepare(method, (share) => this.elements.say(`Preparing ${method}: ${Math.round(100 * share)} %${meanwhile}`));
      }
      if (this.stage === stage) this.elements.say("");
    } finally {
      this.preparing = false;
    }
    this.changed();
  }

  /** Resolves when the state is on the canvas; rejects where it cannot come there by itself. */
  async settled() {
    const isDone = () => this.isAlive && this.isReady() && !this.waiting && !this.motion;
    do {
      await new Promise((next) => requestAnimationFrame(next));
      if (!this.visible) throw new Error("the picture is out of sight");
      if (!this.stage && !this.anew) throw new Error("the picture has no graphics context");
    } while (!isDone());
  }

  /** Draw and show the time until the GPU has finished, from when it had finished the frame before. */
  timedDraw() {
    const { gl } = this.stage, begun = performance.now();
    if (!this.draw()) return;
    const { isFirst } = this;
    this.drawn.forEach((act) => act());
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    const poll = () => {
      if (gl.isContextLost()) return;
      const status = gl.clientWaitSync(fence, 0, 0);
      if (status === gl.TIMEOUT_EXPIRED) return void setTimeout(poll, 1);
      gl.deleteSync(fence);
      const now = performance.now();
      this.elements.time(now - Math.max(begun, this.finished), isFirst);
      this.finished = now;
    };
    setTimeout(poll, 0);
  }

  /** Error of the methods shown against the reference in use: [{method, relMse}]. */
  errors() {
    const reference = this.contents.references[this.state.reference];
    return this.shownMethods.map((method) => {
      const map = this.stage.engines[0].map(method, reference.frame, reference.size, { mips: false });
      return { method, ...rsibr.errorAgainst(reference, this.stage.engines[0].read(map)) };
    });
  }
};
