// The card of a challenge: how it stands, what is chosen before its run, and its score.

import { fragment } from "./law.js";
import { short } from "./numbers.js";
import { escaped } from "./timeline.js";

export class Challenge {
  constructor(card, link, tell) {
    Object.assign(this, { card, link, tell });
    card.append(fragment('<div data-told></div><form hidden><label><span></span><input type="number" min="0" step="any"></label> <button class="small">start with it</button></form>'));
    [this.told, this.form, this.field] = ["[data-told]", "form", "input"].map((s) => card.querySelector(s));
    this.form.onsubmit = (event) => {
      event.preventDefault();
      link.send("load", { name: `challenge: ${this.task.key} = ${this.field.value}` });
    };
  }

  take(task) {
    this.card.hidden = !task;
    this.task = task;
    if (!task) return;
    const html = `<b>${escaped(task.title)}</b><br>${task.reached ? `<b>${escaped(task.unit)} ${short(task.value)}</b> · ` : ""}${escaped(task.words)}${task.reached ? "<br><button>save the score</button>" : ""}`;
    if (this.told.dataset.shown !== html) {
      this.told.dataset.shown = this.told.innerHTML = html;
      const save = this.told.querySelector("button");
      if (save) save.onclick = async () => this.tell((await this.link.ask("save score").catch(() => null))?.message ?? "");
    }
    this.card.title = task.goal;
    this.form.hidden = !task.chosen;
    const chosen = String(task.chosen ?? "");
    if (task.chosen && chosen !== this.chosen) {
      this.form.querySelector("span").textContent = `${task.chosen[0]} `;
      this.field.value = task.chosen[1];
    }
    this.chosen = chosen;
  }
}
