// The scene: obstacles, links, trails, agents and leaders of the last frame, painted when something changed.

import { Camera } from "./camera.js";
import { binned, gradient, wheel, css } from "./colours.js";
import { AXES, crossed, edges, halves, wedges } from "./boxes.js";
import { density } from "./density.js";
import { flocks, speeds } from "./frames.js";
import { marks, shapes } from "./marks.js";
import { short } from "./numbers.js";

const MOST_TRAILS = 500, MOST_DARTS = 10000;
const TRAIL_SHARE = 1 / 25; // length of a trail in time, as a share of the scenario

const TOOLS_WIDTH = 52; // pixels of the scene under its hands, as style.css has them
const BELOW_CARDS = 66; // pixels from above at which nothing covers the names of the runs
const WIDEST = 16; // a view widens to so many times its first fit: one agent that flees leaves the others visible

export class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.camera = new Camera();
    this.look = { colour: "speed", links: true, trails: false, virtual: false, light: false };
    this.chosen = new Set();
    this.hovered = null; // {run, agent}
    this.forces = null; // of the chosen agent: {run, agent, list: [{term, force, colour}]}
    this.gripped = null; // the obstacle or leader that the keyboard moves: {path, told}
    this.lasso = null;
    this.drawing = null; // a shape that a hand is making: {kind, from, to}
    this.past = [];
    this.fastest = 0;
    this.frame = null;
    this.span = 1;
    this.needsFit = true;
    this.widens = false; // whether the view is to be fitted anew because agents have left it
    this.held = false; // whether a hand holds something, so that the view must stay
    this.widest = 0; // pixels a unit has at least when the view widens by itself
    this.places = []; // of each run: {sx, sy}, pixels of its agents within its part of the scene
    this.painted = 0;
    this.after = () => {};
    new ResizeObserver(() => this.repaint()).observe(canvas);
  }

  show(frame) {
    const before = this.frame;
    this.frame = frame;
    const one = frame.groups[0];
    if (before && (frame.t < before.t || before.groups[0].n !== one.n || before.live !== frame.live)) this.past = [];
    if (!this.past.length || frame.t > this.past[this.past.length - 1].t) {
      if (one.n <= MOST_TRAILS) this.past.push({ t: frame.t, groups: frame.groups.map((g) => ({ q: g.q, centre: g.centre, d: g.d, n: g.n, box: g.box })) });
    }
    const since = frame.t - this.span * TRAIL_SHARE;
    while (this.past.length > 1 && this.past[1].t <= since) this.past.shift();
    this.fresh = true;
    this.repaint();
  }

  aim() {
    this.needsFit = true;
    this.fastest = 0;
    this.repaint();
  }

  repaint() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.paint();
    });
  }

  get dark() { return !this.look.light; }

  size() {
    const box = this.canvas.getBoundingClientRect(), ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [w, h] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) {
      // What was in view stays in view; a view that no hand has moved is fitted anew.
      const before = Math.min(this.canvas.width, this.canvas.height), now = Math.min(w, h);
      if (!this.camera.moved) this.needsFit = true;
      else if (before && now && !this.needsFit) this.camera.scale *= now / before;
      [this.canvas.width, this.canvas.height] = [w, h];
    }
    return { width: box.width, height: box.height, ratio };
  }

  paint() {
    const { width, height, ratio } = this.size(), c = this.context;
    if (!width || !height) return;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.fillStyle = this.dark ? "#0f1720" : "#f7f9fb";
    c.fillRect(0, 0, width, height);
    if (this.frame) {
      const groups = this.frame.groups, each = width / groups.length;
      this.aimed(groups, each, height);
      this.places = [];
      groups.forEach((group, k) => {
        c.save();
        c.translate(k * each, 0);
        c.beginPath();
        c.rect(0, 0, each, height);
        c.clip();
        this.camera.look(group.centre, each, height);
        this.group(group, k, each, height);
        c.restore();
      });
      if (groups.length > 1) {
        c.fillStyle = this.dark ? "#2a3948" : "#c9d2da";
        c.fillRect(each - 0.5, 0, 1, height);
        this.text("first", 64, BELOW_CARDS);
        this.text(`second${this.second ? `: ${this.second}` : ""}`, each + 16, BELOW_CARDS);
      }
      [this.sx, this.sy] = [this.places[0].sx, this.places[0].sy];
      this.camera.look(groups[0].centre, each, height);
      this.widen(each, height);
    }
    shapes(this);
    this.painted++;
    const fresh = this.fresh;
    this.fresh = false;
    this.after(fresh);
  }

  // Fit the view where that is due.
  aimed(groups, each, height) {
    if (!this.needsFit && !this.widens) return;
    const camera = this.camera;
    camera.fit(groups, each, height, TOOLS_WIDTH);
    if (this.needsFit) this.widest = camera.scale / WIDEST;
    else camera.scale = Math.max(camera.scale, this.widest);
    this.needsFit = this.widens = false;
  }

  // A view that follows its runs, and that no hand has moved, widens when agents leave it.
  widen(each, height) {
    const { camera, places } = this, out = ({ sx, sy }) => sx.some((x, i) => x < 0 || x > each || sy[i] < 0 || sy[i] > height);
    if (camera.moved || !camera.follow || this.held || camera.scale <= this.widest || !places.some(out)) return;
    this.widens = true;
    this.repaint();
  }

  // The run that a pixel of the scene shows, and the pixel's place within that run's part.
  part(x) {
    const count = this.frame?.groups.length ?? 1, each = this.canvas.getBoundingClientRect().width / count;
    const run = Math.min(Math.max(Math.floor(x / each), 0), count - 1);
    return { run, x: x - run * each, left: run * each };
  }

  // What a function gives while the camera looks at a run.
  within(run, act) {
    const groups = this.frame.groups, { width, height } = this.size(), each = width / groups.length;
    this.camera.look((groups[run] ?? groups[0]).centre, each, height);
    const found = act(this.camera);
    this.camera.look(groups[0].centre, each, height);
    return found;
  }

  // The point of the world at a pixel of the scene, seen in a run: that of the pixel unless it is named.
  point(x, y, run = this.part(x).run) {
    const each = this.size().width / this.frame.groups.length;
    return this.within(run, (camera) => camera.point(x - run * each, y)).slice(0, this.frame.groups[0].d);
  }

  text(words, x, y, colour) {
    this.context.font = "12px system-ui, sans-serif";
    this.context.fillStyle = colour ?? (this.dark ? "#a9b7c4" : "#56646f");
    this.context.fillText(words, x, y);
  }

  group(group, k, width, height) {
    const c = this.context, d = group.d, n = group.n, cam = this.camera;
    this.grid(width, height);
    const sx = new Float32Array(n), sy = new Float32Array(n), depth = d > 2 ? new Float32Array(n) : null;
    for (let i = 0; i < n; i++) {
      const at = cam.put(group.q[i * d], d > 1 ? group.q[i * d + 1] : 0, d > 2 ? group.q[i * d + 2] : 0);
      sx[i] = at[0];
      sy[i] = at[1];
      if (depth) depth[i] = at[2];
    }
    this.places[k] = { sx, sy };
    edges(this, group);
    this.solids(group);
    if (this.look.links) this.links(group, sx, sy);
    if (this.look.trails && n <= MOST_TRAILS) this.trails(k);
    const values = this.values(group);
    if (n >= MOST_DARTS) {
      this.legend = values;
      density(this, group, sx, sy, values, width, height);
    } else {
      this.agents(group, sx, sy, depth, values);
      wedges(this, group, sx, sy);
    }
    for (let i = 0; i < group.virtual.length; i += 3) {
      const [x, y] = cam.put(group.virtual[i], group.virtual[i + 1], group.virtual[i + 2]);
      c.strokeStyle = "#e09f3e";
      c.strokeRect(x - 3, y - 3, 6, 6);
    }
    this.leaders(group);
    marks(this, group, k, sx, sy);
  }

  grid(width, height) {
    const c = this.context, cam = this.camera;
    if (cam.pitch !== Math.PI / 2 || cam.yaw !== 0) return;
    const unit = 10 ** Math.ceil(Math.log10(60 / cam.scale)), [x0, y1] = cam.point(0, 0), [x1, y0] = cam.point(width, height);
    c.lineWidth = 1;
    c.strokeStyle = this.dark ? "#17222e" : "#e8edf1";
    c.beginPath();
    for (let x = Math.ceil(x0 / unit) * unit; x <= x1; x += unit) {
      const at = Math.round(cam.world([x, 0, 0])[0]) + 0.5;
      c.moveTo(at, 0);
      c.lineTo(at, height);
    }
    for (let y = Math.ceil(y0 / unit) * unit; y <= y1; y += unit) {
      const at = Math.round(cam.world([0, y, 0])[1]) + 0.5;
      c.moveTo(0, at);
      c.lineTo(width, at);
    }
    c.stroke();
  }

  solids(group) {
    const c = this.context, cam = this.camera;
    for (const s of group.solids) {
      if (s.kind !== "obstacle") continue;
      c.fillStyle = "rgba(178,85,90,.85)";
      c.strokeStyle = "#e7a5a8";
      c.lineWidth = 1;
      c.beginPath();
      if (s.outline.length) {
        s.outline.forEach((p, i) => {
          const [x, y] = cam.world(p.map((v, k) => v + s.position[k]));
          if (i) c.lineTo(x, y); else c.moveTo(x, y);
        });
        c.closePath();
      } else {
        const [x, y] = cam.world(s.position);
        c.arc(x, y, s.radius * cam.scale, 0, 7);
      }
      c.fill();
      c.stroke();
    }
  }

  links(group, sx, sy) {
    const c = this.context, count = group.pairs.length / 2;
    if (!count) return;
    const alpha = Math.min(0.5, Math.max(0.07, 0.5 * Math.sqrt(120 / count)));
    c.strokeStyle = this.dark ? `rgba(124,147,171,${alpha})` : `rgba(80,100,120,${alpha})`;
    c.lineWidth = 1;
    c.beginPath();
    const repeats = group.box.some((length) => length !== null);
    for (let k = 0; k < group.pairs.length; k += 2) {
      const [i, j] = [group.pairs[k], group.pairs[k + 1]];
      if (repeats && halves(this, group, i, j, sx, sy)) continue;
      c.moveTo(sx[i], sy[i]);
      c.lineTo(sx[j], sy[j]);
    }
    c.stroke();
  }

  trails(k) {
    const c = this.context, cam = this.camera;
    c.lineWidth = 1.2;
    for (let s = 1; s < this.past.length; s++) {
      const [a, b] = [this.past[s - 1].groups[k], this.past[s].groups[k]];
      if (!a || !b || a.n !== b.n) continue;
      c.strokeStyle = this.dark ? `rgba(120,190,235,${0.6 * (s / this.past.length)})` : `rgba(40,110,190,${0.6 * (s / this.past.length)})`;
      c.beginPath();
      for (let i = 0; i < a.n; i++) {
        if (crossed(a, b, i)) continue;
        const from = cam.world([0, 1, 2].map((x) => (x < a.d ? a.q[i * a.d + x] + a.centre[x] : 0)));
        const to = cam.world([0, 1, 2].map((x) => (x < b.d ? b.q[i * b.d + x] + b.centre[x] : 0)));
        c.moveTo(from[0], from[1]);
        c.lineTo(to[0], to[1]);
      }
      c.stroke();
    }
  }

  // What colours the agents, with the ends of its scale.
  values(group) {
    let kind = this.look.colour;
    if ((kind === "energy" && !group.energy) || (kind === "flock" && (!group.linked || (group.thinned && !group.flocks)))) kind = "speed";
    if (!group.velocities && ["speed", "heading"].includes(kind)) return { kind: "none", values: new Float32Array(group.n), low: 0, high: 0 };
    if (kind === "flock") return { kind, values: flocks(group), low: 0, high: 1 };
    if (kind === "heading") return { kind, values: null, low: 0, high: 1 };
    const values = kind === "energy" ? group.energy : speeds(group);
    let low = Infinity, high = -Infinity;
    for (const x of values) {
      low = Math.min(low, x);
      high = Math.max(high, x);
    }
    if (kind === "speed") {
      // The scale follows the fastest agent, and falls slowly, so that a decrease of speeds is visible.
      this.fastest = Math.max(0.995 * this.fastest, high);
      [low, high] = [0, this.fastest];
    }
    return { kind, values, low, high };
  }

  agents(group, sx, sy, depth, { kind, values, low, high }) {
    const c = this.context, d = group.d, n = group.n, cam = this.camera;
    this.legend = { kind, low, high };
    const { bin, colours } = binned(kind, group, values, low, high, this.dark);
    const size = n <= 60 ? 9 : n <= 400 ? 7 : n <= 2000 ? 5 : 3;
    const order = Array.from(colours, () => []);
    const sorted = depth ? Array.from(depth.keys()).sort((a, b) => depth[b] - depth[a]) : null;
    for (let m = 0; m < n; m++) {
      const i = sorted ? sorted[m] : m;
      order[bin[i]].push(i);
    }
    order.forEach((who, b) => {
      if (!who.length) return;
      c.fillStyle = colours[b];
      c.beginPath();
      for (const i of who) {
        const px = group.p[i * d], py = d > 1 ? group.p[i * d + 1] : 0, pz = d > 2 ? group.p[i * d + 2] : 0;
        const right = cam.cy * px + cam.sy * py, ahead = -cam.sy * px + cam.cy * py;
        const up = cam.sp * ahead + cam.cp * pz, speed = Math.hypot(right, up);
        const ux = speed > 1e-12 ? right / speed : 1, uy = speed > 1e-12 ? -up / speed : 0;
        const x = sx[i], y = sy[i];
        if (!group.velocities) { // nowhere to point
          c.moveTo(x + 0.6 * size, y);
          c.arc(x, y, 0.6 * size, 0, 7);
          continue;
        }
        c.moveTo(x + size * ux, y + size * uy);
        c.lineTo(x - 0.8 * size * ux - 0.55 * size * uy, y - 0.8 * size * uy + 0.55 * size * ux);
        c.lineTo(x - 0.4 * size * ux, y - 0.4 * size * uy);
        c.lineTo(x - 0.8 * size * ux + 0.55 * size * uy, y - 0.8 * size * uy - 0.55 * size * ux);
        c.closePath();
      }
      c.fill();
    });
  }

  leaders(group) {
    const c = this.context, cam = this.camera;
    for (const s of group.solids) {
      if (s.kind !== "leader") continue;
      const [x, y] = cam.world(s.position);
      c.strokeStyle = this.dark ? "#f5d76e" : "#9a7400";
      c.lineWidth = 2;
      c.beginPath();
      c.arc(x, y, 9, 0, 7);
      c.stroke();
      this.text(s.name, x + 14, y + 4, c.strokeStyle);
    }
  }

  // The agent nearest to a pixel, within some pixels, of the run that is seen there; null for none.
  agentAt(x, y, within = 14) {
    const part = this.part(x), place = this.places[part.run];
    if (!place) return null;
    let best = null, least = within * within;
    for (let i = 0; i < place.sx.length; i++) {
      const far = (place.sx[i] - part.x) ** 2 + (place.sy[i] - y) ** 2;
      if (far < least) [best, least] = [i, far];
    }
    return best;
  }

  // The obstacle or leader at a pixel; null for none.
  solidAt(x, y) {
    if (!this.frame) return null;
    const part = this.part(x), { solids } = this.frame.groups[part.run];
    return this.within(part.run, (camera) => {
      for (const s of [...solids].reverse()) {
        if (s.kind === "leader" || !s.outline.length) {
          const [sx, sy] = camera.world(s.position);
          if (Math.hypot(sx - part.x, sy - y) <= Math.max(s.kind === "leader" ? 14 : 0, s.radius * camera.scale)) return s;
          continue;
        }
        const corners = s.outline.map((p) => camera.world(p.map((v, k) => v + s.position[k])));
        if (inside(corners, part.x, y)) return s;
      }
      return null;
    });
  }

  legendHtml() {
    const inks = AXES[this.dark ? "dark" : "light"], names = this.frame?.groups[0].directions ?? [];
    return this.colourHtml() + names.map((name, k) => ` <b style="background:${inks[k % 3]}"></b>${name}`).join("");
  }

  colourHtml() {
    const { kind, low, high } = this.legend ?? { kind: "speed", low: 0, high: 0 };
    if (kind === "flock") return "colour: one for each flock";
    if (kind === "none") return "one colour: these agents have no velocities of their own";
    if (kind === "heading")
      return "colour: heading" + ["right", "up", "left", "down"].map((w, k) => `<b style="background:${css(wheel((k * Math.PI) / 2))}"></b>${w}`).join("");
    return `colour: ${kind} <i style="background:${gradient(this.dark)}"></i>${short(low)} – ${short(high)}`;
  }

  // A length that is a round number, between 50 and 130 pixels.
  scaleBar() {
    const most = 130 / this.camera.scale, ten = 10 ** Math.floor(Math.log10(most));
    const unit = [5, 2, 1].map((k) => k * ten).find((x) => x <= most);
    return { length: unit, pixels: unit * this.camera.scale };
  }
}

export function inside(corners, x, y) {
  let found = false;
  for (let i = 0, j = corners.length - 1; i < corners.length; j = i++) {
    const [xi, yi] = corners[i], [xj, yj] = corners[j];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) found = !found;
  }
  return found;
}
