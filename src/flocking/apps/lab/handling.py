"""Acting on the group: kicks, removals, cut links, new agents and obstacles, and other terms."""

from __future__ import annotations

from typing import Any

import numpy as np

from flocking.apps.lab.clock import Clock
from flocking.apps.lab.controls import Send
from flocking.apps.lab.glyphs import spacing
from flocking.apps.lab.terms_at_hand import TERMS
from flocking.model.serial import to_data


class Handling:
    """The part of a page that intervenes.

    Parameters
    ----------
    gui
        GUI of a viser server.
    clock
        The clock.
    send
        Where events go.
    """

    def __init__(self, gui: Any, clock: Clock, send: Send) -> None:
        self._clock, self._send = clock, send
        self._seed = 0
        with gui.add_folder("Perturb"):
            self.share = gui.add_slider("share of agents", 0.0, 1.0, 0.01, 0.1)
            self.speed = gui.add_number("kick speed", 1.0, min=0.0, step=0.1)
            self.kick = gui.add_button("Kick", hint="Add a velocity of random direction to random agents.")
            self.kill = gui.add_button("Kill", hint="Remove random agents.")
            self.cut = gui.add_button(
                "Cut links", hint="Cut random links; where distance alone decides they come back."
            )
        with gui.add_folder("Add"):
            self.agent = gui.add_button("Add an agent")
            self.radius = gui.add_number("obstacle radius", 1.0, min=1e-3, step=0.1)
            self.obstacle = gui.add_button("Add an obstacle", hint="Ahead of the group; drag it in the scene.")
            self.clear = gui.add_button("Remove all obstacles")
        with gui.add_folder("Terms of the law"):
            self.term = gui.add_dropdown("term", tuple(TERMS))
            self.add_term = gui.add_button("Add the term")
            self.drop_term = gui.add_button("Remove the last term")
        self.fault = gui.add_markdown("", visible=False)
        for name in ("kick", "kill", "cut", "agent", "obstacle", "clear", "add_term", "drop_term"):
            getattr(self, name).on_click(self._sender(name))

    def _sender(self, name: str) -> Any:
        def send(_: Any) -> None:
            self._send(getattr(self, f"_{name}")(), None, self._tell)

        return send

    def _tell(self, message: str) -> None:
        self.fault.content, self.fault.visible = message, bool(message)

    def _draw(self) -> np.random.Generator:
        self._seed += 1
        return np.random.default_rng(self._seed)

    def _some(self, least: int = 1) -> list[int]:
        n = self._clock.frame.states[0].n
        count = min(n, max(least, round(self.share.value * n)))
        return [int(i) for i in np.sort(self._draw().permutation(n)[:count])]

    def _kick(self) -> dict[str, Any]:
        return {"kind": "kick", "agents": self._some(), "speed": float(self.speed.value), "seed": self._seed}

    def _kill(self) -> dict[str, Any]:
        return {"kind": "kill", "agents": self._some()}

    def _cut(self) -> dict[str, Any]:
        links = self._clock.frame.states[0].links
        pairs = np.zeros((0, 2), dtype=int) if links is None else np.argwhere(np.triu(links | links.T))
        count = min(len(pairs), max(1, round(self.share.value * len(pairs))))
        chosen = self._draw().permutation(len(pairs))[:count]
        return {"kind": "cut", "pairs": [[int(i), int(j)] for i, j in pairs[np.sort(chosen)]]}

    def _agent(self) -> dict[str, Any]:
        """A newcomer at the rim of the group, with its mean velocity."""
        state = self._clock.frame.states[0]
        centre = state.q.mean(axis=0)
        direction = self._draw().normal(size=state.dimension)
        direction /= np.linalg.norm(direction)
        far = float(((state.q - centre) @ direction).max()) + 0.5 * spacing(state.q)
        return {"kind": "add", "q": (centre + far * direction).tolist(), "p": state.p.mean(axis=0).tolist()}

    def _obstacle(self) -> dict[str, Any]:
        """Where the group will be soon, or beside it."""
        state = self._clock.frame.states[0]
        centre, velocity = state.q.mean(axis=0), state.p.mean(axis=0)
        speed = float(np.linalg.norm(velocity))
        ahead = velocity / speed if speed > 1e-9 else np.eye(state.dimension)[0]
        far = float(np.linalg.norm(state.q - centre, axis=1).max()) + 2 * float(self.radius.value)
        return {"kind": "obstacle", "centre": (centre + far * ahead).tolist(), "radius": float(self.radius.value)}

    def _clear(self) -> dict[str, Any]:
        return {"kind": "clear obstacles"}

    def _add_term(self) -> dict[str, Any]:
        frame = self._clock.frame
        return {"kind": "term", "term": to_data(TERMS[self.term.value](frame.scenarios[0].law, frame.states[0]))}

    def _drop_term(self) -> dict[str, Any]:
        return {"kind": "drop", "number": len(self._clock.frame.scenarios[0].law.terms) - 1}
