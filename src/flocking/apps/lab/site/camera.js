// Where points of the world are on the screen. From above a plane lies as it is; groups in space are seen from the side.

export class Camera {
  constructor() {
    this.scale = 20;
    this.off = [0, 0, 0]; // from what is followed, or from the origin, to the middle of the view
    this.follow = true;
    this.moved = false; // whether a hand has moved the view since it was fitted
    this.yaw = 0;
    this.pitch = Math.PI / 2;
    this.width = this.height = 1;
    this.centre = [0, 0, 0];
  }

  look(centre, width, height) {
    this.width = width;
    this.height = height;
    this.centre = [centre[0], centre[1] ?? 0, centre[2] ?? 0];
    const target = this.follow ? this.centre.map((c, k) => c + this.off[k]) : this.off;
    this.shift = this.centre.map((c, k) => c - target[k]);
    this.target = target;
    [this.cy, this.sy, this.cp, this.sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
  }

  // Screen coordinates and depth of a point relative to the centre of the group.
  put(x, y, z) {
    const dx = x + this.shift[0], dy = y + this.shift[1], dz = z + this.shift[2];
    const right = this.cy * dx + this.sy * dy, ahead = -this.sy * dx + this.cy * dy;
    return [
      this.width / 2 + this.scale * right,
      this.height / 2 - this.scale * (this.sp * ahead + this.cp * dz),
      this.cp * ahead - this.sp * dz,
    ];
  }

  world(point) { return this.put(point[0] - this.centre[0], (point[1] ?? 0) - this.centre[1], (point[2] ?? 0) - this.centre[2]); }

  // The point of the plane through the target, across the view, that is seen at a pixel.
  point(sx, sy) {
    const right = (sx - this.width / 2) / this.scale, up = (this.height / 2 - sy) / this.scale;
    const ahead = this.sp * up;
    return [
      this.target[0] + this.cy * right - this.sy * ahead,
      this.target[1] + this.sy * right + this.cy * ahead,
      this.target[2] + this.cp * up,
    ];
  }

  pan(dx, dy) {
    this.moved = true;
    const a = this.point(0, 0), b = this.point(dx, dy);
    this.off = this.off.map((x, k) => x - (b[k] - a[k]));
  }

  zoom(factor, sx, sy) {
    this.moved = true;
    const before = this.point(sx, sy);
    this.scale = Math.min(Math.max(this.scale * factor, 1e-6), 1e7);
    const after = this.point(sx, sy);
    this.off = this.off.map((x, k) => x + before[k] - after[k]);
  }

  turn(dx, dy) {
    this.moved = true;
    this.yaw -= 0.008 * dx;
    this.pitch = Math.min(Math.max(this.pitch + 0.008 * dy, 0), Math.PI / 2);
  }

  // Fit the view to a group and what is near it.
  fit(group, width, height, left = 0) {
    this.moved = false;
    const d = group.d, low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const take = (p) => {
      for (let k = 0; k < 3; k++) {
        low[k] = Math.min(low[k], p[k]);
        high[k] = Math.max(high[k], p[k]);
      }
    };
    for (let i = 0; i < group.n; i++) take([group.q[i * d], d > 1 ? group.q[i * d + 1] : 0, d > 2 ? group.q[i * d + 2] : 0]);
    group.box.forEach((length, k) => {
      if (length === null) return;
      low[k] = -length / 2;
      high[k] = length / 2;
    });
    const size = Math.max(high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-9);
    const mid = [0, 1, 2].map((k) => (low[k] + high[k]) / 2);
    for (const s of group.solids) {
      const at = [0, 1, 2].map((k) => s.position[k] - (group.centre[k] ?? 0));
      if (at.some((x, k) => Math.abs(x - mid[k]) > 3 * size)) continue;
      const reach = Math.max(s.radius, ...s.outline.map((p) => Math.hypot(...p)), 0);
      const room = reach < size ? reach : 0;
      take(at.map((x) => x - room));
      take(at.map((x) => x + room));
    }
    this.yaw = d > 2 ? 0.6 : 0;
    this.pitch = d > 2 ? 0.5 : Math.PI / 2;
    const middle = [0, 1, 2].map((k) => (low[k] + high[k]) / 2);
    this.off = this.follow ? middle : middle.map((x, k) => x + (group.centre[k] ?? 0));
    const span = d > 2 ? Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]) : 0;
    const wide = Math.max(d > 2 ? span : high[0] - low[0], size / 8), tall = Math.max(d > 2 ? span : high[1] - low[1], size / 8);
    this.scale = 0.8 * Math.min((width - left) / wide, height / tall);
    if (d < 3) this.off[0] -= left / 2 / this.scale; // what covers the left of the scene hides no agent
  }
}
