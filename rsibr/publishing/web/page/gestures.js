"use strict";
/* Orbit and zoom by pointer, wheel, pinch and keyboard. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

const TURN = (5 * Math.PI) / 180; // of an arrow key; with Shift 1°
const HALF_TURN_PIXELS = 400; // of a drag

rsibr.keys = {
  "Arrow keys": "orbit by 5° (Shift: 1°)",
  "+ and −": "zoom",
  "Home or 0": "first view",
  "[ and ]": "move the wipe",
  "M and N": "next method on the left, on the right",
  T: "next tone curve",
  "E and D": "exposure up, down",
  B: "background",
  Space: "turntable",
};

/** @param viewer rsibr.Viewer */
rsibr.listenToGestures = function (surface, viewer) {
  const pointers = new Map();
  surface.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    surface.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    viewer.stopMotion();
  });
  surface.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    if (pointers.size === 1) {
      const step = Math.PI / HALF_TURN_PIXELS / Math.max(1, viewer.camera.zoom);
      viewer.orbit(-(now[0] - before[0]) * step, (now[1] - before[1]) * step);
    } else {
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const apart = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
      if (apart(before) > 0) viewer.zoom(apart(now) / apart(before));
    }
    pointers.set(event.pointerId, now);
  });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture"]) {
    surface.addEventListener(name, (event) => pointers.delete(event.pointerId));
  }
  surface.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      viewer.zoom(Math.exp(-0.0015 * event.deltaY * (event.deltaMode === 1 ? 20 : 1)));
    },
    { passive: false },
  );
  surface.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const action = actionOf(event, viewer);
    if (!action) return;
    event.preventDefault();
    action();
  });
};

function actionOf(event, viewer) {
  const turn = event.shiftKey ? TURN / 5 : TURN, { state } = viewer;
  const next = (key, names) => () => viewer.set({ [key]: names[(names.indexOf(state[key]) + 1) % names.length] });
  const actions = {
    ArrowLeft: () => viewer.orbit(-turn, 0),
    ArrowRight: () => viewer.orbit(turn, 0),
    ArrowUp: () => viewer.orbit(0, turn),
    ArrowDown: () => viewer.orbit(0, -turn),
    "+": () => viewer.zoom(1.15),
    "=": () => viewer.zoom(1.15),
    "-": () => viewer.zoom(1 / 1.15),
    Home: () => viewer.home(),
    0: () => viewer.home(),
    "[": () => viewer.set({ wipe: Math.max(0, state.wipe - 0.05) }),
    "]": () => viewer.set({ wipe: Math.min(1, state.wipe + 0.05) }),
    m: next("method", viewer.methods),
    n: next("against", ["", ...viewer.methods]),
    t: next("tone", Object.keys(rsibr.toneCurves)),
    e: () => viewer.set({ exposure: Math.min(state.exposure + 0.5, 10) }),
    d: () => viewer.set({ exposure: Math.max(state.exposure - 0.5, -10) }),
    b: () => viewer.set({ background: !state.background }),
    " ": () => viewer.toggleTurntable(),
  };
  return actions[event.key.length === 1 ? event.key.toLowerCase() : event.key];
}
