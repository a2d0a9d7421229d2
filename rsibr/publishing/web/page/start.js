"use strict";
/* Reads what the page holds, says what it needs, and starts the viewer. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.start = async function (root) {
  const at = (id) => root.getElementById(id), page = JSON.parse(at("rsibr-page").textContent);
  const elements = { canvas: at("picture"), frame: at("frame"), still: at("still"), say, time };
  try {
    if (typeof DecompressionStream === "undefined") throw new rsibr.Unsupported("This browser is too old: it has no DecompressionStream.");
    if (!hasWebGl2()) throw new rsibr.Unsupported("This browser has no WebGL2, or it is switched off. A still picture stands in its place; open the page in another browser, or switch on graphics acceleration.");
    const contents = await decoded(page);
    const viewer = (rsibr.viewer = new rsibr.Viewer(page, contents, elements));
    await consent(viewer);
    const controls = new rsibr.Controls(root, viewer);
    say("");
    viewer.open();
    controls.fill();
    viewer.watch();
    viewer.changed();
    at("controls").disabled = false;
  } catch (error) {
    say(error instanceof rsibr.Unsupported ? error.message : `The page failed: ${error.message}`);
    if (!(error instanceof rsibr.Unsupported)) throw error;
  }
  return rsibr.viewer;

  function hasWebGl2() {
    const context = document.createElement("canvas").getContext("webgl2");
    context?.getExtension("WEBGL_lose_context")?.loseContext(); // a page may have 16
    return Boolean(context);
  }

  async function decoded(told) {
    const bundles = [];
    for (let k = 0; k < told.bakes.length; k++) bundles.push(await rsibr.decodeBundle(at(k ? `rsibr-bundle-${k + 1}` : "rsibr-bundle")));
    const stored = at("rsibr-arrays") ? (await rsibr.decodeBundle(at("rsibr-arrays"))).arrays : {};
    return { bundles, mesh: told.object && rsibr.meshArrays(stored), references: rsibr.referencesOf(told, stored) };
  }

  /** Wait for the user's word where the GPU may be too small. */
  function consent(viewer) {
    const size = viewer.memory;
    if (size <= rsibr.safeMemory) return undefined;
    const needed = `${(size / 2 ** 30).toFixed(1)} GiB`;
    return new Promise((go) => say(`This page needs about ${needed} of graphics memory, more than many devices give a page. A page of fewer methods (rsibr view --method) or of a bake with fewer or smaller maps needs less.`, "Load it all the same", go));
  }

  function say(text, button = "", act = null) {
    at("message").hidden = !text;
    at("message-text").textContent = text;
    at("message-button").hidden = !button;
    at("message-button").textContent = button;
    at("message-button").onclick = act;
  }

  function time(milliseconds, isFirst) {
    const { canvas } = elements, { state } = rsibr.viewer;
    const side = state.show === "picture" ? state.size : rsibr.viewer.contents.references[state.reference].size;
    const map = state.show === "picture" && state.lookup === "pixel" ? "a view a pixel" : `map ${side}²`;
    const taken = `${milliseconds.toFixed(milliseconds < 10 ? 1 : 0)} ms ${isFirst ? "for the first frame" : "a frame"}`;
    at("time").textContent = `${taken}, ${canvas.width} × ${canvas.height}, ${map}`;
  }
};

rsibr.ready = rsibr.start(document);
