"use strict";
// Order and exposure of a gallery. Without this script the contact sheet stands as it is.
(() => {
  const controls = document.querySelector(".controls");
  const sheets = document.querySelector(".sheets"), sorted = document.querySelector(".sorted");
  const jobs = [...document.querySelectorAll(".job")];
  const homes = new Map(jobs.map((job) => [job, job.parentElement]));
  const told = document.querySelector("[aria-live]");
  const buttons = [...controls.querySelectorAll("[data-order]")];

  // ---- Order: names from a to z, numbers from the largest; pressed again, the other way round ----
  const value = (job, key) => (key in job.dataset ? +job.dataset[key] : NaN);
  const compare = {
    name: (a, b) => a.dataset.name.localeCompare(b.dataset.name, undefined, { numeric: true }),
    number: (key) => (a, b) => value(b, key) - value(a, key),
  };

  function order(key, reversed) {
    if (key === "sheet") {
      for (const job of jobs) homes.get(job).append(job);
    } else {
      const known = jobs.filter((job) => key === "name" || !Number.isNaN(value(job, key)));
      known.sort(key === "name" ? compare.name : compare.number(key));
      if (reversed) known.reverse();
      sorted.replaceChildren(...known, ...jobs.filter((job) => !known.includes(job)));
    }
    sheets.hidden = key !== "sheet";
    sorted.hidden = key === "sheet";
  }

  for (const button of buttons) {
    button.addEventListener("click", () => {
      const key = button.dataset.order;
      const again = button.getAttribute("aria-pressed") === "true" && key !== "sheet";
      const reversed = again && button.dataset.reversed !== "true";
      button.dataset.reversed = reversed;
      order(key, reversed);
      for (const one of buttons) {
        one.setAttribute("aria-pressed", one === button);
        one.lastElementChild.textContent = one === button && key !== "sheet" ? ((key === "name") === reversed ? " ↓" : " ↑") : "";
      }
      const from = key === "name" ? (reversed ? "from z to a" : "from a to z") : (reversed ? "smallest first" : "largest first");
      told.textContent = key === "sheet" ? "ordered by the matrix" : `ordered by ${button.firstChild.textContent.trim()}, ${from}`;
    });
  }

  // ---- Exposure: display values are taken back to radiance, multiplied, and mapped again. As in the page itself, the
  // curve is that of the largest channel, and the others keep their ratio to it ----
  const slider = controls.querySelector("input[type=range]"), output = controls.querySelector("output");
  const box = controls.querySelector("input[type=checkbox]");
  const white = +slider.dataset.white, contrast = +slider.dataset.contrast;
  const linear = (v) => (v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
  const encoded = (v) => (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055);
  const share = (y) => (contrast === 0 ? y : Math.expm1(y * Math.log1p(contrast)) / contrast);
  const curve = (x) => (contrast === 0 ? x : Math.log1p(contrast * x) / Math.log1p(contrast));
  const decoded = Float32Array.from({ length: 256 }, (_, i) => linear(i / 255));
  const bytes = Uint8Array.from({ length: 4097 }, (_, i) => Math.round(255 * encoded(i / 4096)));
  let shown = null;

  // A canvas in place of each picture, made when the exposure is first touched.
  function canvases() {
    return [...document.querySelectorAll("img.picture")].map((img) => {
      const canvas = document.createElement("canvas");
      canvas.className = "picture";
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", img.alt);
      [canvas.width, canvas.height] = [img.naturalWidth, img.naturalHeight];
      const pen = canvas.getContext("2d");
      pen.drawImage(img, 0, 0);
      img.replaceWith(canvas);
      return { pen, before: pen.getImageData(0, 0, canvas.width, canvas.height) };
    });
  }

  function expose() {
    const stops = +slider.value, factor = 2 ** stops, straight = box && box.checked;
    output.textContent = stops === 0 ? "as chosen" : `${stops > 0 ? "+" : "−"}${Math.abs(stops)} EV, white ${(white / factor).toPrecision(2)}`;
    slider.setAttribute("aria-valuetext", output.textContent);
    const gain = decoded.map((y) => {
      const x = Math.min(1, factor * share(y));
      return y > 0 ? (straight ? x : curve(x)) / y : 0;
    });
    shown ??= canvases();
    for (const { pen, before } of shown) {
      const after = new ImageData(before.width, before.height);
      const from = before.data, to = after.data;
      for (let i = 0; i < from.length; i += 4) {
        const scale = gain[Math.max(from[i], from[i + 1], from[i + 2])];
        for (let k = i; k < i + 3; k++) to[k] = bytes[Math.min(4096, Math.round(4096 * decoded[from[k]] * scale))];
        to[i + 3] = from[i + 3];
      }
      pen.putImageData(after, 0, 0);
    }
  }

  let waiting = 0;
  for (const control of [slider, box]) {
    control?.addEventListener("input", () => {
      cancelAnimationFrame(waiting);
      waiting = requestAnimationFrame(expose);
    });
  }
  controls.hidden = false;
})();
