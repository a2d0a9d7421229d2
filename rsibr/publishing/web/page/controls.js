"use strict";
/* The panel: every control shows the state of the viewer, and changes it. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

const degrees = (radians) => Math.round((radians * 180) / Math.PI);
const signed = (value, digits) => (value < 0 ? "−" : "+") + Math.abs(value).toFixed(digits);

rsibr.Controls = class {
  constructor(root, viewer) {
    this.viewer = viewer;
    this.at = (id) => root.getElementById(id);
    this.wipe = new rsibr.Wipe(this.at("wipe"), this.at("frame"), viewer);
    this.bindValues();
    this.bindButtons();
    this.fillKeys();
    viewer.listeners.push(() => this.show());
    viewer.drawn.push(() => this.errors());
    viewer.moved.push(() => this.storedViews());
  }

  /** Lists that depend on what the engine serves; called once the stage is there. */
  fill() {
    const { page, methods, stage } = this.viewer;
    this.options("method", methods.map((name) => [name, name]));
    this.options("against", [["", "nothing"], ...methods.map((name) => [name, name])]);
    this.options("lookup", Object.entries(rsibr.lookups));
    this.options("tone", Object.entries(rsibr.toneCurves));
    this.options("size", page.sizes.map((size) => [size, `${size}²`]));
    this.options("show", [["picture", "Picture"], ["error", "Relative error"], ["reference", "Reference"]]);
    this.options("reference", page.references.map((one, k) => [k, `${k + 1}${one.label && `, ${one.label}`}`]));
    const { views } = stage.engines[0], stored = Array.from({ length: views.length / 3 }, (_, k) => [k, `${k}: ${rsibr.direction(views.subarray(3 * k, 3 * k + 3))}`]);
    this.options("stored", [["", "–"], ...stored]);
    this.at("references").hidden = !page.references.length;
    this.at("stored-views").hidden = stored.length < 2;
    this.at("background").closest("label").hidden = !stage.hasEnvironment;
    if (stored.length < 2) return;
    this.sphere = new rsibr.ViewsSphere(this.at("views"), stage.engines[0].sphere, (view) => this.viewer.goTo(view));
  }

  options(id, entries) {
    this.at(id).replaceChildren(...entries.map(([value, text]) => new Option(text, value)));
  }

  bindValues() {
    const { viewer } = this, on = (id, event, act) => this.at(id).addEventListener(event, (e) => act(e.target));
    for (const id of ["method", "against", "lookup", "tone", "show"]) on(id, "change", (one) => viewer.set({ [id]: one.value }));
    on("size", "change", (one) => viewer.set({ size: Number(one.value) }));
    on("reference", "change", (one) => {
      const show = viewer.state.show === "picture" ? "error" : viewer.state.show;
      viewer.set({ reference: Number(one.value), show });
    });
    on("exposure", "input", (one) => viewer.set({ exposure: Number(one.value) }));
    on("background", "change", (one) => viewer.set({ background: one.checked }));
    on("fov", "input", (one) => viewer.setFov(Number(one.value)));
    on("stored", "change", (one) => {
      if (one.value !== "") viewer.goTo(this.sphere.views[Number(one.value)]);
    });
  }

  bindButtons() {
    const { viewer } = this, actions = {
      "zoom-in": () => viewer.zoom(1.25),
      "zoom-out": () => viewer.zoom(1 / 1.25),
      home: () => viewer.home(),
      turntable: () => viewer.toggleTurntable(),
    };
    for (const [id, action] of Object.entries(actions)) this.at(id).addEventListener("click", action);
  }

  fillKeys() {
    const rows = Object.entries(rsibr.keys).flatMap(([keys, what]) => ["dt", "dd"].map((tag, k) => {
      const cell = document.createElement(tag);
      cell.textContent = [keys, what][k];
      return cell;
    }));
    this.at("keys").replaceChildren(...rows);
  }

  show() {
    const { state, camera, page } = this.viewer;
    for (const id of ["method", "against", "lookup", "tone", "show", "size", "reference", "exposure"]) this.at(id).value = state[id];
    this.at("background").checked = state.background;
    this.at("fov").value = camera.fov;
    this.at("fov-value").textContent = camera.fov === 0 ? "parallel" : `${Math.round(camera.fov)}°`;
    this.at("exposure-value").textContent = `${signed(state.exposure, 1)} stops`;
    this.at("turntable").setAttribute("aria-pressed", String(state.turntable));
    this.at("view").textContent = `View ${rsibr.direction(camera.view)}`;
    this.at("size").disabled = state.lookup === "pixel" || state.show !== "picture";
    this.at("lookup").disabled = state.show !== "picture";
    this.wipe.show();
    this.scale();
    if (!page.object) return;
    this.at("show").disabled = this.at("reference").disabled = true;
  }

  /** Colour bar: of the luminance, or of the error. */
  scale() {
    const { state, page } = this.viewer, scale = this.at("scale");
    const isError = state.show === "error", isLuminance = !isError && state.tone === "luminance";
    scale.hidden = !isError && !isLuminance;
    if (scale.hidden) return;
    const colours = isError ? page.colours.error : page.colours.luminance;
    const ticks = isError ? page.error.ticks : rsibr.luminanceTicks(page.exposure * 2 ** state.exposure);
    const quantity = isError ? "relative error of a texel" : "luminance, W sr⁻¹ m⁻²";
    this.at("scale-label").textContent = quantity;
    scale.setAttribute("aria-label", `Colour scale, ${quantity}: ${ticks.map(([, text]) => text).join(", ")}`);
    this.at("ramp").style.background = `linear-gradient(to right, ${colours.join(", ")})`;
    this.at("ticks").replaceChildren(...ticks.map(([place, text]) => {
      const tick = document.createElement("span");
      Object.assign(tick, { className: "tick", textContent: text });
      tick.style.left = `${100 * place}%`;
      return tick;
    }));
  }

  /** Figures of the errors, computed from the page's own maps; once for each pair of methods and reference. */
  errors() {
    const { state, page, contents } = this.viewer, told = this.at("errors");
    const key = [state.show, state.reference, state.method, state.against].join();
    if (this.toldErrors === key) return;
    this.toldErrors = key;
    told.textContent = "";
    if (state.show !== "error") return;
    const found = this.viewer.errors().map(({ method, relMse }) => `${method} relMSE ${rsibr.formatted(relMse)}`);
    told.textContent = `${found.join("; ")}. The noise of the reference makes ${rsibr.formatted(contents.references[state.reference].noise)} of each.`;
  }

  /** The sphere of views at the camera; it needs no graphics context, so that it goes on without one. */
  storedViews() {
    if (!this.sphere) return;
    const { camera } = this.viewer, { view } = camera, { views, weights } = this.sphere.draw(camera);
    const at = this.sphere.views.findIndex((one) => one.every((x, i) => Math.abs(x - view[i]) < 1e-4));
    this.at("stored").value = at < 0 ? "" : at;
    const shares = views.map((k, i) => [weights[i], k]).filter(([weight]) => weight > 5e-4).sort((a, b) => b[0] - a[0]);
    this.at("triangle").textContent = shares.map(([weight, k]) => `view ${k}: ${(100 * weight).toFixed(0)} %`).join(", ");
  }
};

rsibr.direction = ([x, y, z]) => `(${[x, y, z].map((c) => signed(c, 2)).join(", ")})`;
