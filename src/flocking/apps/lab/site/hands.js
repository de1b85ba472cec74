// Hands: what the pointer does in the scene. Choose, drag, add, kick and remove agents and obstacles; move the view.

import { Keys } from "./keys.js";
import { fragment } from "./law.js";
import { short, whenNumber } from "./numbers.js";
import { inside } from "./scene.js";
import { escaped } from "./timeline.js";

const TOOLS = [
  ["view", "Move the view; click chooses an agent, an obstacle or a leader can be dragged", '<path d="M12 3v18M3 12h18M12 3l-3 3M12 3l3 3M12 21l-3-3M12 21l3-3M3 12l3-3M3 12l3 3M21 12l-3-3M21 12l-3 3"/>'],
  ["drag", "Drag an agent to another place; arrow keys move the chosen ones", '<path d="M8 11V6a1.5 1.5 0 0 1 3 0v5M11 10V4.5a1.5 1.5 0 0 1 3 0V10M14 10.5V6a1.5 1.5 0 0 1 3 0v8c0 4-2 7-5.5 7S6.5 19 5 15.5L4 13a1.5 1.5 0 0 1 2.7-1.2L8 14"/>'],
  ["add", "Click to add an agent with the flock's mean velocity", '<path d="M12 5v14M5 12h14"/>'],
  ["lasso", "Draw around agents to choose them", '<ellipse cx="12" cy="10" rx="8" ry="6" stroke-dasharray="3 2.5"/><path d="M8 15c-1 2 0 4-2 5"/>'],
  ["kick", "Drag from an agent: it gets a velocity along the arrow; with agents chosen, all of them; arrow keys kick those", '<path d="M4 17h12M12 12l5 5-5 5M4 9c3-4 6 3 9-1s3-4 6-3"/>'],
  ["obstacle", "Drag to add a round obstacle", '<circle cx="12" cy="12" r="7" fill="currentColor"/>'],
  ["erase", "Click to remove an agent or an obstacle", '<path d="M9 6h11v12H9l-6-6zM12 9.5l5 5M17 9.5l-5 5"/>'],
];
const INKS = ["#ffffff", "#e09f3e", "#7fd1ff", "#ff8fa3", "#b7e36b", "#d6b3ff"];

