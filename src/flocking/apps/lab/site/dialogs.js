// Dialogs: the picker of scenarios, comparison, view, and files.

import { fragment } from "./law.js";
import { escaped } from "./timeline.js";

export class Dialogs {
  constructor(link, scene, tell) {
    this.link = link;
    this.scene = scene;
    this.tell = tell;
    this.box = document.getElementById("dialog");
    this.pictures = new Map();
    this.box.addEventListener("click", (event) => event.target === this.box && this.box.close());
    link.on("catalogue", (message) => {
      this.catalogue = message;
      if (this.whenListed && this.box.open && this.box.dataset.kind === "challenges") this.whenListed();
      if (this.box.open && this.box.dataset.kind === "pick") this.fillTiles();
      if (this.box.open && this.box.dataset.kind === "files") this.fillRuns();
    });
    const open = { pick: () => this.pick(), challenges: () => this.challenges(), compare: () => this.compare(), view: () => this.view(), files: () => this.files() };
    for (const [id, act] of Object.entries(open)) document.getElementById(id).onclick = act;
  }

  show(kind, title, html) {
    this.box.dataset.kind = kind;
    this.box.setAttribute("aria-label", title);
    this.box.replaceChildren(fragment(`<button class="small close">close</button><h2>${title}</h2>${html}`));
    this.box.querySelector(".close").onclick = () => this.box.close();
    if (!this.box.open) this.box.showModal();
  }

  pick() {
    this.show("pick", "What do you want to see?", '<p class="dim">Every picture shows how a scenario begins.</p><div data-tiles>reading the papers …</div>');
    if (this.catalogue) this.fillTiles();
    this.link.send("catalogue");
  }

