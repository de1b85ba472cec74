// The connection with the lab: orders go out, messages and frames come in. It comes back by itself when it is lost.

import { decoded } from "./frames.js";

export class Connection {
  constructor() {
    this.listeners = {};
    this.answers = new Map();
    this.number = 0;
    this.pause = 200;
    this.onFrame = () => {};
    this.onState = () => {};
  }

  on(kind, act) { (this.listeners[kind] ??= []).push(act); }

  open() {
    const here = new URL("live", location.href);
    here.protocol = "ws:";
    this.socket = new WebSocket(here);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => { this.pause = 200; this.onState(true); };
    this.socket.onmessage = (event) => this.take(event.data);
    this.socket.onclose = () => {
      this.onState(false);
      for (const waiting of this.answers.values()) waiting.no("the connection was lost");
      this.answers.clear();
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
    for (const act of this.listeners[message.kind] ?? []) act(message);
  }

  // Tell the lab something; nothing is answered.
  send(kind, more = {}) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify({ kind, ...more }));
  }

  // Ask for something; the promise is kept with the answer, or broken with the reason of a refusal. A quiet one shows
  // its refusals itself.
  ask(kind, more = {}, quiet = false) {
    const id = ++this.number;
    return new Promise((yes, no) => {
      this.answers.set(id, { yes, no, quiet });
      this.send(kind, { ...more, id });
    });
  }
}