export class Hands {
  constructor(link, scene) {
    this.link = link;
    this.scene = scene;
    this.tool = "view";
    const at = (id) => document.getElementById(id);
    this.parts = { tools: at("tools"), hover: at("hover"), chosen: at("chosen"), hint: at("hint") };
    this.parts.tools.innerHTML = TOOLS.map(([name, title, icon]) => `<button data-tool="${name}" title="${title}" aria-label="${title}" aria-pressed="${name === "view"}"><svg viewBox="0 0 24 24" aria-hidden="true">${icon}</svg></button>`).join("");
    for (const button of this.parts.tools.children) button.onclick = () => this.take(button.dataset.tool);
    const canvas = scene.canvas;
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    canvas.addEventListener("pointercancel", () => this.cancel());
    canvas.addEventListener("pointerleave", () => this.hover(null));
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      const [x, y] = this.at(e);
      this.zoom(Math.exp(-0.0015 * e.deltaY), x, y);
    }, { passive: false });
    new Keys(this);
    this.fingers = new Map();
  }

  take(tool) {
    this.tool = tool;
    for (const button of this.parts.tools.children) button.setAttribute("aria-pressed", button.dataset.tool === tool);
    this.showHint();
  }

  showHint() {
    const box = this.parts.hint, told = this.scene.gripped?.told;
    box.hidden = this.tool === "view" && !told;
    box.textContent = told ?? TOOLS.find(([name]) => name === this.tool)[1];
    if (this.tool !== "lasso" || told) return;
    box.append(fragment('<br><label>or by number <input aria-label="agents" placeholder="3, 5-8"></label> <button>a random tenth</button>'));
    const field = box.querySelector("input");
    field.onchange = () => {
      const found = agentsOf(field.value, this.group.n);
      field.setCustomValidity(found ? "" : "numbers such as 3, 5-8");
      if (found) this.choose(found); else field.reportValidity();
    };
    box.querySelector("button").onclick = () => {
      const every = [...Array(this.group.n).keys()].map((i) => [Math.random(), i]).sort((a, b) => a[0] - b[0]);
      this.choose(every.slice(0, Math.max(1, Math.round(this.group.n / 10))).map(([, i]) => i));
    };
  }

  get group() { return this.scene.frame?.groups[0]; }

  zoom(factor, x, y) {
    const part = this.scene.part(x);
    if (this.scene.frame) this.scene.within(part.run, (camera) => camera.zoom(factor, part.x, y));
    this.scene.repaint();
  }

  get dimension() { return this.group?.d ?? 2; }

  at(event) {
    const box = this.scene.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  // The point of the world at a pixel; a hand that has begun in the part of a run stays in it.
  point(x, y) { return this.scene.point(x, y, this.held?.run); }

  down(event) {
    const [x, y] = this.at(event);
    this.scene.canvas.setPointerCapture(event.pointerId);
    this.fingers.set(event.pointerId, [x, y]);
    if (!this.group) return;
    if (this.fingers.size > 1) {
      this.held = { kind: "pinch", far: this.spread() };
      return;
    }
    const agent = this.scene.agentAt(x, y), solid = this.scene.solidAt(x, y), from = [x, y];
    const { run, left } = this.scene.part(x);
    this.held = { kind: "pan", from, last: from, agent, run, left, button: event.button, moved: false };
    this.scene.held = true;
    if (this.tool === "view" && solid && solid.path.length && agent === null) {
      const [sx, sy] = this.scene.within(run, (camera) => camera.world(solid.position));
      this.held = { ...this.held, kind: "solid", solid, offset: [sx + left - x, sy - y] };
    } else if (this.tool === "drag" && agent !== null) this.held.kind = "agent";
    else if (this.tool === "lasso") {
      this.held.kind = "lasso";
      this.scene.lasso = [from];
    } else if (this.tool === "kick" && (agent !== null || this.scene.chosen.size)) this.held.kind = "kick";
    else if (this.tool === "obstacle") this.held.kind = "obstacle";
    else if (this.tool === "add" || this.tool === "erase") this.held.kind = "click";
  }

  spread() {
    const [a, b] = [...this.fingers.values()];
    return Math.hypot(a[0] - b[0], a[1] - b[1]);
  }

  move(event) {
    const [x, y] = this.at(event), h = this.held, scene = this.scene;
    if (this.fingers.has(event.pointerId)) this.fingers.set(event.pointerId, [x, y]);
    if (!h) {
      this.hover([x, y]);
      return;
    }
    if (h.kind === "pinch") {
      if (this.fingers.size > 1) {
        const far = this.spread(), [a, b] = [...this.fingers.values()];
        this.zoom(far / h.far, (a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
        h.far = far;
      }
      return;
    }
    h.moved ||= Math.hypot(x - h.from[0], y - h.from[1]) > 4;
    if (!h.moved) return;
    const [dx, dy] = [x - h.last[0], y - h.last[1]];
    h.last = [x, y];
    if (h.kind === "pan") {
      if (this.dimension > 2 && h.button === 0 && !event.shiftKey) scene.camera.turn(dx, dy);
      else scene.camera.pan(dx, dy);
    } else if (h.kind === "solid") {
      this.link.send("move", { path: h.solid.path, to: this.point(x + h.offset[0], y + h.offset[1]) });
    } else if (h.kind === "lasso") scene.lasso.push([x, y]);
    else if (h.kind === "kick" || h.kind === "agent") scene.drawing = { kind: "line", from: this.origin(h), to: [x, y] };
    else if (h.kind === "obstacle") scene.drawing = { kind: "obstacle", from: h.from, to: [x, y] };
    scene.repaint();
  }

  origin(h) {
    const place = this.scene.places[h.run] ?? this.scene.places[0]; // a second run may have gone meanwhile
    return h.agent === null ? h.from : [place.sx[h.agent] + h.left, place.sy[h.agent]];
  }

  up(event) {
    const h = this.held, scene = this.scene, [x, y] = this.at(event);
    this.fingers.delete(event.pointerId);
    if (this.fingers.size) return;
    scene.drawing = null;
    scene.held = false;
    if (!h) return;
    this.done(h, x, y, event.shiftKey);
    this.held = null;
    scene.repaint();
  }

  done(h, x, y, more) {
    const scene = this.scene, clicked = !h.moved;
    if (h.kind === "lasso") {
      const { sx, sy } = scene.places[h.run] ?? scene.places[0];
      const found = clicked ? [] : [...sx.keys()].filter((i) => inside(scene.lasso, sx[i] + h.left, sy[i]));
      scene.lasso = null;
      this.choose(more ? [...scene.chosen, ...found] : found, h.run);
    } else if (h.kind === "agent" && h.moved) this.event({ kind: "place", agent: h.agent, to: this.point(x, y) });
    else if (h.kind === "kick" && h.moved) {
      const a = this.point(...this.origin(h)), b = this.point(x, y);
      const agents = scene.chosen.size ? [...scene.chosen] : [h.agent];
      this.event({ kind: "kick", agents, velocity: b.map((v, k) => v - a[k]) });
    } else if (h.kind === "obstacle") {
      const centre = this.point(...h.from), edge = this.point(x, y);
      const radius = clicked ? 20 / scene.camera.scale : Math.hypot(...edge.map((v, k) => v - centre[k]));
      this.event({ kind: "obstacle", centre, radius });
    } else if (h.kind === "click" && clicked && this.tool === "add") {
      this.event({ kind: "add", q: this.point(x, y), p: this.meanVelocity() });
    } else if (h.kind === "click" && clicked) {
      const solid = scene.solidAt(x, y);
      if (h.agent !== null) this.event({ kind: "kill", agents: [h.agent] });
      else if (solid?.kind === "obstacle") this.event({ kind: "remove", path: solid.of });
    } else if (h.kind === "pan" && clicked) {
      if (h.agent === null) this.choose([]);
      else if (scene.chosen.has(h.agent)) this.choose([...scene.chosen].filter((i) => i !== h.agent), h.run);
      else this.choose([...scene.chosen, h.agent], h.run);
    }
  }

  cancel() {
    this.held = this.scene.lasso = this.scene.drawing = null;
    this.scene.held = false;
    this.fingers.clear();
    this.scene.repaint();
  }

  meanVelocity() {
    const { p, n, d } = this.group, sum = new Array(d).fill(0);
    for (let i = 0; i < n * d; i++) sum[i % d] += p[i];
    return sum.map((x) => x / n);
  }

  async event(event) {
    if (event.kind === "kill") this.choose([]);
    try {
      await this.link.ask("event", { event });
    } catch { /* the refusal is shown */ }
  }

  // Choose agents; of one the forces in a run are shown.
  choose(agents, run = 0) {
    this.run = run;
    this.scene.chosen = new Set([...agents].sort((a, b) => a - b));
    this.scene.forces = null;
    this.asked = null;
    this.showChosen();
    this.scene.repaint();
    if (this.scene.frame) this.frame(this.scene.frame);
  }

  showChosen() {
    const box = this.parts.chosen, agents = [...this.scene.chosen];
    box.hidden = !agents.length;
    if (!agents.length) return;
    const names = agents.length > 12 ? `${agents.slice(0, 12).join(", ")} and ${agents.length - 12} more` : agents.join(", ");
    const where = (this.scene.frame?.groups.length ?? 1) > 1 && agents.length === 1 ? `, ${this.run ? "second" : "first"} run` : "";
    box.innerHTML = `<b>agent${agents.length > 1 ? "s" : ""} ${names}${where}</b><div data-forces></div>
      <label>kick by <input type="number" step="any" min="0" value="${this.speed ?? 1}" aria-label="Kick speed" style="width:5em"></label>
      <button data-do="kick">kick</button><button data-do="kill">remove</button><button data-do="cut">cut links</button><button data-do="clear">clear</button>`;
    const speed = box.querySelector("input");
    const holds = whenNumber(speed, (value) => holds((this.speed = value)));
    const act = {
      kick: () => this.event({ kind: "kick", agents, speed: Number(speed.value), seed: Math.floor(Math.random() * 1e6) }),
      kill: () => this.event({ kind: "kill", agents }),
      cut: () => this.event({ kind: "cut", agents }), // all links that they have then, drawn or not
      clear: () => this.choose([]),
    };
    for (const button of box.querySelectorAll("button")) button.onclick = act[button.dataset.do];
    this.showForces();
  }

  // A frame was painted: of one chosen agent the forces are asked for, a few times a second. There is none before the first one has come.
  async frame(frame) {
    if (!frame) return;
    if (!frame.live && this.scene.forces) this.forget();
    if (this.scene.chosen.size !== 1 || !frame.live || this.asking) return;
    const [agent] = this.scene.chosen, run = frame.groups[this.run] ? this.run : 0, asked = `${run} ${agent} ${frame.t} ${frame.version}`;
    if (this.asked === asked || performance.now() - (this.askedAt ?? 0) < 200) return;
    this.asking = true;
    this.asked = asked;
    this.askedAt = performance.now();
    try {
      const found = await this.link.ask("agent", { agent, run }, true);
      if (this.scene.frame.live && this.scene.chosen.size === 1 && this.scene.chosen.has(agent) && this.run === run) {
        this.scene.forces = { run, agent, list: found.forces.map((f, k) => ({ ...f, colour: INKS[k % INKS.length] })), found };
        this.showForces();
        this.scene.repaint();
      }
    } catch { this.scene.forces = null; }
    this.asking = false;
  }

  // Forces are those of the present: beside a recorded moment none are shown.
  forget() {
    this.scene.forces = this.asked = null;
    const box = this.parts.chosen.querySelector("[data-forces]");
    if (box) box.textContent = "";
    this.scene.repaint();
  }

  showForces() {
    const box = this.parts.chosen.querySelector("[data-forces]"), forces = this.scene.forces;
    if (!box || !forces) return;
    const { found } = forces, count = found.neighbours.length;
    const speed = found.speed === null ? "" : `speed ${short(found.speed)} · `, world = found.world ? `<br>the law on the true present state; others act: ${escaped(found.world)}` : "";
    box.innerHTML = `${speed}${count} neighbour${count === 1 ? "" : "s"}<br>` + forces.list
      .map((f) => `<span class="bar" style="background:${f.colour}"></span>${escaped(f.term)} ${short(Math.hypot(...f.force))}`).join(" &nbsp; ") + world;
  }

  hover(place) {
    const scene = this.scene, agent = place ? scene.agentAt(...place) : null, box = this.parts.hover;
    const run = agent === null ? 0 : scene.part(place[0]).run, before = scene.hovered;
    scene.hovered = agent === null ? null : { run, agent };
    if (before?.agent !== scene.hovered?.agent || before?.run !== scene.hovered?.run) scene.repaint();
    box.hidden = agent === null;
    if (agent === null) return;
    const groups = scene.frame.groups, { p, d, neighbours, velocities } = groups[run], count = neighbours?.[agent];
    const speed = velocities ? ` · speed ${short(Math.hypot(...p.subarray(agent * d, agent * d + d)))}` : "";
    box.style.left = `${place[0]}px`;
    box.style.top = `${place[1]}px`;
    const which = groups.length > 1 ? `, ${run ? "second" : "first"} run` : "";
    const links = neighbours ? ` · ${count} neighbour${count === 1 ? "" : "s"}` : "";
    box.textContent = `agent ${agent}${which}${speed}${links}${scene.frame.live ? "\nclick for its forces" : ""}`;
    // It stays within the scene.
    const room = scene.size(), { offsetWidth, offsetHeight } = box;
    if (place[0] + 28 + offsetWidth > room.width) box.style.left = `${Math.max(place[0] - offsetWidth - 28, 0)}px`;
    if (place[1] + 28 + offsetHeight > room.height) box.style.top = `${Math.max(place[1] - offsetHeight - 28, 0)}px`;
  }
}

// Numbers of agents in a text such as "3, 5-8"; null where it has another form.
export function agentsOf(text, n) {
  const found = new Set();
  for (const word of text.replaceAll(",", " ").split(/\s+/).filter(Boolean)) {
    const parts = word.match(/^(\d{1,7})(?:-(\d{1,7}))?$/);
    if (!parts) return null;
    for (let i = Number(parts[1]); i <= Math.min(Number(parts[2] ?? parts[1]), n - 1); i++) if (i < n) found.add(i);
  }
  return [...found].sort((a, b) => a - b);
}