  fillTiles() {
    const area = this.box.querySelector("[data-tiles]");
    area.innerHTML = this.catalogue.groups.map((group) => `<section class="paper"><h3>${escaped(group.title)}</h3><p>${escaped(group.about)}</p><div class="tiles">${group.scenarios
      .map((s) => `<button class="tile" data-name="${escaped(s.name)}"><canvas aria-hidden="true"></canvas><span>${escaped(s.title)}</span>${s.question ? `<q>${escaped(s.question)}</q>` : ""}<small></small></button>`).join("")}</div></section>`).join("");
    const seen = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        if (!entry.isIntersecting) continue;
        seen.unobserve(entry.target);
        this.picture(entry.target);
      }
    }, { root: this.box });
    for (const tile of area.querySelectorAll(".tile")) {
      seen.observe(tile);
      tile.onclick = () => {
        this.box.close();
        this.link.send("load", { name: tile.dataset.name });
      };
    }
  }

  async picture(tile) {
    const name = tile.dataset.name;
    try {
      if (!this.pictures.has(name)) this.pictures.set(name, (await this.link.ask("small picture", { name }, true)).picture);
    } catch { return; }
    const picture = this.pictures.get(name);
    if (!picture) return;
    drawStart(tile.querySelector("canvas"), picture);
    tile.querySelector("small").textContent = `${picture.n} agents${picture.d > 2 ? " in space" : ""}${picture.open ? "" : " on a torus"}`;
  }

  challenges() {
    this.show("challenges", "Challenges", "<div data-list>…</div>");
    const fill = () => {
      const area = this.box.querySelector("[data-list]");
      area.innerHTML = this.catalogue.challenges.map((c) => `<h3>${escaped(c.title)}</h3><p>${escaped(c.goal)}</p><button class="small" data-key="${escaped(c.key)}">try it</button>`).join("");
      for (const button of area.querySelectorAll("button")) button.onclick = () => {
        this.box.close();
        this.link.send("load", { name: `challenge: ${button.dataset.key}` });
      };
    };
    if (this.catalogue) fill();
    else {
      this.whenListed = fill;
      this.link.send("catalogue");
    }
  }

  compare() {
    const numbers = (this.law?.sections ?? []).flatMap((s) => s.settings.filter((x) => x.kind === "number").map((x) => ({ ...x, title: `${s.title}: ${x.label}` })));
    this.show("compare", "Two runs side by side", `<p>Both start anew; the second differs in one number.</p>
      <label>differ in<select data-which>${numbers.map((x, k) => `<option value="${k}">${escaped(x.title)}</option>`).join("")}</select></label>
      <label>value in the second<input type="number" step="any" data-value></label>
      <p class="fault" role="alert" hidden></p><button class="small" data-go>compare</button> <button class="small" data-one ${this.compared?.length ? "" : "hidden"}>only one</button>`);
    const [which, value, fault] = ["[data-which]", "[data-value]", ".fault"].map((s) => this.box.querySelector(s));
    // Half of the value that holds: a second run with the same one would show nothing.
    const fill = () => {
      const now = numbers[which.value]?.value;
      value.value = now === undefined ? "" : Number((now ? now / 2 : 1).toPrecision(6));
    };
    which.onchange = fill;
    fill();
    this.box.querySelector("[data-go]").onclick = async () => {
      try {
        if (value.value === "") throw "compare: the value must be a number"; // an empty field would count as 0
        await this.link.ask("compare", { path: numbers[which.value].path, value: Number(value.value) }, true);
        this.box.close();
      } catch (reason) {
        fault.textContent = String(reason);
        fault.hidden = false;
      }
    };
    this.box.querySelector("[data-one]").onclick = () => {
      this.link.send("only one");
      this.box.close();
    };
  }

  view() {
    const look = this.scene.look;
    const ticks = [["links", "links"], ["trails", "trails"], ["virtual", "beta- and gamma-agents"], ["light", "light background"]];
    this.show("view", "View", `<label>colour by<select data-colour>${["speed", "heading", "flock", "energy"].map((k) => `<option ${k === look.colour ? "selected" : ""}>${k}</option>`).join("")}</select></label>
      ${ticks.map(([name, words]) => `<label class="tick"><input type="checkbox" data-look="${name}" ${look[name] ? "checked" : ""}>${words}</label>`).join("")}
      <label class="tick"><input type="checkbox" data-follow ${this.scene.camera.follow ? "checked" : ""}>follow the group</label>
      <button class="small" data-fit>fit the view</button> <button class="small" data-space>the same in three dimensions</button>`);
    const wants = () => this.link.send("wants", { energies: look.colour === "energy", virtual_agents: look.virtual, flocks: look.colour === "flock" });
    this.box.querySelector("[data-colour]").onchange = (e) => {
      look.colour = e.target.value;
      wants();
      this.scene.repaint();
    };
    for (const field of this.box.querySelectorAll("[data-look]")) field.onchange = () => {
      look[field.dataset.look] = field.checked;
      if (field.dataset.look === "virtual") wants();
      this.scene.repaint();
    };
    this.box.querySelector("[data-follow]").onchange = (e) => {
      const cam = this.scene.camera, centre = cam.centre;
      cam.follow = e.target.checked;
      cam.off = cam.off.map((x, k) => x + (cam.follow ? -centre[k] : centre[k]));
      this.scene.repaint();
    };
    this.box.querySelector("[data-fit]").onclick = () => this.scene.aim();
    this.box.querySelector("[data-space]").onclick = () => {
      this.link.send("space");
      this.box.close();
    };
  }

  files() {
    this.show("files", "Files", `<p>They go to <code>${escaped(this.folder ?? "")}</code>.</p>
      <p><button class="small" data-do="save">save the scenario</button> <button class="small" data-do="picture">save a picture</button>
      <button class="small" data-do="film">${this.filming ? "stop and save the film" : "record a film"}</button></p><p data-said role="status"></p>
      <h3>Stored runs</h3><div data-runs></div>`);
    const said = this.box.querySelector("[data-said]");
    const run = async (act) => {
      said.textContent = "…";
      try {
        said.textContent = (await act())?.message ?? "";
      } catch (reason) {
        said.textContent = String(reason);
      }
    };
    const act = {
      save: () => run(() => this.link.ask("save", {}, true)),
      picture: () => run(() => this.link.ask("save picture", { data: this.scene.canvas.toDataURL("image/png").split(",")[1] }, true)),
      film: () => run(async () => {
        this.filming = !this.filming;
        this.box.querySelector("[data-do=film]").textContent = this.filming ? "stop and save the film" : "record a film";
        if (this.filming) return this.link.send("film"), { message: "Recording: press play." };
        const { colour, links, light } = this.scene.look;
        return this.link.ask("save film", { color: colour, links, dark: !light }, true);
      }),
    };
    for (const button of this.box.querySelectorAll("[data-do]")) button.onclick = act[button.dataset.do];
    if (this.catalogue) this.fillRuns();
    this.link.send("catalogue");
  }

  fillRuns() {
    const area = this.box.querySelector("[data-runs]"), runs = this.catalogue.runs ?? [];
    area.innerHTML = (runs.length ? "" : "<p>None in this folder: <code>flocking run … --out NAME</code> stores one.</p>") +
      `<label>name<input data-name list="stored-runs" value="${escaped(runs[0] ?? "")}"></label><datalist id="stored-runs">${runs.map((r) => `<option value="${escaped(r)}">`).join("")}</datalist>
      <button class="small" data-open>open</button> <button class="small" data-back ${this.stored ? "" : "hidden"}>back to the live run</button><p class="fault" role="alert" hidden></p>`;
    const fault = area.querySelector(".fault");
    area.querySelector("[data-open]").onclick = async () => {
      try {
        await this.link.ask("open run", { name: area.querySelector("[data-name]").value }, true);
        this.box.close();
      } catch (reason) {
        fault.textContent = String(reason);
        fault.hidden = false;
      }
    };
    area.querySelector("[data-back]").onclick = () => {
      this.link.send("close run");
      this.box.close();
    };
  }
}

