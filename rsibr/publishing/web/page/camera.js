"use strict";
/* Camera that orbits an object, with +Y up: azimuth 0 looks from +Z, positive toward +X.

   Zoom narrows the picture and leaves the camera where it is, so that it never enters the object. A field of view of 0
   is the parallel projection of a sphere map. */
var rsibr = globalThis.rsibr || (globalThis.rsibr = {});

rsibr.OrbitCamera = class {
  /** @param {{target: number[], radius: number, azimuth: number, elevation: number, fov: number}} home */
  constructor(home) {
    this.home = home;
    this.reset();
  }

  reset() {
    const { target, radius, azimuth, elevation, fov } = this.home;
    Object.assign(this, { target, radius, azimuth, elevation, fov, zoom: 1 });
  }

  /** Unit direction from the object to the camera. */
  get view() {
    const c = Math.cos(this.elevation);
    return [c * Math.sin(this.azimuth), Math.sin(this.elevation), c * Math.cos(this.azimuth)];
  }

  set view([x, y, z]) {
    this.elevation = Math.atan2(y, Math.hypot(x, z));
    if (Math.hypot(x, z) > 1e-9) this.azimuth = Math.atan2(x, z);
    else this.azimuth = 0; // as the library's frame at a pole
  }

  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.min(Math.max(this.elevation + elevation, -Math.PI / 2), Math.PI / 2);
  }

  magnify(factor) {
    this.zoom = Math.min(Math.max(this.zoom * factor, 0.25), 40);
  }

  /** Zoom so that points, the corners of a box, fill the picture. */
  fit(points, aspect) {
    this.zoom = 1;
    const m = this.clip(aspect);
    const row = ([x, y, z], k) => m[k] * x + m[4 + k] * y + m[8 + k] * z + m[12 + k];
    const reach = points.map((p) => Math.max(Math.abs(row(p, 0)), Math.abs(row(p, 1))) / row(p, 3));
    this.magnify(0.94 / Math.max(...reach));
  }

  /** Axes right, up and back, unit vectors. */
  get axes() {
    const s = Math.sin(this.azimuth), c = Math.cos(this.azimuth);
    const se = Math.sin(this.elevation), ce = Math.cos(this.elevation);
    return { right: [c, 0, -s], up: [-se * s, ce, -se * c], back: [ce * s, se, ce * c] };
  }

  /** Half the height of the picture at the target: the bounding sphere fits into the shorter side. */
  halfHeight(aspect) {
    const margin = this.fov > 0 ? 1 / Math.cos((this.fov * Math.PI) / 360) : 1;
    return (1.06 * margin * this.radius) / Math.min(1, aspect) / this.zoom;
  }

  /** Distance from the target; of the parallel projection, where its rays start. */
  get distance() {
    if (this.fov === 0) return 4 * this.radius;
    return (1.06 * this.radius) / Math.sin((this.fov * Math.PI) / 360);
  }

  get eye() {
    return this.target.map((x, i) => x + this.distance * this.view[i]);
  }

  /** What the shaders take: rays start at eye + parallel · (x · right + y · up), for x, y in [−1, 1]. */
  rays(aspect) {
    const { right, up, back } = this.axes, h = this.halfHeight(aspect), w = h * aspect;
    return {
      eye: this.eye,
      right: right.map((x) => x * w),
      up: up.map((x) => x * h),
      forward: back.map((x) => -x * this.distance),
      parallel: this.fov === 0 ? 1 : 0,
    };
  }

  /** Matrix from world to clip space, by columns. */
  clip(aspect) {
    const { right, up, back } = this.axes, d = this.distance, h = this.halfHeight(aspect), w = h * aspect;
    const near = Math.max(d - 1.01 * this.radius, 0.01 * d), far = d + 1.01 * this.radius;
    const at = (axis) => -axis.reduce((sum, x, i) => sum + x * this.eye[i], 0);
    const rows =
      this.fov === 0
        ? [scaled(right, 1 / w), scaled(up, 1 / h), scaled(back, -2 / (far - near), -(far + near) / (far - near)), [0, 0, 0, 1]]
        : [
            scaled(right, d / w),
            scaled(up, d / h),
            scaled(back, -(far + near) / (far - near), (-2 * far * near) / (far - near)),
            scaled(back, -1),
          ];
    return new Float32Array([0, 1, 2, 3].flatMap((column) => rows.map((row) => row[column])));

    function scaled(axis, factor, offset = 0) {
      return [...axis.map((x) => x * factor), at(axis) * factor + offset];
    }
  }
};
