// The connection with the lab: orders go out, messages and frames come in. It comes back by itself when it is lost.
// Orders are refused meanwhile: what they were meant for may be gone when it is back.

import { decoded } from "./frames.js";

const LOST = "the connection with the lab is lost";
const UNANSWERED = `${LOST} before it answered: what was asked for may be done or not`;

export class Connection {
  constructor() {
    this.listeners = {};
    this.answers = new Map();
    this.number = 0;
    this.pause = 200;
    this.lost = false;
    this.onFrame = () => {};
    this.onState = () => {};
    this.wanted = null; // what frames are to carry for this page: said again when the connection is back
    this.refused = new Set(); // kinds of the orders that were refused since the connection was lost
    this.unanswered = ""; // what is said of orders that were sent and not answered before it
  }

  on(kind, act) { (this.listeners[kind] ??= []).push(act); }

  open() {
    const here = new URL("live", location.href);
    here.protocol = "ws:";
    this.socket = new WebSocket(here);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.pause = 200;
      this.lost = false;
      if (this.wanted) this.send("wants", this.wanted);
      const told = [this.refused.size ? `Not done meanwhile: ${[...this.refused].join(", ")}.` : "", this.unanswered];
      this.refused.clear();
      this.unanswered = "";
      this.onState(true, told.filter(Boolean).join(" "));
    };
    this.socket.onmessage = (event) => this.take(event.data);
    this.socket.onclose = () => {
      if (!this.lost) this.onState(false); // once: what is refused meanwhile stays on the page
      this.lost = true;
      const unanswered = [...this.answers.values()];
      this.answers.clear();
      for (const waiting of unanswered) {
        waiting.no(UNANSWERED);
        if (waiting.quiet) continue;
        this.unanswered = "What was asked for just before may be done or not.";
        this.hear({ kind: "refused", message: UNANSWERED });
      }
      setTimeout(() => this.open(), this.pause);
      this.pause = Math.min(2 * this.pause, 5000);
    };
  }

  take(data) {
    if (data instanceof ArrayBuffer) {
      this.onFrame(decoded(data));
      return;
    }
    const message = JSON.parse(data);
    const waiting = message.id == null ? null : this.answers.get(message.id);
    if (waiting) {
      this.answers.delete(message.id);
      if (message.kind === "refused") waiting.no(message.message); else waiting.yes(message);
      if (waiting.quiet || message.kind === "answer") return;
    }
    this.hear(message);
  }

  hear(message) {
    for (const act of this.listeners[message.kind] ?? []) act(message);
  }

  get connected() { return this.socket?.readyState === WebSocket.OPEN; }

  // Tell the lab something; nothing is answered. An order is refused while the connection is lost; what this page shows
  // is said when it is back.
  send(kind, more = {}) {
    if (kind === "wants") this.wanted = more;
    if (this.connected) this.socket.send(JSON.stringify({ kind, ...more }));
    else if (!["drawn", "look", "wants"].includes(kind)) this.refuse(kind);
  }

  refuse(kind) {
    this.refused.add(kind);
    this.hear({ kind: "refused", message: `${LOST}: ${kind} was not done` });
  }

  // Ask for something; the promise is kept with the answer, or broken with the reason of a refusal. A quiet one shows
  // its refusals itself.
  ask(kind, more = {}, quiet = false) {
    if (!this.connected) {
      if (!quiet) this.refuse(kind);
      return Promise.reject(LOST);
    }
    const id = ++this.number;
    return new Promise((yes, no) => {
      this.answers.set(id, { yes, no, quiet });
      this.send(kind, { ...more, id });
    });
  }
}
