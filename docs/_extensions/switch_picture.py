"""A link that appears and breaks within one step, and how the engine finds both times."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import flocking as fk
from flocking.engine.exact.crossings.guards import squared_distance
from flocking.show.sheet import sheet

OFFSET, RADIUS, SPEED = 0.96, 1.0, 1.0


def passing() -> fk.Run:
    """Two agents that pass each other freely, just inside the radius."""
    begin = fk.State([[0.0, 0.0], [-2.0, OFFSET]], [[0.0, 0.0], [SPEED, 0.0]])
    law = fk.Law(fk.Proximity(RADIUS), [fk.Consensus(0.0)])
    return fk.simulate(fk.Scenario(law, begin, t_end=4.0), progress=False)


def polygons(x0: float, x1: float, depth: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Control points of the squared distance on [x0, x1] of the way, halved ``depth`` times."""
    found = []
    edges = np.linspace(x0, x1, 2**depth + 1)
    for a, b in pairwise(edges):
        coefficients = np.zeros((8, 2, 2))
        coefficients[:, 1, 0] = -2.0 + SPEED * np.linspace(a, b, 8)
        coefficients[:, 1, 1] = OFFSET
        out = np.empty(15)
        squared_distance(coefficients, 0, 1, out)
        found.append((np.linspace(a, b, 15), out))
    return found


def draw_switch(path: Path) -> None:
    """Draw the picture."""
    run = passing()
    times = run.switches["time"]
    half = np.sqrt(RADIUS**2 - OFFSET**2)
    print(f"located {times}, closed form {2 - half:.12f}, {2 + half:.12f}")

    def panel(depth: int, title: str) -> Any:
        def draw(axes: Any) -> None:
            t = np.linspace(0, 4, 400)
            axes.plot(t, (t - 2) ** 2 + OFFSET**2, color="#0072B2", label="squared distance")
            for k, (place, value) in enumerate(polygons(0.0, 4.0, depth)):
                certain = value.min() > RADIUS**2
                look = "#7F7F7F" if certain else "#D55E00"
                axes.plot(place, value, "o-", ms=2.0, lw=0.6, color=look, label="coefficients" if k == 0 else None)
            axes.axhline(RADIUS**2, color="k", lw=0.7, ls="--")
            axes.vlines(times, -1.5, RADIUS**2, color="#009E73", lw=1.2, label="located switches")
            axes.set_ylim(-1.5 if depth == 0 else 0.5, 5.0 if depth == 0 else 2.5)
            if depth:
                axes.set_xlim(1.0, 3.0)
            axes.set_xlabel("$t$")
            axes.set_title(title)
            axes.legend(loc="upper center")

        return draw

    sheet([panel(0, "the whole step"), panel(3, "halved three times")], columns=2).savefig(path, dpi=150)
