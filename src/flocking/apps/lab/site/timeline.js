// The timeline: play and scrub, a strip for every claim, and the curves that share its axis.

import { short, timeText, whenNumber } from "./numbers.js";

const NAMES = { energy: "energy", departed: "departed energy", "velocity spread": "velocity spread", connectivity: "connectivity" };
const ROUNDING = 1e-9; // of recorded times, as a share of the axis
// Shapes of lamps: they differ without their colours, too.
const SHAPES = {
  "holds": '<circle cx="5" cy="5" r="4.5"/>',
  "fails": '<path d="M5 .5 9.7 9.5H.3z"/>',
  "hypothesis not met": '<rect x=".8" y=".8" width="8.4" height="8.4" rx="1"/>',
  "known to fail": '<path d="M5 9.5.3.5h9.4z"/>',
  "not yet": '<circle cx="5" cy="5" r="3.6"/>',
  "not resolved": '<path d="M5 1 9 5 5 9 1 5z"/>',
};
// What the lamps and strips mean, in the order of a legend.
const WORDS = ["holds", "fails", "hypothesis not met", "not yet", "not resolved", "known to fail"];
export const styleClass = (style) => `s-${style.replaceAll(" ", "-")}`;
export const lamp = (style) => `<svg class="lamp ${styleClass(style)}" viewBox="0 0 10 10" aria-hidden="true">${SHAPES[style] ?? SHAPES["not resolved"]}</svg>`;

export class Timeline {
  constructor(link, scene, choose) {
    this.link = link;
    this.choose = choose;
    this.scene = scene;
    this.record = null;
    this.looking = null; // the time of the record that is shown; null for the present
    this.opened = null; // the claim that is explained
    this.now = 0;
    this.first = 0;
    this.end = 1;
    this.stored = null;
    this.again = false; // whether the lab has yet to hear, after a lost connection, what this page looks at
    const at = (id) => document.getElementById(id);
    this.parts = Object.fromEntries(["play", "clock", "scrub", "ticks", "live", "branch", "strips", "curves", "cursor", "speed", "step", "time"].map((id) => [id, at(id)]));
    const p = this.parts;
    p.play.onclick = () => this.toggle();
    p.scrub.oninput = () => this.look(Number(p.scrub.value));
    p.live.onclick = () => this.look(null);
    p.branch.onclick = () => this.branchHere();
    p.step.onclick = () => this.link.send("step", { duration: (this.end - this.first) / 100 });
    at("restart").onclick = () => this.link.send("restart");
    at("reset").onclick = () => this.link.send("reset");
    this.showSpeed = whenNumber(p.speed, (speed) => this.link.send("speed", { speed }));
    for (const area of [p.strips, p.curves]) {
      area.addEventListener("pointerdown", (event) => this.press(event, area));
      area.addEventListener("pointermove", (event) => event.buttons && this.held && this.seek(event));
      area.addEventListener("pointerup", () => (this.held = false));
    }
    new ResizeObserver(() => {
      this.drawCurves();
      this.place();
    }).observe(p.curves);
    p.strips.addEventListener("scroll", () => this.place());
  }

  scenario(message) {
    this.challenges = message.challenges;
    this.first = message.start;
    this.end = message.end;
    this.showSpeed(message.speed);
    this.opened = null;
    this.stored = null;
  }

  toggle() {
    if (this.looking !== null && !this.stored) this.look(null);
    this.link.send(this.record?.running ? "pause" : "play");
  }

  press(event, area) {
    const strip = event.target.closest(".strip, canvas");
    if (!strip) return;
    this.axis = strip;
    this.held = true;
    area.setPointerCapture?.(event.pointerId);
    this.seek(event);
  }

  seek(event) {
    const box = this.axis.getBoundingClientRect();
    const share = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    this.look(this.first + share * (this.span()));
  }

  span() { return Math.max(this.last() - this.first, 1e-12); }
  last() { return Math.max(this.end, this.now); }

  // Look at the record at a time; times beyond the present are the present.
  look(t) {
    if (this.stored) {
      this.looking = t ?? this.last();
      this.link.send("look", { t: this.looking });
    } else {
      this.looking = t !== null && t < this.now ? Math.max(t, this.first) : null;
      this.link.send("look", { t: this.looking });
    }
    this.place();
  }

  async branchHere() {
    const t = this.looking;
    if (t === null) return;
    try {
      await this.link.ask("branch", { t });
      this.looking = null;
      this.place();
    } catch { /* the refusal is shown */ }
  }

  showStored(message) {
    this.stored = message;
    this.first = message.t[0];
    this.end = this.now = message.t[message.t.length - 1];
    this.looking = this.first;
    this.record = { claims: [], numbers: [], record: { times: message.times, curves: [{ energy: message.energy }], events: [], strips: {} } };
    this.link.send("look", { t: this.looking });
    this.draw();
  }

  take(record) {
    if (this.stored) return;
    this.record = record;
    this.now = record.now;
    this.end = record.end;
    this.first = Math.min(this.first, record.record.times[0] ?? this.first);
    if (this.looking !== null && this.looking > this.now) this.looking = null;
    if (this.again && this.looking !== null) this.link.send("look", { t: this.looking });
    this.again = false;
    this.draw();
  }