// A small picture of a start: obstacles, and agents that point where they go.
export function drawStart(canvas, { q, p, obstacles }) {
  const box = canvas.getBoundingClientRect(), ratio = window.devicePixelRatio || 1, c = canvas.getContext("2d");
  [canvas.width, canvas.height] = [box.width * ratio, box.height * ratio];
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  const xs = q.map((x) => x[0]), ys = q.map((x) => x[1]), mid = [(Math.min(...xs) + Math.max(...xs)) / 2, (Math.min(...ys) + Math.max(...ys)) / 2];
  const wide = Math.max(Math.max(...xs) - Math.min(...xs), 1e-9), tall = Math.max(Math.max(...ys) - Math.min(...ys), 1e-9);
  const near = obstacles.filter((o) => o.some(([x, y]) => Math.hypot(x - mid[0], y - mid[1]) < 2 * Math.max(wide, tall)));
  const every = [...q, ...near.flat()], low = [0, 1].map((k) => Math.min(...every.map((x) => x[k]))), high = [0, 1].map((k) => Math.max(...every.map((x) => x[k])));
  const s = 0.84 * Math.min(box.width / Math.max(high[0] - low[0], 1e-9), box.height / Math.max(high[1] - low[1], 1e-9));
  const at = ([x, y]) => [box.width / 2 + s * (x - (low[0] + high[0]) / 2), box.height / 2 - s * (y - (low[1] + high[1]) / 2)];
  c.fillStyle = "#b2555a";
  for (const outline of near) {
    c.beginPath();
    outline.forEach((x, k) => (k ? c.lineTo(...at(x)) : c.moveTo(...at(x))));
    c.fill();
  }
  c.fillStyle = "#8fd0c8";
  q.forEach((x, i) => {
    const [sx, sy] = at(x), speed = Math.hypot(...p[i]), [ux, uy] = speed > 0 ? [p[i][0] / speed, -p[i][1] / speed] : [1, 0], r = q.length > 60 ? 2.6 : 3.6;
    c.beginPath();
    c.moveTo(sx + r * ux, sy + r * uy);
    c.lineTo(sx - r * ux - 0.7 * r * uy, sy - r * uy + 0.7 * r * ux);
    c.lineTo(sx - r * ux + 0.7 * r * uy, sy - r * uy - 0.7 * r * ux);
    c.fill();
  });
}
