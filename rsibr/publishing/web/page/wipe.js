"use strict";
/* The wipe between two methods: a handle over the picture, by pointer and keyboard. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.Wipe = class {
  constructor(handle, frame, viewer) {
    Object.assign(this, { handle, viewer });
    handle.addEventListener("pointerdown", (event) => handle.setPointerCapture(event.pointerId));
    handle.addEventListener("pointermove", (event) => {
      if (!handle.hasPointerCapture(event.pointerId)) return;
      const box = frame.getBoundingClientRect();
      this.to((event.clientX - box.left) / box.width);
    });
    handle.addEventListener("keydown", (event) => {
      const { wipe } = viewer.state, step = event.shiftKey ? 0.1 : 0.01;
      const places = { ArrowLeft: wipe - step, ArrowDown: wipe - step, ArrowRight: wipe + step, ArrowUp: wipe + step, Home: 0, End: 1 };
      if (!(event.key in places)) return;
      event.preventDefault();
      this.to(places[event.key]);
    });
  }

  to(place) {
    this.viewer.set({ wipe: Math.min(Math.max(place, 0), 1) });
  }

  show() {
    const { handle } = this, { against, method, wipe } = this.viewer.state;
    handle.hidden = !against;
    handle.style.left = `${100 * wipe}%`;
    handle.setAttribute("aria-valuenow", Math.round(100 * wipe));
    handle.setAttribute("aria-valuetext", `${Math.round(100 * wipe)} % ${method}, the rest ${against}`);
    handle.firstElementChild.textContent = method;
    handle.lastElementChild.textContent = against;
  }
};
