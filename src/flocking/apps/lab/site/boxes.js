// What the scene draws of a space that repeats, and where bodies point.

import { nearest } from "./frames.js";

export const AXES = { dark: ["#ffd166", "#7ee0b0", "#ff8fa3"], light: ["#a36a00", "#0a7f54", "#b3243f"] }; // where bodies point
const WEDGE = 2.2; // length of a wedge by that of a dart

// A link across a border of the box as one half at each agent; whether it is one.
export function halves(scene, group, i, j, sx, sy) {
  const d = group.d, half = [0, 0, 0];
  let across = false;
  for (let k = 0; k < d; k++) {
    const straight = group.q[j * d + k] - group.q[i * d + k], away = nearest(straight, group.box[k]);
    across ||= away !== straight;
    half[k] = away / 2;
  }
  if (!across) return false;
  for (const [a, sign] of [[i, 1], [j, -1]]) {
    const at = scene.camera.put(...[0, 1, 2].map((k) => (k < d ? group.q[a * d + k] : 0) + sign * half[k]));
    scene.context.moveTo(sx[a], sy[a]);
    scene.context.lineTo(at[0], at[1]);
  }
  return true;
}

// Outline of the box of a space that repeats; along an axis without end it reaches as far as the agents do.
export function edges(scene, group) {
  if (group.box.every((length) => length === null)) return;
  const c = scene.context, cam = scene.camera, d = group.d;
  const reach = [0, 1, 2].map((k) => {
    if (k >= d) return 0;
    if (group.box[k] !== null) return group.box[k] / 2;
    let most = 0;
    for (let i = 0; i < group.n; i++) most = Math.max(most, Math.abs(group.q[i * d + k]));
    return most;
  });
  c.strokeStyle = scene.dark ? "#5c7085" : "#8695a3";
  c.lineWidth = 1;
  c.setLineDash([6, 4]);
  c.beginPath();
  // Edges join corners that differ in one axis; those across an axis without end are left out.
  for (let corner = 0; corner < 1 << d; corner++)
    for (let k = 0; k < d; k++) {
      if (corner & (1 << k)) continue;
      if ([...Array(d).keys()].some((x) => x !== k && group.box[x] === null)) continue;
      const ends = [corner, corner | (1 << k)].map((bits) => cam.put(...reach.map((r, x) => (bits & (1 << x) ? r : -r))));
      c.moveTo(ends[0][0], ends[0][1]);
      c.lineTo(ends[1][0], ends[1][1]);
    }
  c.stroke();
  c.setLineDash([]);
}

// Where bodies point: a wedge from each agent along each of its directions, in the colour of that direction.
export function wedges(scene, group, sx, sy) {
  const c = scene.context, cam = scene.camera, d = group.d, n = group.n;
  const size = WEDGE * (n <= 60 ? 9 : n <= 400 ? 7 : n <= 2000 ? 5 : 3);
  group.axes.forEach((vectors, which) => {
    c.fillStyle = AXES[scene.dark ? "dark" : "light"][which % 3];
    c.beginPath();
    for (let i = 0; i < n; i++) {
      const px = vectors[i * d], py = d > 1 ? vectors[i * d + 1] : 0, pz = d > 2 ? vectors[i * d + 2] : 0;
      const right = cam.cy * px + cam.sy * py, ahead = -cam.sy * px + cam.cy * py, up = cam.sp * ahead + cam.cp * pz;
      const flat = Math.hypot(right, up) || 1, wide = 0.16 * size, x = sx[i], y = sy[i];
      c.moveTo(x + size * right, y - size * up);
      c.lineTo(x - (wide * up) / flat, y - (wide * right) / flat);
      c.lineTo(x + (wide * up) / flat, y + (wide * right) / flat);
      c.closePath();
    }
    c.fill();
  });
}

// Whether an agent left the box and came in again between two frames.
export function crossed(a, b, i) {
  return a.box.some((length, k) => length !== null && Math.abs(b.q[i * b.d + k] - a.q[i * a.d + k]) > length / 2);
}