  // The time of a frame: of the present, or of the recorded moment that is shown, which is the last up to the one asked
  // for. What is said of it, and what a run branches from, is what is seen.
  frame(frame) {
    if (frame.live && !this.stored) this.now = frame.t;
    else if (!frame.live && this.looking !== null) this.looking = frame.t;
    this.place();
  }

  draw() {
    const p = this.parts, r = this.record, running = r.running;
    p.play.textContent = running ? "❚❚" : "▶";
    p.play.setAttribute("aria-label", running ? "Pause" : "Play");
    p.ticks.innerHTML = r.record.events.map(([t, kind]) => `<i style="left:${this.percent(t)}%" title="${kind} at t = ${this.when(t)}"></i>`).join("");
    this.drawStrips();
    this.drawCurves();
    this.place();
  }

  when(t) { return timeText(t, this.first, this.last()); }

  percent(t) { return (100 * (t - this.first)) / this.span(); }

  place() {
    const p = this.parts, t = this.looking ?? this.now;
    p.scrub.min = this.first;
    p.scrub.max = this.last();
    if (document.activeElement !== p.scrub || !p.scrub.matches(":active")) p.scrub.value = t;
    p.clock.textContent = `t = ${this.when(t)}`;
    p.live.hidden = this.looking === null || Boolean(this.stored);
    p.branch.hidden = this.looking === null || Boolean(this.stored);
    const axis = p.curves.querySelector("canvas") ?? p.strips.querySelector(".strip");
    p.cursor.hidden = !axis;
    if (axis) {
      const box = axis.getBoundingClientRect(), here = p.time.getBoundingClientRect();
      p.cursor.style.left = `${box.left - here.left + (box.width * this.percent(t)) / 100}px`;
      // Through all strips, or through the curves alone while there is none.
      p.cursor.style.top = `${(p.strips.querySelector(".strip") ? p.strips : p.curves).getBoundingClientRect().top - here.top}px`;
    }
    this.values();
  }

  drawStrips() {
    const r = this.record, rows = [], groups = new Map();
    for (const claim of r.claims) {
      if (!groups.has(claim.source)) groups.set(claim.source, []);
      groups.get(claim.source).push(claim);
    }
    for (const [source, claims] of groups) {
      rows.push(`<p class="source">${escaped(source)}</p>`, ...claims.map((claim) => this.strip(claim)));
    }
    if (!rows.length) {
      const why = this.stored ? "Claims are judged while a run goes on: 'flocking audit' judges a stored run."
        : r.too_many ? `Claims are judged for up to ${r.too_many} agents.` : r.fault || (this.now <= this.first ? "Claims appear here when the run has begun: press play."
          : r.few ? "Claims are judged from three measured moments on: step again, or press play." : "Judging the motion since the last intervention …");
      rows.push(`<p class="empty">${escaped(why)}</p>`);
      if (!this.stored && this.now <= this.first && this.challenges?.length) {
        rows.push(`<p class="empty offers">Or try a challenge: ${this.challenges.map((c) => `<button class="small" data-challenge="${escaped(c.key)}" title="${escaped(c.goal)}">${escaped(c.title)}</button>`).join(" ")}</p>`);
      }
    } else {
      // A history that has dropped its first switches begins later than the intervention.
      const late = !r.former && r.since > r.changed ? "; what came before it since the last intervention counts where a claim failed in it" : "";
      const which = r.numbers.length > 1 ? " of the first run" : "";
      rows.unshift(`<p class="empty" style="padding:2px 0">Judged by the motion${which} from t = ${this.when(r.since)} to t = ${this.when(r.record.judged)}, ${r.former ? "before the last intervention; what follows it is judged as time goes on" : "since the last intervention"}${late}.</p>${this.legend()}`);
    }
    const html = rows.join("");
    if (html === this.shownStrips) return;
    this.shownStrips = html;
    const focused = document.activeElement?.dataset?.claim;
    this.parts.strips.innerHTML = html;
    for (const button of this.parts.strips.querySelectorAll("button[data-claim]")) {
      button.onclick = () => this.explain(button.dataset.claim);
      if (button.dataset.claim === focused) button.focus();
    }
    for (const button of this.parts.strips.querySelectorAll("[data-challenge]")) {
      button.onclick = () => this.link.send("load", { name: `challenge: ${button.dataset.challenge}` });
    }
  }

  // Lamp, pattern and word of each state that the claims are in or were in.
  legend() {
    const r = this.record, seen = new Set([...r.claims.map((c) => c.style), ...Object.values(r.record.strips).flat().map(([, word]) => word)]);
    return `<p class="key">${WORDS.filter((w) => seen.has(w)).map((w) => `<span>${lamp(w)}<i class="${styleClass(w)}"></i>${w}</span>`).join("")}</p>`;
  }

