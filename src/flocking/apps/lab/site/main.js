// The lab's page: it joins the scene, the hands, the law and the timeline to the connection.

import { Challenge } from "./challenge.js";
import { Connection } from "./connection.js";
import { Dialogs } from "./dialogs.js";
import { Hands } from "./hands.js";
import { LawPanel } from "./law.js";
import { short } from "./numbers.js";
import { Scene } from "./scene.js";
import { Timeline, escaped } from "./timeline.js";

const at = (id) => document.getElementById(id);
const link = new Connection();
const scene = new Scene(at("canvas"));
const hands = new Hands(link, scene);
const law = new LawPanel(link, at("law"));
const timeline = new Timeline(link, scene, (agents) => {
  hands.choose(agents);
  const { width, height } = scene.size();
  const away = (i) => scene.sx[i] < 0 || scene.sy[i] < 0 || scene.sx[i] > width || scene.sy[i] > height;
  if (scene.sx && agents.some(away)) scene.aim(); // they may be far away
});
const challenge = new Challenge(at("challenge"), link, (text) => show("message", text));
const dialogs = new Dialogs(link, scene);
law.enlarge = (formula) => dialogs.show("formula", "The law", `<div style="font-size:1.25em">${formula}</div>`);
let opening = null;

link.onFrame = (frame) => {
  scene.show(frame);
  timeline.frame(frame);
  law.frame(frame);
};
scene.after = (fresh) => {
  if (fresh) {
    link.send("drawn");
    hands.frame(scene.frame);
  }
  const legend = scene.legendHtml();
  if (at("legend").innerHTML !== legend) at("legend").innerHTML = legend;
  const { length, pixels } = scene.scaleBar();
  at("scale").innerHTML = `<i style="width:${pixels}px"></i>${short(length)}`;
  showNote();
};
link.onState = (open, told) => {
  if (open) {
    scene.fresh = false;
    timeline.again = true;
  }
  if (open) show("message", told ? `The connection with the lab is back. ${told}` : "", true);
  else show("message", "The connection with the lab is lost; trying again …", true, true);
};

link.on("scenario", (message) => {
  at("title").textContent = message.title;
  for (const name of ["question", "paper", "size"]) at(name).textContent = message[name];
  at("paper").title = message.citation;
  document.title = `${message.title} · flocking lab`;
  scene.span = Math.max(message.end - message.start, 1e-12);
  timeline.scenario(message);
  law.scenario(message);
  dialogs.compared = message.compared;
  scene.second = message.second;
  dialogs.folder = message.folder;
  dialogs.stored = false;
});
link.on("law", (message) => {
  dialogs.law = message;
  law.build(message);
});
link.on("curves", (message) => law.curves(message));
link.on("values", (message) => law.values(message.values));
link.on("speed", (message) => timeline.showSpeed(message.speed));
link.on("aim", () => {
  scene.past = [];
  scene.gripped = null;
  hands.choose([]);
  hands.showHint();
  scene.aim();
});
link.on("record", (message) => {
  timeline.take(message);
  law.showNumbers(message);
  challenge.take(message.challenge);
  const stopped = message.failure || message.shrunk;
  const html = stopped ? `<b>${message.failure ? "Stopped" : "Stalled"}:</b> ${escaped(stopped)}<br><button>go back to the last good moment</button>` : "";
  if (at("stopped").dataset.shown !== html) {
    at("stopped").dataset.shown = at("stopped").innerHTML = html;
    const button = at("stopped").querySelector("button");
    if (button) button.onclick = () => link.send("go back");
  }
  at("stopped").hidden = !stopped;
});
link.on("stored", (message) => {
  dialogs.stored = true;
  at("title").textContent = `stored run ${message.name}${message.status === "finished" ? "" : `, ${message.status}`}`;
  at("question").textContent = message.note;
  for (const name of ["paper", "size"]) at(name).textContent = "";
  law.beside(true);
  timeline.showStored(message);
});
link.on("opening", ({ name }) => {
  clearInterval(opening);
  at("opening").hidden = !name;
  if (!name) return;
  const since = performance.now();
  const say = () => {
    const seconds = Math.round((performance.now() - since) / 1000);
    at("opening").innerHTML = `<div><span class="spin"></span>opening ${escaped(name)}${seconds > 1 ? ` · ${seconds} s` : ""}${seconds > 4 ? "<br><small>a law that was never run before is compiled first</small>" : ""}</div>`;
  };
  say();
  opening = setInterval(say, 500);
});
link.on("told", ({ message }) => show("message", message));
link.on("refused", (message) => {
  timeline.showSpeed(); // the one that holds, where another was refused
  show("message", `Not possible: ${message.message}`, true, !link.connected);
});

let hiding = null;
// A lasting text stands until another one does.
function show(id, text, bad = false, lasting = false) {
  const box = at(id);
  box.textContent = text;
  box.classList.toggle("bad", bad);
  box.hidden = !text;
  clearTimeout(hiding);
  if (text && !lasting) hiding = setTimeout(() => (box.hidden = true), 12000);
}

function showNote() {
  const notes = [], group = scene.frame?.groups[0];
  if (group) {
    if (scene.look.links && group.links < group.all_links) notes.push(`${group.links} of ${group.all_links} links drawn.`);
    if (scene.look.links && !group.linked) notes.push("Links are not drawn for so many agents.");
    if (scene.look.trails && group.n > 500) notes.push("Trails are drawn for up to 500 agents.");
    if (scene.look.colour !== scene.legend?.kind && scene.legend?.kind !== "none") notes.push(`Coloured by speed: ${group.n} agents are too many to colour by ${scene.look.colour}.`);
    if (group.n >= 10000) notes.push(`${group.n} agents, shaded by density.`);
  }
  if (at("note").textContent !== notes.join(" ")) at("note").textContent = notes.join(" ");
  at("note").hidden = !notes.length || !at("chosen").hidden;
}

at("theme").onclick = () => {
  const root = document.documentElement;
  root.dataset.theme = root.dataset.theme === "dark" ? "light" : "dark";
  law.drawPlots();
  timeline.drawCurves();
};
for (const name of ["claims", "law"]) {
  at(`show-${name}`).onclick = () => {
    document.body.dataset.sheet = document.body.dataset.sheet === name ? "" : name;
    requestAnimationFrame(() => {
      law.drawPlots();
      timeline.drawCurves();
      timeline.place();
    });
  };
}
document.addEventListener("keydown", (event) => {
  if (event.key === " " && !event.target.closest?.("button, input, textarea, select, summary, dialog")) {
    event.preventDefault();
    timeline.toggle();
  }
});

// What tests and the curious can look at.
window.lab = { link, scene, hands, law, timeline, dialogs, challenge };
link.open();
