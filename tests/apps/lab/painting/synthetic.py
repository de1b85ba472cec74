"""Frames that tests make themselves, so that what must be painted is known beforehand."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

SHOW = """async ([groups, t]) => {
    const made = groups.map((g) => ({ ...g, q: Float32Array.from(g.q.flat()), p: Float32Array.from(g.p.flat()),
        pairs: Uint32Array.from(g.pairs.flat()), axes: [], directions: [], flocks: null,
        energy: g.energy && Float32Array.from(g.energy), neighbours: Uint32Array.from(g.neighbours),
        virtual: new Float32Array(0) }));
    lab.scene.show({ number: 1e6 + t, t, live: true, version: [0], groups: made });
    await new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done))));
}"""
"""Paints a frame of groups, and waits for it and for the fit that may follow."""


def group(
    q: Sequence[Sequence[float]],
    *,
    pairs: Sequence[Sequence[int]] = (),
    speed: float = 1.0,
    energy: Sequence[float] | None = None,
    velocities: bool = True,
) -> dict[str, Any]:
    """A group of the plane around the origin, moving to the right.

    Parameters
    ----------
    q
        Positions, shape (N, 2).
    pairs
        Links.
    speed
        Of all agents.
    energy
        Of each agent.
    velocities
        Whether agents have velocities of their own.
    """
    places = np.asarray(q, dtype=float)
    return {
        "n": len(places), "d": 2, "centre": [0.0, 0.0], "links": len(pairs), "all_links": len(pairs), "linked": True,
        "box": [None, None], "solids": [], "q": places.tolist(), "p": [[speed, 0.0]] * len(places),
        "pairs": [list(pair) for pair in pairs], "energy": energy, "velocities": velocities,
        "neighbours": [sum(k in pair for pair in pairs) for k in range(len(places))], "thinned": False,
    }  # fmt: skip


def show(tab: Any, *groups: Mapping[str, Any], t: float = 0.0, aim: bool = False) -> None:
    """Paint groups side by side.

    Parameters
    ----------
    tab
        The tab; the run behind it must stand still.
    groups
        Groups, as `group` makes them.
    t
        Time of the frame.
    aim
        Fit the view to them.
    """
    if aim:
        tab.ask("() => { lab.scene.needsFit = true; lab.scene.fastest = 0; }")
    tab.ask(SHOW, [list(groups), t])


def place(tab: Any, point: Sequence[float], run: int = 0) -> np.ndarray:
    """Pixel of the scene at which a point of the world is painted in the part of a run."""
    return np.array(
        tab.ask(
            """([point, run]) => {
        const each = lab.scene.size().width / lab.scene.frame.groups.length;
        const [x, y] = lab.scene.within(run, (camera) => camera.world(point));
        return [x + run * each, y];
    }""",
            [list(map(float, point)), run],
        ),
        dtype=float,
    )


def scene_size(tab: Any) -> np.ndarray:
    """Width and height of the scene in pixels."""
    return np.array(tab.ask("() => { const s = lab.scene.size(); return [s.width, s.height]; }"), dtype=float)