  strip(claim) {
    const segments = this.record.record.strips[claim.key] ?? [], judged = this.record.record.judged ?? this.now;
    const bars = segments.map(([from, word], k) => {
      const to = k + 1 < segments.length ? segments[k + 1][0] : Math.max(judged, from);
      return `<i class="${styleClass(word)}" title="${word}" style="left:${this.percent(from)}%;width:${Math.max(this.percent(to) - this.percent(from), 0.25)}%"></i>`;
    });
    const open = this.opened === claim.key;
    const row = `<div class="line"><button data-claim="${claim.key}" aria-expanded="${open}" title="${escaped(claim.source)}: ${escaped(claim.lamp)}">${lamp(claim.style)}<span class="text">${claim.sentence}</span><span hidden>${claim.key}: ${escaped(claim.lamp)}</span>${marginBar(claim)}</button><div class="strip">${bars.join("")}</div>`;
    return `${row}${open ? `<div class="explain">${this.explanation(claim)}</div>` : ""}</div>`;
  }

  explanation(claim) {
    const hypothesis = claim.word === "hypothesis not met" ? "Its hypothesis is not met: " : "";
    const who = claim.agents.length ? `, agent${claim.agents.length > 1 ? "s" : ""} ${claim.agents.slice(0, 12).join(", ")}${claim.agents.length > 12 ? " and more" : ""}` : "";
    const when = claim.time === null ? "" : ` At t = ${this.when(claim.time)}${who}.`;
    const sure = claim.guarantee ? ` Guaranteed from t = ${this.when(this.record.since)} on, by the state then: ${escaped(claim.guarantee)}` : "";
    const known = claim.reason && claim.style === "known to fail" ? ` ${escaped(claim.reason)}` : "";
    return `<b>${escaped(claim.lamp)}</b> · ${claim.sentence} ${hypothesis}${escaped(claim.note)}.${when}${sure}${known}`;
  }

  explain(key) {
    this.opened = this.opened === key ? null : key;
    const claim = this.record.claims.find((c) => c.key === this.opened);
    this.choose(claim ? claim.agents : []);
    this.drawStrips();
  }

  // Points of a curve as they are drawn: times and values of each run.
  points(name) {
    const { times, curves } = this.record?.record ?? { times: [], curves: [] };
    return curves.map((run) => times.map((t, k) => [t, run[name]?.[k] ?? null]).filter(([, y]) => y !== null));
  }

  shownCurves() {
    return Object.keys(NAMES).filter((name) => {
      const every = this.points(name).flat();
      return every.length && (name !== "departed" || every.some(([, y]) => y !== 0));
    });
  }

  drawCurves() {
    if (!this.record) return;
    const names = this.shownCurves(), area = this.parts.curves;
    if (area.dataset.names !== names.join()) {
      area.dataset.names = names.join();
      area.innerHTML = names.map((name) => `<div class="line"><span class="name"><span class="text">${NAMES[name]}</span><span class="value" data-value="${name}"></span></span><canvas data-curve="${name}" role="img" aria-label="${NAMES[name]} over time"></canvas></div>`).join("");
    }
    const style = getComputedStyle(document.documentElement), inks = ["--accent", "--open"].map((x) => style.getPropertyValue(x));
    for (const canvas of area.querySelectorAll("canvas")) {
      const box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1, c = canvas.getContext("2d");
      if (!box.width) continue;
      [canvas.width, canvas.height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      const runs = this.points(canvas.dataset.curve), every = runs.flat().map(([, y]) => y);
      let low = Infinity, high = -Infinity;
      for (const y of every) [low, high] = [Math.min(low, y), Math.max(high, y)];
      const room = high > low ? high - low : Math.max(Math.abs(high), 1e-12);
      [...runs.entries()].reverse().forEach(([k, points]) => {
        c.strokeStyle = inks[Math.min(k, 1)];
        c.lineWidth = 1.6;
        c.beginPath();
        points.forEach(([t, y], m) => {
          const x = (box.width * this.percent(t)) / 100, at = high > low ? box.height - 3 - ((box.height - 6) * (y - low)) / room : box.height / 2;
          if (m) c.lineTo(x, at); else c.moveTo(x, at);
        });
        c.stroke();
      });
      canvas.title = every.length ? `${NAMES[canvas.dataset.curve]}: ${short(low)} to ${short(high)}` : "";
    }
    this.values();
  }

  values() {
    const t = (this.looking ?? this.now) + ROUNDING * this.span();
    for (const cell of this.parts.curves.querySelectorAll("[data-value]")) {
      const found = this.points(cell.dataset.value).map((points) => {
        let value = null;
        for (const [at, y] of points) {
          if (at > t && value !== null) break;
          value = y;
        }
        return short(value);
      });
      cell.textContent = found.join(" | ");
    }
  }
}

function marginBar(claim) {
  if (claim.margin === null || !claim.largest) return "";
  const share = Math.min(Math.abs(claim.margin) / claim.largest, 1) * 50, left = claim.margin < 0 ? 50 - share : 50;
  return `<span class="margin" title="margin ${short(claim.margin)}"><i style="left:${left}%;width:${share}%"></i></span>`;
}

export function escaped(text) {
  return String(text).replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;").replaceAll('"', "&quot;");
}
