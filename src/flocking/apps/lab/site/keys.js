// What the keyboard does in the scene: all that a pointer does there.

const VIEW_STEP = 40, STEP = 10, FAR_STEP = 50; // pixels by which an arrow key moves the view, and what is chosen
const WAYS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };

export class Keys {
  constructor(hands) {
    this.hands = hands;
    this.scene = hands.scene;
    this.scene.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.scene.frame) return;
    const { hands, scene } = this, cam = scene.camera, { width, height } = scene.size(), middle = [width / 2, height / 2];
    if (WAYS[event.key]) this.arrow(...WAYS[event.key], event.shiftKey);
    else if (event.key === "+" || event.key === "=") cam.zoom(1.2, ...middle);
    else if (event.key === "-") cam.zoom(1 / 1.2, ...middle);
    else if (event.key === "0") scene.aim();
    else if (event.key === "o") this.next();
    else if (event.key === "Delete") this.remove();
    else if (event.key === "Escape") {
      this.grip(null);
      hands.choose([]);
    } else if (event.key === "Enter" && hands.tool === "add") hands.event({ kind: "add", q: scene.point(...middle, 0), p: hands.meanVelocity() });
    else if (event.key === "Enter" && hands.tool === "obstacle") hands.event({ kind: "obstacle", centre: scene.point(...middle, 0), radius: 20 / cam.scale });
    else return;
    event.preventDefault();
    scene.repaint();
  }

  get solids() { return this.scene.frame.groups[0].solids.filter((s) => s.path.length); }

  // The obstacle or leader that is chosen; null where there is none, or no longer.
  get solid() { return this.solids.find((s) => String(s.path) === this.scene.gripped?.path) ?? null; }

  next() {
    const every = this.solids, at = every.indexOf(this.solid);
    this.grip(every.length ? every[(at + 1) % every.length] : null);
  }

  grip(solid) {
    const alike = this.solids.filter((s) => s.kind === solid?.kind), end = solid?.kind === "obstacle" ? ", Delete removes it" : "";
    this.scene.gripped = solid && { path: String(solid.path), told: `${solid.kind} ${1 + alike.indexOf(solid)} of ${alike.length} is chosen: arrow keys move it${end}, o chooses the next one, Escape none` };
    this.hands.showHint();
  }

  remove() {
    const { solid, hands } = this, agents = [...this.scene.chosen];
    if (solid?.kind === "obstacle") {
      hands.event({ kind: "remove", path: solid.of });
      this.grip(null);
    } else if (!solid && agents.length) hands.event({ kind: "kill", agents });
  }

  // An arrow key moves what was chosen with the key o; else, as the hand is, it moves the view, or moves or kicks agents.
  arrow(right, down, far) {
    const { hands, scene, solid } = this, agents = [...scene.chosen], hand = agents.length ? hands.tool : "view";
    if (!solid && !["drag", "kick"].includes(hand)) {
      scene.camera.pan(-VIEW_STEP * right, -VIEW_STEP * down);
      return;
    }
    const { width, height } = scene.size(), [x, y] = [width / 2, height / 2], step = far ? FAR_STEP : STEP;
    const from = scene.point(x, y, 0), to = scene.point(x + step * right, y + step * down, 0);
    const by = to.map((v, k) => v - from[k]), length = Math.hypot(...by);
    if (solid) hands.link.send("move", { path: solid.path, by });
    else if (hand === "drag") hands.event({ kind: "shift", agents, by });
    else if (length > 0) hands.event({ kind: "kick", agents, velocity: by.map((v) => (v * (hands.speed ?? 1)) / length) });
  }
}
