"use strict";
/* The sphere of views: stored views, their triangles, the one in use. Drawn with a 2-D context, beside the picture. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.ViewsSphere = class {
  /**
   * @param sphere the engine's `rsibr.ViewSphere`, which outlives its graphics context
   * @param choose called with a stored view that was clicked
   */
  constructor(canvas, sphere, choose) {
    Object.assign(this, { canvas, sphere });
    this.views = Array.from({ length: sphere.count }, (_, k) => Array.from(sphere.direction(k)));
    canvas.addEventListener("click", (event) => {
      const box = canvas.getBoundingClientRect();
      const at = [event.clientX - box.left, event.clientY - box.top].map((x) => x * (canvas.width / box.width));
      choose(this.views[this.nearest(at)]);
    });
  }

  /** Place of a direction on the canvas, with its depth toward the viewer. */
  placed(direction) {
    const { right, up, back } = this.axes, half = this.canvas.width / 2, radius = 0.86 * half;
    const dot = (axis) => axis.reduce((sum, x, i) => sum + x * direction[i], 0);
    return [half + radius * dot(right), half - radius * dot(up), dot(back)];
  }

  /** Stored view on the near side that is nearest to a point of the canvas. */
  nearest([x, y]) {
    const distances = this.views.map((view) => {
      const [px, py, depth] = this.placed(view);
      return Math.hypot(px - x, py - y) + (depth < 0 ? this.canvas.width : 0);
    });
    return distances.indexOf(Math.min(...distances));
  }

  draw(camera) {
    this.axes = camera.axes;
    const { canvas } = this, c = canvas.getContext("2d"), style = getComputedStyle(canvas);
    const [ink, faint, accent] = ["--ink", "--faint", "--accent"].map((name) => style.getPropertyValue(name));
    const used = this.used(camera.view);
    const unit = canvas.width / 160;
    c.clearRect(0, 0, canvas.width, canvas.height);
    c.lineJoin = "round";
    this.path(c, used.views);
    c.globalAlpha = 0.28;
    c.fillStyle = accent;
    c.fill();
    this.edges(c, faint, unit);
    c.globalAlpha = 1;
    c.strokeStyle = accent;
    c.lineWidth = 2 * unit;
    this.path(c, used.views);
    c.stroke();
    const most = this.views.length > 100 ? 1.5 : 3;
    this.views.forEach((view, k) => {
      const [x, y, depth] = this.placed(view), at = used.views.indexOf(k);
      c.globalAlpha = depth < 0 && at < 0 ? 0.25 : 1;
      c.fillStyle = at < 0 ? ink : accent;
      c.beginPath();
      c.arc(x, y, unit * (at < 0 ? most : 3 + 4 * Math.sqrt(used.weights[at])), 0, 2 * Math.PI);
      c.fill();
    });
    c.globalAlpha = 1;
    const half = canvas.width / 2;
    c.strokeStyle = ink;
    c.lineWidth = 1.5 * unit;
    c.beginPath();
    for (const [dx, dy] of [[6, 0], [0, 6]]) {
      c.moveTo(half - dx * unit, half - dy * unit);
      c.lineTo(half + dx * unit, half + dy * unit);
    }
    c.stroke();
    return used;
  }

  /** Stored views around a view, and their weights. */
  used(view) {
    if (this.views.length < 3) return { views: [], weights: [] };
    const views = this.sphere.surrounding(view);
    return { views, weights: this.sphere.areaWeights(view, views) };
  }

  path(c, corners) {
    c.beginPath();
    corners.forEach((k, i) => c[i ? "lineTo" : "moveTo"](...this.placed(this.views[k]).slice(0, 2)));
    c.closePath();
  }

  edges(c, colour, unit) {
    const { triangles } = this.sphere;
    c.strokeStyle = colour;
    c.lineWidth = unit;
    for (let t = 0; t < triangles.length; t += 3) {
      const corners = Array.from(triangles.subarray(t, t + 3));
      c.globalAlpha = corners.some((k) => this.placed(this.views[k])[2] < 0) ? 0.2 : 0.8;
      this.path(c, corners);
      c.stroke();
    }
  }
};
