// The law beside its picture: the formula, the potentials with their curves, and a control for every parameter.

import { pairDistances } from "./frames.js";
import { short, timeText, whenNumber } from "./numbers.js";
import { escaped } from "./timeline.js";

const BINS = 40;
const SMALLEST = 11; // pixels of an equation's letters
const key = (path) => JSON.stringify(path);

export class LawPanel {
  constructor(link, area) {
    this.link = link;
    this.area = area;
    this.controls = new Map();
    this.plots = [];
    this.numbers = document.createElement("dl");
    this.numbers.className = "numbers";
    this.counted = 0;
    new ResizeObserver(() => {
      this.fitFormula();
      this.drawPlots();
    }).observe(area);
  }

  scenario(message) {
    if (message.name !== this.name) this.area.scrollTop = 0;
    this.beside(false);
    this.when = (t) => timeText(t, message.start, Math.max(message.end, t));
    this.name = message.name;
    this.terms = message.terms;
    this.engine = `${message.engine} engine`;
  }

  // Beside a stored run the law stays that of the live one.
  beside(stored) {
    this.stored = stored;
    if (stored) this.group = null;
    const note = this.area.querySelector("[data-live]");
    if (note) note.hidden = !stored;
    this.drawPlots();
  }

  build(law) {
    const typing = document.activeElement?.closest?.(".pot")?.dataset.path;
    this.law = law;
    this.controls.clear();
    this.plots = [];
    this.area.replaceChildren();
    this.area.append(fragment(`<p class="fault" data-live ${this.stored ? "" : "hidden"}>Of the live run, not of the stored one that is shown:</p><h2>The law <button class="small" data-large hidden>show it large</button></h2>${law.formula}<details><summary>What the symbols mean</summary>${law.legend}</details>`));
    const rest = law.sections.map((s) => ({ ...s, settings: [...s.settings] }));
    for (const potential of law.potentials) {
      const own = [];
      for (const section of rest) {
        own.push(...section.settings.filter((s) => starts(s.path, potential.path)));
        section.settings = section.settings.filter((s) => !starts(s.path, potential.path));
      }
      this.area.append(this.potential(potential, own));
    }
    for (const section of rest) if (section.settings.length || section.removal) this.area.append(this.section(section));
    this.area.append(this.adding(), fragment("<h3>Numbers</h3>"), this.numbers);
    this.area.querySelector("[data-large]").onclick = () => this.enlarge(law.formula);
    this.fitFormula();
    if (typing) this.area.querySelector(`.pot[data-path='${typing}'] textarea`)?.focus();
    this.drawPlots();
    this.check();
  }

  // A long equation is set smaller, down to what can be read; beyond that it scrolls.
  fitFormula() {
    const box = this.area.querySelector(".formula");
    if (!box?.clientWidth) return;
    box.style.fontSize = "";
    const size = parseFloat(getComputedStyle(box).fontSize), room = box.clientWidth - 24;
    const wide = Math.max(...[...box.querySelectorAll("math")].map((m) => m.getBoundingClientRect().width), box.scrollWidth - 24);
    if (wide > room) box.style.fontSize = `${Math.max((size * room) / wide, SMALLEST)}px`;
    this.area.querySelector("[data-large]").hidden = (size * room) / wide >= SMALLEST;
  }

  potential(potential, settings) {
    const box = document.createElement("div");
    box.className = "pot";
    box.dataset.path = key(potential.path);
    const many = this.law.potentials.length > 1 ? ` of term ${potential.path[2] + 1}` : "";
    box.append(fragment(`<h3>Potential <var>ψ(r)</var>${many}</h3>
      <canvas role="img" aria-label="The potential, the force, and how often each distance occurs"></canvas>
      <div class="keys"><span><i style="color:var(--accent)"></i>ψ(r)</span><span><i style="color:var(--force);border-top-style:dashed"></i>force ψ′(r)</span><span>${potential.pairs ? "bars: distances of pairs" : "r: distance from an obstacle"}</span></div>
      <textarea aria-label="Formula of the potential" spellcheck="false"></textarea>
      <p class="fault" role="alert" hidden></p><button class="small" disabled>use this formula</button><ul class="checks"></ul><details class="reasons" hidden><summary>reasons and margins</summary><dl></dl></details>`));
    const [canvas, field, fault, use, checks, reasons] = ["canvas", "textarea", ".fault", ".small", ".checks", ".reasons"].map((s) => box.querySelector(s));
    field.value = potential.formula;
    const plot = { potential, canvas, curves: potential.curves, reach: potential.reach, checks, reasons, field, fault, use, number: 0 };
    this.plots.push(plot);
    field.oninput = () => this.typed(plot);
    field.onkeydown = (event) => {
      if (event.key === "Enter" && (event.ctrlKey || event.metaKey) && !use.disabled) use.click();
    };
    use.onclick = () => this.link.send("set", { path: [...potential.path, "formula"], value: field.value });
    for (const setting of settings) if (setting.kind !== "formula") box.append(this.control(setting));
    return box;
  }

