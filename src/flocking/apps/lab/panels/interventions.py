"""The panel of interventions: kicks, removals, cut links, new agents and obstacles, and other terms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from flocking.apps.lab.experiment.clock import Clock
from flocking.apps.lab.panels.controls import Send
from flocking.apps.lab.panels.ready_terms import TERMS
from flocking.apps.lab.scene.glyphs import spacing
from flocking.errors import FlockingError, InvalidInput
from flocking.model.serial import to_data

if TYPE_CHECKING:
    from viser import GuiApi

MOST_CHOSEN = 100_000
"""Agents that one range of numbers may choose, a bound on memory for what is typed."""


class Interventions:
    """The part of a page for interventions.

    Parameters
    ----------
    gui
        GUI of a viser server.
    clock
        The clock.
    send
        Sends an event.
    """

    def __init__(self, gui: GuiApi, clock: Clock, send: Send) -> None:
        self._clock, self._send = clock, send
        self._seed = 0
        with gui.add_folder("Perturb"):
            self.which = gui.add_text(
                "agents", "", hint="Numbers such as 3, 5-8, or click agents in the scene; a random share when empty."
            )
            self.share = gui.add_slider("random share", 0.0, 1.0, 0.01, 0.1)
            self.speed = gui.add_number("kick speed", 1.0, min=0.0, step=0.01)
            self.kick = gui.add_button("Kick", hint="Add a velocity of random direction.")
            self.kill = gui.add_button("Kill", hint="Remove agents.")
            self.cut = gui.add_button(
                "Cut links",
                hint="All links of those agents, or a random share; where only distance decides they reappear.",
            )
        with gui.add_folder("Add"):
            self.agent = gui.add_button("Add an agent")
            self.radius = gui.add_number("obstacle radius", 1.0, min=0.01, step=0.01)
            self.obstacle = gui.add_button("Add an obstacle", hint="Ahead of the group; drag it in the scene.")
            self.clear = gui.add_button("Remove all obstacles")
        with gui.add_folder("Terms of the law"):
            self.term = gui.add_dropdown("term", tuple(TERMS))
            self.add_term = gui.add_button("Add the term", hint="Its controls appear under Law; there it is removed.")
        self.fault = gui.add_markdown("", visible=False)
        for name in ("kick", "kill", "cut", "agent", "obstacle", "clear", "add_term"):
            getattr(self, name).on_click(self._sender(name))

    def _sender(self, name: str) -> object:
        def send(_: object) -> None:
            try:
                event = getattr(self, f"_{name}")()
            except FlockingError as error:
                self._show_message(str(error))
                return
            if name == "kill":
                self.which.value = ""  # the remaining agents have other numbers
            self._send(event, None, self._show_message)

        return send

    def pick(self, agent: int) -> list[int]:
        """Choose a clicked agent, or remove it from the choice; returns all chosen."""
        try:
            chosen = agents_of(self.which.value)
        except FlockingError:
            chosen = []
        chosen = [i for i in chosen if i != agent] if agent in chosen else sorted([*chosen, agent])
        self.which.value = ", ".join(map(str, chosen))
        return chosen

    def _show_message(self, message: str) -> None:
        self.fault.content, self.fault.visible = message, bool(message)

    def _draw(self) -> np.random.Generator:
        self._seed += 1
        return np.random.default_rng(self._seed)

    def _some(self, least: int = 1) -> list[int]:
        n = self._clock.frame.states[0].n
        if self.which.value.strip():
            return agents_of(self.which.value)
        count = min(n, max(least, round(self.share.value * n)))
        return [int(i) for i in np.sort(self._draw().permutation(n)[:count])]

    def _kick(self) -> dict[str, object]:
        return {"kind": "kick", "agents": self._some(), "speed": float(self.speed.value), "seed": self._seed}

    def _kill(self) -> dict[str, object]:
        return {"kind": "kill", "agents": self._some()}

    def _cut(self) -> dict[str, object]:
        links = self._clock.frame.states[0].links
        pairs = np.zeros((0, 2), dtype=int) if links is None else np.argwhere(np.triu(links | links.T))
        if self.which.value.strip():
            chosen = np.flatnonzero(np.isin(pairs, agents_of(self.which.value)).any(axis=1))
        else:
            count = min(len(pairs), max(1, round(self.share.value * len(pairs))))
            chosen = self._draw().permutation(len(pairs))[:count]
        return {"kind": "cut", "pairs": [[int(i), int(j)] for i, j in pairs[np.sort(chosen)]]}

    def _agent(self) -> dict[str, object]:
        """A new agent at the edge of the group, with its mean velocity."""
        state = self._clock.frame.states[0]
        centre = state.q.mean(axis=0)
        direction = self._draw().normal(size=state.dimension)
        direction /= np.linalg.norm(direction)
        far = float(((state.q - centre) @ direction).max()) + 0.5 * spacing(state.q)
        return {"kind": "add", "q": (centre + far * direction).tolist(), "p": state.p.mean(axis=0).tolist()}

    def _obstacle(self) -> dict[str, object]:
        """An obstacle ahead of the group, or beside it when it is at rest."""
        state = self._clock.frame.states[0]
        centre, velocity = state.q.mean(axis=0), state.p.mean(axis=0)
        speed = float(np.linalg.norm(velocity))
        ahead = velocity / speed if speed > 1e-9 else np.eye(state.dimension)[0]
        far = float(np.linalg.norm(state.q - centre, axis=1).max()) + 2 * float(self.radius.value)
        return {"kind": "obstacle", "centre": (centre + far * ahead).tolist(), "radius": float(self.radius.value)}

    def _clear(self) -> Mapping[str, object]:
        return {"kind": "clear obstacles"}

    def _add_term(self) -> dict[str, object]:
        frame = self._clock.frame
        return {"kind": "term", "term": to_data(TERMS[self.term.value](frame.scenarios[0].law, frame.states[0]))}


def agents_of(text: str) -> list[int]:
    """Numbers of agents in a text such as ``3, 5-8``.

    Raises
    ------
    InvalidInput
        When the text has another form.
    """
    found: set[int] = set()
    for word in text.replace(",", " ").split():
        first, dash, last = word.partition("-")
        last = last if dash else first
        if not (first.isdecimal() and last.isdecimal()) or len(word) > 15:
            raise InvalidInput("lab", "agents", "must be numbers such as 3, 5-8", text)
        found |= set(range(int(first), min(int(last), int(first) + MOST_CHOSEN) + 1))
    return sorted(found)
