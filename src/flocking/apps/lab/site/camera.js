// Where points of the world are on the screen. From above a plane lies as it is; groups in space are seen from the side.

const CARDS = 110; // pixels of the cards above and below, as style.css has them

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

  // Fit the view to groups, each seen in a place of this size, and what is near them.
  fit(groups, width, height, left = 0) {
    this.moved = false;
    const d = groups[0].d, low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const take = (p) => {
      for (let k = 0; k < 3; k++) {
        low[k] = Math.min(low[k], p[k]);
        high[k] = Math.max(high[k], p[k]);
      }
    };
    // Where the view follows a group, its places are those around its centre: each of several has its own.
    const about = groups.map((group) => [0, 1, 2].map((k) => (this.follow ? 0 : (group.centre[k] ?? 0))));
    groups.forEach((group, g) => {
      for (let i = 0; i < group.n; i++) take([0, 1, 2].map((k) => about[g][k] + (k < d ? group.q[i * d + k] : 0)));
      if (group.box.every((length) => length === null)) return;
      take([0, 1, 2].map((k) => (group.box[k] == null ? low[k] : about[g][k] - group.box[k] / 2)));
      take([0, 1, 2].map((k) => (group.box[k] == null ? high[k] : about[g][k] + group.box[k] / 2)));
    });
    const size = Math.max(high[0] - low[0], high[1] - low[1], high[2] - low[2], 1e-9);
    const mid = [0, 1, 2].map((k) => (low[k] + high[k]) / 2);
    groups.forEach((group, g) => {
      for (const s of group.solids) {
        const at = [0, 1, 2].map((k) => s.position[k] - (group.centre[k] ?? 0) + about[g][k]);
        if (at.some((x, k) => Math.abs(x - mid[k]) > 3 * size)) continue;
        const reach = Math.max(s.radius, ...s.outline.map((p) => Math.hypot(...p)), 0);
        const room = reach < size ? reach : 0;
        take(at.map((x) => x - room));
        take(at.map((x) => x + room));
      }
    });
    this.yaw = d > 2 ? 0.6 : 0;
    this.pitch = d > 2 ? 0.5 : Math.PI / 2;
    this.off = [0, 1, 2].map((k) => (low[k] + high[k]) / 2);
    const span = d > 2 ? Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]) : 0;
    const wide = Math.max(d > 2 ? span : high[0] - low[0], size / 8), tall = Math.max(d > 2 ? span : high[1] - low[1], size / 8);
    // In a low scene the cards above and below need more than the usual margin.
    this.scale = Math.min((0.8 * (width - left)) / wide, Math.max(Math.min(0.8 * height, height - CARDS), 0.4 * height) / tall);
    if (d < 3) this.off[0] -= left / 2 / this.scale; // what covers the left of the scene hides no agent
  }
}