  // Redraw the curves of what is typed; the law changes when it is used.
  typed(plot) {
    const number = ++plot.number, same = plot.field.value === plot.potential.formula;
    clearTimeout(plot.wait);
    plot.use.disabled = true;
    plot.wait = setTimeout(async () => {
      try {
        const found = await this.link.ask("try", { path: plot.potential.path, text: plot.field.value }, true);
        if (number !== plot.number) return;
        [plot.curves, plot.reach] = [found.curves, found.reach];
        plot.fault.hidden = true;
        plot.use.disabled = same;
        this.drawPlots();
      } catch (reason) {
        if (number !== plot.number) return;
        plot.fault.textContent = String(reason);
        plot.fault.hidden = false;
      }
    }, 150);
  }

  section(section) {
    const box = document.createElement("div");
    box.append(fragment(`<h3><span>${escaped(section.title)}</span></h3>`));
    if (section.removal) {
      const button = fragment('<button class="small">remove</button>').firstChild;
      button.setAttribute("aria-label", `Remove ${section.title}`);
      button.onclick = () => this.link.send("event", { event: section.removal });
      box.querySelector("h3").append(button);
    }
    const fold = section.settings.length > 10 ? document.createElement("details") : box;
    if (fold !== box) {
      fold.append(fragment(`<summary>${section.settings.length} values</summary>`));
      box.append(fold);
    }
    for (const setting of section.settings) fold.append(this.control(setting));
    return box;
  }

  control(setting) {
    const row = document.createElement("label");
    row.className = "row";
    row.append(fragment(`<span>${escaped(setting.label)}</span>`));
    const send = (value) => this.link.send("set", { path: setting.path, value, factor: setting.kind === "factor" });
    let show;
    if (setting.kind === "flag" || setting.kind === "choice") {
      const field = document.createElement(setting.kind === "flag" ? "input" : "select");
      if (setting.kind === "flag") field.type = "checkbox";
      else field.append(...setting.choices.map((c) => new Option(c, c)));
      show = (value) => (setting.kind === "flag" ? (field.checked = value) : (field.value = value));
      field.onchange = () => send(setting.kind === "flag" ? field.checked : field.value);
      row.append(field);
    } else if (setting.kind === "formula") {
      const field = document.createElement("input");
      show = (value) => (field.value = value);
      field.onchange = () => send(field.value);
      field.style.gridColumn = "2 / 4";
      row.append(field);
    } else {
      show = this.slider(row, setting, send);
    }
    show(setting.value);
    this.controls.set(key(setting.path), show);
    return row;
  }

