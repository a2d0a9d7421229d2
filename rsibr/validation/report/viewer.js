"use strict";
// The stage of a report: two pictures with an edge to wipe, and the error of the right one, moved and zoomed together.
// All pictures are taken from the cards of the view; without this script the cards are what is shown.
(() => {
  const views = document.querySelector(".views");
  const stage = views && views.querySelector(".stage");
  if (!stage) return;
  const [wiped, judged] = stage.querySelectorAll(".pane");
  const [left, right] = [...wiped.querySelectorAll(".half")].map((half) => half.appendChild(new Image()));
  const error = judged.appendChild(new Image());
  const [leftText, rightText, errorText] = stage.querySelectorAll("figcaption span");
  const choose = Object.fromEntries([...stage.querySelectorAll("[data-choose]")].map((box) => [box.dataset.choose, box]));
  const slider = stage.querySelector(".wipe");
  const MOST = 32;
  const place = { zoom: 1, x: 0, y: 0, wipe: 50 };

  // ---- Which pictures ----
  const section = () => {
    const chosen = views.querySelector(".index input:checked");
    return chosen ? document.getElementById(chosen.value) : views.querySelector("section");
  };
  const cards = () => [...section().querySelectorAll(".card")];
  const named = (name) => cards().find((card) => card.dataset.of === name);
  const picture = (card, kind) => card && card.querySelector(`img[data-kind="${kind}"]`);
  const put = (img, from) => {
    img.hidden = !from;
    if (from) { img.src = from.src; img.alt = from.alt; }
  };

  function offer() {
    for (const side of ["a", "b"]) {
      const box = choose[side];
      const before = box.value;
      box.replaceChildren(...cards().map((card) => new Option(card.dataset.of)));
      const first = section().dataset[side === "a" ? "left" : "right"];
      box.value = named(before) ? before : first;
    }
  }

  function show() {
    const a = named(choose.a.value), b = named(choose.b.value);
    const kind = choose.kind.value;
    put(left, picture(a, "image"));
    put(right, picture(b, "image"));
    put(error, picture(b, kind));
    leftText.textContent = a.dataset.of;
    rightText.textContent = b.dataset.of;
    const what = choose.kind.selectedOptions[0].text;
    errorText.textContent = picture(b, kind) ? picture(b, kind).dataset.note : `${b.dataset.of} has no picture of its ${what}`;
    slider.setAttribute("aria-valuetext", `${a.dataset.of} left of ${place.wipe} %, ${b.dataset.of} right of it`);
    stage.querySelector("[aria-live]").textContent = `left ${a.dataset.of}, right ${b.dataset.of}. ${errorText.textContent}`;
    for (const card of cards()) card.classList.toggle("shown", card === a || card === b);
    if (place.zoom >= 2) sharpen();
  }

  // ---- Where in them: the upper left corner of the picture in units of the pane, and its size ----
  function apply() {
    const rest = 1 - place.zoom;
    place.x = Math.min(0, Math.max(rest, place.x));
    place.y = Math.min(0, Math.max(rest, place.y));
    for (const [name, value] of Object.entries(place)) stage.style.setProperty(`--${name}`, value);
    stage.classList.toggle("zoomed", place.zoom > 1);
    stage.classList.toggle("texels", place.zoom >= 2);
    stage.querySelector("output").textContent = `${+place.zoom.toFixed(1)}×`;
    slider.value = place.wipe;
  }

  // Zoomed in, the whole images replace those in the page, where the folder lies beside it.
  function sharpen() {
    const kinds = [[choose.a.value, "image"], [choose.b.value, "image"], [choose.b.value, choose.kind.value]];
    for (const [name, kind] of kinds) {
      const shown = picture(named(name), kind);
      if (!shown || !shown.dataset.file) continue;
      const whole = new Image();
      whole.onload = () => { shown.src = whole.src; show(); };
      whole.src = shown.dataset.file;
      delete shown.dataset.file; // asked for once
    }
  }

  function zoomTo(zoom, at = [0.5, 0.5]) {
    const next = Math.min(MOST, Math.max(1, zoom));
    place.x = at[0] - ((at[0] - place.x) * next) / place.zoom;
    place.y = at[1] - ((at[1] - place.y) * next) / place.zoom;
    place.zoom = next;
    apply();
    if (next >= 2) sharpen();
  }

  function wipeTo(share) {
    place.wipe = Math.round(100 * Math.min(1, Math.max(0, share)));
    apply();
    slider.setAttribute("aria-valuetext", `${choose.a.value} left of ${place.wipe} %, ${choose.b.value} right of it`);
  }

  // ---- Pointers: the edge wipes, a zoomed picture is dragged, two fingers zoom ----
  function follow(pane) {
    const down = new Map();
    let wiping = false;
    const at = (event) => {
      const box = pane.getBoundingClientRect();
      return [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height];
    };
    const apart = () => {
      const [p, q] = [...down.values()];
      return { middle: [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2], length: Math.hypot(p[0] - q[0], p[1] - q[1]) };
    };
    pane.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      pane.setPointerCapture(event.pointerId);
      down.set(event.pointerId, at(event));
      wiping = pane === wiped && (event.target.className === "edge" || place.zoom === 1) && down.size === 1;
    });
    pane.addEventListener("pointermove", (event) => {
      const before = down.get(event.pointerId);
      if (!before) return;
      const now = at(event);
      if (down.size === 2) {
        const was = apart();
        down.set(event.pointerId, now);
        const is = apart();
        if (was.length > 0) zoomTo((place.zoom * is.length) / was.length, is.middle);
        return;
      }
      down.set(event.pointerId, now);
      if (wiping) return wipeTo(now[0]);
      place.x += now[0] - before[0];
      place.y += now[1] - before[1];
      apply();
    });
    for (const end of ["pointerup", "pointercancel"]) pane.addEventListener(end, (event) => down.delete(event.pointerId));
    pane.addEventListener("dblclick", (event) => zoomTo(place.zoom > 1 ? 1 : 4, at(event)));
    pane.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && !event.metaKey) return; // the page scrolls
      event.preventDefault();
      zoomTo(place.zoom * Math.exp(-event.deltaY / 200), at(event));
    }, { passive: false });
    pane.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const moves = { ArrowLeft: [0.1, 0], ArrowRight: [-0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] };
      if (event.key === "+" || event.key === "=") zoomTo(place.zoom * 1.5);
      else if (event.key === "-") zoomTo(place.zoom / 1.5);
      else if (event.key === "0") zoomTo(1);
      else if (event.key in moves && place.zoom > 1) {
        place.x += moves[event.key][0];
        place.y += moves[event.key][1];
        apply();
      } else return;
      event.preventDefault();
    });
  }

  // ---- Controls ----
  for (const box of Object.values(choose)) box.addEventListener("change", show);
  for (const input of views.querySelectorAll(".index input")) {
    input.addEventListener("change", () => { offer(); show(); });
  }
  slider.addEventListener("input", () => wipeTo(slider.value / 100));
  for (const button of stage.querySelectorAll("[data-zoom]")) {
    const factors = { in: 1.5, out: 1 / 1.5, whole: 0 };
    button.addEventListener("click", () => zoomTo(place.zoom * factors[button.dataset.zoom]));
  }
  for (const button of views.querySelectorAll(".card button")) {
    button.hidden = false;
    button.addEventListener("click", () => {
      choose.b.value = button.closest(".card").dataset.of;
      show();
      stage.scrollIntoView({ block: "nearest" });
    });
  }
  for (const pane of [wiped, judged]) follow(pane);
  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    for (const one of opened) one.open = true;
  });
  addEventListener("afterprint", () => { for (const one of opened) one.open = false; });
  views.classList.add("live");
  stage.hidden = false;
  offer();
  apply();
  show();
})();
