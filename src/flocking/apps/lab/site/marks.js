// Marks over the scene: chosen agents, the one under the pointer, forces, and what a hand is drawing.

// In the part of one run. The same agents are marked in all runs; forces are those of the run they were asked of.
export function marks(scene, group, run, sx, sy) {
  const c = scene.context;
  const ring = (i, radius) => {
    c.beginPath();
    c.arc(sx[i], sy[i], radius, 0, 7);
    c.stroke();
  };
  c.strokeStyle = "#ff4fd0";
  c.lineWidth = 2;
  for (const i of scene.chosen) if (i < group.n) ring(i, 10);
  const gripped = group.solids.find((s) => String(s.path) === scene.gripped?.path);
  if (gripped) {
    const [x, y] = scene.camera.world(gripped.position), reach = Math.max(gripped.radius, ...gripped.outline.map((p) => Math.hypot(...p)));
    c.setLineDash([5, 4]);
    c.beginPath();
    c.arc(x, y, Math.max(14, reach * scene.camera.scale + 6), 0, 7);
    c.stroke();
    c.setLineDash([]);
  }
  const { hovered, forces } = scene;
  if (hovered?.run === run && hovered.agent < group.n) {
    c.strokeStyle = scene.dark ? "#ffffff" : "#1c2733";
    c.lineWidth = 1.2;
    ring(hovered.agent, 11);
  }
  if (forces?.run === run && forces.agent < group.n) {
    const most = Math.max(...forces.list.map((f) => Math.hypot(...f.force)), 1e-12);
    for (const f of forces.list) {
      const size = Math.hypot(...f.force);
      if (size > 1e-3 * most) arrow(scene, sx[forces.agent], sy[forces.agent], f.force, (70 * size) / most, f.colour);
    }
  }
}

// Over all parts: the lasso, and the line or circle of a hand.
export function shapes(scene) {
  const c = scene.context;
  if (scene.lasso) {
    c.strokeStyle = "#ff4fd0";
    c.setLineDash([5, 4]);
    c.lineWidth = 1.4;
    c.beginPath();
    scene.lasso.forEach(([x, y], k) => (k ? c.lineTo(x, y) : c.moveTo(x, y)));
    c.closePath();
    c.stroke();
    c.setLineDash([]);
  }
  if (!scene.drawing) return;
  const { kind, from, to } = scene.drawing;
  c.strokeStyle = scene.dark ? "#ffffff" : "#1c2733";
  c.lineWidth = 1.4;
  c.beginPath();
  if (kind === "obstacle") c.arc(from[0], from[1], Math.hypot(to[0] - from[0], to[1] - from[1]), 0, 7);
  else {
    c.moveTo(...from);
    c.lineTo(...to);
  }
  c.stroke();
}

function arrow(scene, x, y, vector, length, colour) {
  const c = scene.context, cam = scene.camera, [px, py, pz] = [vector[0], vector[1] ?? 0, vector[2] ?? 0];
  const right = cam.cy * px + cam.sy * py, ahead = -cam.sy * px + cam.cy * py, up = cam.sp * ahead + cam.cp * pz;
  const size = Math.hypot(px, py, pz), dx = (length * right) / size, dy = (-length * up) / size, flat = Math.hypot(dx, dy);
  if (flat < 2) return;
  const [ux, uy] = [dx / flat, dy / flat];
  c.strokeStyle = c.fillStyle = colour;
  c.lineWidth = 2;
  c.beginPath();
  c.moveTo(x, y);
  c.lineTo(x + dx - 4 * ux, y + dy - 4 * uy);
  c.stroke();
  c.beginPath();
  c.moveTo(x + dx, y + dy);
  c.lineTo(x + dx - 8 * ux - 4 * uy, y + dy - 8 * uy + 4 * ux);
  c.lineTo(x + dx - 8 * ux + 4 * uy, y + dy - 8 * uy - 4 * ux);
  c.fill();
}