  // A slider, whose ends move away when it is let go there, and a field that takes any number.
  slider(row, setting, send) {
    const field = fragment('<input type="number" step="any">').firstChild;
    if (setting.kind === "count") {
      field.step = 1;
      row.append(document.createElement("span"), field);
      return whenNumber(field, (value) => send(Math.round(value)));
    }
    const range = fragment('<input type="range">').firstChild;
    range.setAttribute("aria-label", `${setting.label}, slider`);
    Object.assign(range, { min: setting.low, max: setting.high, step: setting.step });
    const widen = (value) => {
      if (value >= Number(range.max)) range.max = Math.max(2 * Math.abs(value), Number(range.max));
      if (value <= Number(range.min) && Number(range.min) < 0) range.min = -2 * Math.abs(value);
      if (value < Number(range.min)) range.min = value;
    };
    // A value that comes back while the slider is moved, by keys too, is that of an earlier move: it is shown only after.
    let held = null, moving = 0;
    const typed = whenNumber(field, send);
    const show = (value) => {
      held = value;
      if (moving || range.matches(":active")) return;
      if (value > Number(range.max) || value < Number(range.min)) widen(value);
      range.value = value;
      typed(Number(value.toPrecision(6)));
    };
    const moved = () => {
      clearTimeout(moving);
      moving = setTimeout(() => {
        moving = 0;
        if (held !== null) show(held);
      }, 1000);
    };
    range.oninput = () => {
      field.value = short(Number(range.value));
      send(Number(range.value));
      moved();
    };
    range.onchange = () => {
      widen(Number(range.value));
      moved();
    };
    row.append(range, field);
    return show;
  }

  adding() {
    const box = document.createElement("div");
    box.append(fragment('<h3>Another term</h3><div class="row adding"><select aria-label="Term to add"></select><button class="small">add</button></div>'));
    const choice = box.querySelector("select");
    choice.append(...(this.terms ?? []).map((t) => new Option(t, t)));
    box.querySelector("button").onclick = () => this.link.send("add term", { name: choice.value });
    if (this.law.sections.filter((s) => s.removal?.kind === "remove").length > 1) {
      const clear = fragment('<button class="small">remove all obstacles</button>').firstChild;
      clear.onclick = () => this.link.send("event", { event: { kind: "clear obstacles" } });
      box.append(clear);
    }
    return box;
  }

  // Values that hold: after a change, and after one that was refused.
  values(values) {
    for (const [path, value] of values) this.controls.get(key(path))?.(value);
  }

  curves(law) {
    for (const plot of this.plots) {
      const found = law.potentials.find((p) => key(p.path) === key(plot.potential.path));
      if (!found) continue;
      plot.potential = found;
      [plot.curves, plot.reach] = [found.curves, found.reach];
      if (document.activeElement !== plot.field) plot.field.value = found.formula;
    }
    this.drawPlots();
    clearTimeout(this.checking);
    this.checking = setTimeout(() => this.check(), 500);
  }

  async check() {
    for (const plot of this.plots) {
      try {
        const { rows } = await this.link.ask("properties", { path: plot.potential.path }, true);
        plot.checks.innerHTML = rows.map((row) => {
          const [style, mark] = row.holds === true ? ["yes", "✓"] : row.holds === false ? ["no", "✗"] : ["open", "○"];
          return `<li class="${style}" title="${escaped(row.explanation)}">${mark} ${escaped(row.name)}</li>`;
        }).join("");
        plot.reasons.querySelector("dl").innerHTML = rows.map((row) => `<dt>${escaped(row.name)}</dt><dd>${escaped(row.explanation)}</dd>`).join("");
        plot.reasons.hidden = !rows.length;
      } catch {
        plot.checks.innerHTML = "";
        plot.reasons.hidden = true;
      }
    }
  }

  // The histogram follows the frames, a few times a second.
  frame(frame) {
    const now = performance.now();
    if (now - this.counted < 250) return;
    this.counted = now;
    this.group = this.stored ? null : frame.groups[0];
    if (this.area.offsetParent !== null || this.area.offsetWidth) this.drawPlots();
  }

  drawPlots() {
    const style = getComputedStyle(document.documentElement), ink = (name) => style.getPropertyValue(name);
    for (const plot of this.plots) {
      const { canvas, curves, reach } = plot, box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
      if (!box.width) continue;
      [canvas.width, canvas.height] = [Math.round(box.width * ratio), Math.round(box.height * ratio)];
      const c = canvas.getContext("2d"), w = box.width, h = box.height - 14;
      c.setTransform(ratio, 0, 0, ratio, 0, 0);
      if (this.group && plot.potential.pairs) {
        const counts = pairDistances(this.group, reach, BINS), most = Math.max(...counts, 1);
        plot.counts = counts;
        c.fillStyle = ink("--bar");
        counts.forEach((x, k) => c.fillRect((k * w) / BINS + 0.5, h - (0.42 * h * x) / most, w / BINS - 1, (0.42 * h * x) / most));
      }
      c.strokeStyle = ink("--line");
      c.beginPath();
      c.moveTo(0, h + 0.5);
      c.lineTo(w, h + 0.5);
      c.stroke();
      c.fillStyle = ink("--soft");
      c.font = "10px system-ui, sans-serif";
      c.fillText("0", 1, h + 11);
      const end = `r = ${short(reach)}`;
      c.fillText(end, w - c.measureText(end).width - 1, h + 11);
      plot.drawn = {
        psi: line(c, curves.r, curves.psi, reach, w, h, ink("--accent"), []),
        force: line(c, curves.r, curves.force, reach, w, h, ink("--force"), [5, 4], true),
      };
    }
  }

  showNumbers(record) {
    const runs = record.numbers, names = Object.keys(runs[0] ?? {}).filter((name) => runs.some((run) => run[name] !== null));
    const cells = (name) => runs.map((run) => `<dd>${short(run[name])}</dd>`).join("") + (runs.length < 2 ? "<dd></dd>" : "");
    const pace = record.playing && record.reached !== null ? `${short(record.reached)} of ${short(record.speed)}` : "paused";
    const rows = [`<dt>${escaped(this.engine ?? "")}</dt><dd>time per second: ${pace}</dd><dd></dd>`];
    if (runs.length > 1) rows.push("<dt></dt><dd>first</dd><dd>second</dd>");
    // Beside a recorded moment they stay those of the present.
    const section = (words, t) => `<dt>${words}</dt><dd>t = ${this.when(t)}</dd><dd></dd>`, sums = new Set(record.ledger);
    const row = (name) => `<dt>${escaped(name)}</dt>${cells(name)}`;
    if (record.measured !== null) rows.push(section("of the present", record.measured), ...names.filter((n) => !sums.has(n)).map(row));
    if (names.some((n) => sums.has(n))) rows.push(section("since", record.changed), ...names.filter((n) => sums.has(n)).map(row));
    if (!record.complete) rows.push("<dt>log</dt><dd>full: this can no longer be replayed</dd><dd></dd>");
    if (record.fault) rows.push(`<dt>${escaped(record.fault)}</dt><dd></dd><dd></dd>`);
    this.numbers.innerHTML = rows.join("");
  }
}

// A curve between its usual values: poles leave the picture. With `zero`, the line of zero is drawn, too.
function line(c, r, values, reach, w, h, colour, dash, zero = false) {
  const finite = values.filter((x) => x !== null).sort((a, b) => a - b);
  if (!finite.length) return null;
  const at = (share) => finite[Math.min(finite.length - 1, Math.floor(share * finite.length))];
  let [low, high] = [at(0.0), at(0.999)];
  const [inner, outer] = [at(0.04), at(0.96)];
  if (high - outer > 3 * (outer - inner)) high = outer + 0.6 * (outer - inner);
  if (inner - low > 3 * (outer - inner)) low = inner - 0.6 * (outer - inner);
  if (zero) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
  const room = high > low ? high - low : Math.max(Math.abs(high), 1), y = (v) => h - 6 - ((h - 14) * (v - low)) / room;
  if (zero) {
    c.strokeStyle = colour;
    c.globalAlpha = 0.3;
    c.lineWidth = 1;
    c.beginPath();
    c.moveTo(0, y(0));
    c.lineTo(w, y(0));
    c.stroke();
    c.globalAlpha = 1;
  }
  c.save();
  c.beginPath();
  c.rect(0, 0, w, h);
  c.clip();
  c.strokeStyle = colour;
  c.lineWidth = zero ? 1.3 : 2;
  c.setLineDash(dash);
  c.beginPath();
  let open = false;
  values.forEach((v, k) => {
    if (v === null) {
      open = false;
      return;
    }
    const x = (w * r[k]) / reach, clipped = Math.min(Math.max(y(v), -1e4), 1e4);
    if (open) c.lineTo(x, clipped); else c.moveTo(x, clipped);
    open = true;
  });
  c.stroke();
  c.restore();
  c.setLineDash([]);
  return { low, high };
}

const starts = (path, head) => head.every((step, k) => path[k] === step);

export function fragment(html) {
  return document.createRange().createContextualFragment(html);
}
