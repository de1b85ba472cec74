"""Random runs: ordinary ones, and ones made to be hard. The same seed and number give the same run, alone or not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import flocking as fk
from tests.validation.judge.motion import Links, Problem
from tests.validation.laws import FAMILIES, Drawn, Generator

ORDINARY = 0.6
"""Share of ordinary draws."""

FRAMES = 21


@dataclass(frozen=True)
class Draw:
    """A run to be judged: ``law`` names its structure, ``kind`` how it was made (``"ordinary"``, or a hardship).

    ``line`` runs stay on one line, where two agents that pass each other meet.
    """

    number: int
    law: str
    kind: str
    scenario: fk.Scenario
    problem: Problem
    line: bool = False
    note: str = ""


@dataclass(frozen=True)
class Start:
    """Positions, velocities, start time, length and tolerance of a run."""

    q: np.ndarray
    p: np.ndarray
    time: float
    length: float
    tolerance: float


def generator(seed: int, number: int) -> Generator:
    """Numbers of one draw, whatever the others are."""
    return np.random.Generator(np.random.Philox(key=[seed, number]))


def draw(seed: int, number: int) -> Draw:
    """Draw number ``number`` of a seed."""
    rng = generator(seed, number)
    if rng.random() < ORDINARY:
        return _ordinary(rng, number)
    names = list(HARDSHIPS)
    kind = names[int(rng.integers(len(names)))]
    return HARDSHIPS[kind](rng, number)


def _tolerance(rng: Generator) -> float:
    return float(f"{10 ** rng.uniform(-12, -4):.3g}")


def _started(rng: Generator, drawn: Drawn, n: int, m: int, speed: float = 1.0) -> Start:
    """Agents that are not too near to each other where the force is infinite, in a box in which links form."""
    least = 0.35 * drawn.scale if drawn.singular else 0.02
    side = drawn.scale * n ** (1 / m) * rng.uniform(0.5, 1.1)
    q = rng.uniform(-side / 2, side / 2, (n, m))
    while True:
        offsets = np.linalg.norm(q[:, None] - q[None], axis=2) + 1e9 * np.eye(n)
        # A barrier at the radius is infinite there.
        rim = [x for x in drawn.graphs if np.isfinite(x.leave)]
        near = any((np.abs(offsets - r) < 0.03 * r).any() for x in rim for r in (x.appear, x.leave))
        if offsets.min() > least and not near:
            break
        q = rng.uniform(-side / 2, side / 2, (n, m)) * (1.0 + rng.random())
    p = rng.normal(size=(n, m)) * speed * rng.uniform(0.2, 1.2)
    q, p = (np.array([[float(f"{x:.8g}") for x in row] for row in a]) for a in (q, p))
    return Start(q, p, 0.0, float(f"{rng.uniform(0.5, 6.0):.4g}"), _tolerance(rng))


def assembled(number: int, name: str, kind: str, drawn: Drawn, start: Start, **about: object) -> Draw:
    """The draw of a law and a start."""
    end = start.time + start.length
    scenario = fk.Scenario(
        drawn.law, fk.State(start.q, start.p, start.time), end, agents=drawn.agents, frames=FRAMES,
        energy=drawn.energy, tolerance=start.tolerance,
    )  # fmt: skip
    masses, damping = (np.broadcast_to(np.asarray(x, dtype=float), len(start.q)) for x in
                       (drawn.agents.masses, drawn.agents.damping))  # fmt: skip
    problem = Problem(
        start.q, start.p, start.time, end, scenario.frame_times, drawn.graphs, drawn.parts, masses, damping,
        drawn.follow, drawn.shifted,
    )  # fmt: skip
    return Draw(number, name, kind, scenario, problem, **about)  # type: ignore[arg-type]


def _law(rng: Generator, n: int, m: int, wanted: Callable[[Drawn], bool] = lambda _: True) -> tuple[str, Drawn]:
    while True:
        name = list(FAMILIES)[int(rng.integers(len(FAMILIES)))]
        if wanted(drawn := FAMILIES[name](rng, n, m)):
            return name, drawn


def _count(rng: Generator) -> int:
    return int(rng.integers(2, 6))


def _ordinary(rng: Generator, number: int) -> Draw:
    n, m = _count(rng), 2
    name, drawn = _law(rng, n, m)
    if name == "springs" and rng.random() < 0.4:
        m = 3
        drawn = FAMILIES[name](rng, n, m)
    return assembled(number, name, "ordinary", drawn, _started(rng, drawn, n, m))


def _with_radius(name: str, drawn: Drawn, radius: float, n: int) -> Drawn:
    """The same law with another radius of its own graph."""
    law = replace(drawn.law, graph=fk.Proximity(radius))
    return replace(drawn, law=law, graphs=(Links(radius, radius), *drawn.graphs[1:]), radius=radius)


def _passing(rng: Generator, number: int) -> Draw:
    """Two agents fly past each other at R (1 +- 10^-k), straight until a link appears; others are far away."""
    n, m = _count(rng), 2
    name, drawn = _law(rng, n, m, lambda x: x.free)
    k = int(rng.integers(1, 13))
    closest = drawn.radius * (1 + rng.choice([-1, 1]) * 10.0**-k)
    direction = rng.uniform(0, 2 * np.pi) * (rng.random() < 0.7)
    along, across = np.array([np.cos(direction), np.sin(direction)]), np.array([-np.sin(direction), np.cos(direction)])
    speed, when = rng.uniform(0.3, 3.0), rng.uniform(0.5, 3.0)
    offset = closest * across - speed * when * along
    q, p = np.zeros((n, m)), np.zeros((n, m))
    q[1], p[1] = offset, speed * along
    for i in range(2, n):
        q[i] = 40.0 * i + rng.uniform(-1, 1, m)
        p[i] = rng.normal(size=m) * 0.3
    shift = rng.normal(size=m) * (rng.random() < 0.5)
    start = Start(q, p + shift, 0.0, float(f"{rng.uniform(1.5, 5.0):.4g}"), _tolerance(rng))
    return assembled(number, name, "passing", drawn, start, note=f"closest at R(1 {closest / drawn.radius - 1:+.1e})")


def _turning(rng: Generator, number: int) -> Draw:
    """A bound pair whose largest (or smallest) distance is R (1 +- 10^-k)."""
    drawn = FAMILIES["watched"](rng, 2, 2)
    k, c = int(rng.integers(1, 13)), 0.0
    stiffness, rest = (drawn.parts[0].values[x] for x in "kd")
    speed = rng.uniform(0.1, 0.8) * rest * np.sqrt(2 * stiffness)
    outer = rng.random() < 0.7
    turn = rest + (1 if outer else -1) * speed / np.sqrt(2 * stiffness)
    radius = turn * (1 + rng.choice([-1, 1]) * 10.0**-k)
    angle = rng.uniform(0, 2 * np.pi) * (rng.random() < 0.5)
    axis = np.array([np.cos(angle), np.sin(angle)])
    q, p = np.outer([-0.5, 0.5], axis) * rest, np.outer([-0.5, 0.5], axis) * speed
    spring = drawn.law.terms[0]
    law = fk.Law(drawn.law.graph, [spring, fk.Consensus(c)])
    drawn = replace(drawn, law=law, parts=(drawn.parts[0], replace(drawn.parts[1], values={"c": c})))
    drawn = _with_radius("watched", drawn, float(radius), 2)
    period = 2 * np.pi / np.sqrt(2 * stiffness)
    start = Start(q, p, 0.0, float(f"{rng.uniform(0.6, 3.0) * period:.4g}"), _tolerance(rng))
    note = f"turns at R(1 {turn / radius - 1:+.1e})"
    return assembled(number, "watched", "turning", drawn, start, line=True, note=note)


def _moved(rng: Generator, number: int) -> Draw:
    """An ordinary run far from the origin, or seen by somebody who moves fast."""
    n, m = _count(rng), 2
    name, drawn = _law(rng, n, m, lambda x: x.shifted)
    start = _started(rng, drawn, n, m)
    way = rng.normal(size=m)
    way /= np.abs(way).max()
    if rng.random() < 0.7:
        k = rng.uniform(3, 15)
        start = replace(start, q=start.q + 10.0**k * way)
        note = f"moved by 1e{k:.1f}"
    else:
        k = rng.uniform(1, 6)
        start = replace(start, p=start.p + 10.0**k * way)
        note = f"velocities plus 1e{k:.1f}"
    return _if_it_can_be(number, name, "moved", drawn, start, rng, note)


def _late(rng: Generator, number: int) -> Draw:
    """An ordinary run at a late time."""
    n, m = _count(rng), 2
    name, drawn = _law(rng, n, m, lambda x: x.ageless)
    start = _started(rng, drawn, n, m)
    k = rng.uniform(3, 15)
    time = float(rng.choice([-1, 1]) * np.round(10.0**k))
    length = (time + start.length) - time
    return _if_it_can_be(number, name, "late", drawn, replace(start, time=time, length=length), rng, f"time 1e{k:.1f}")


def _if_it_can_be(number: int, name: str, kind: str, drawn: Drawn, start: Start, rng: Generator, note: str) -> Draw:
    """The draw, unless rounding of its start leaves none: agents on one point, no time to pass."""
    same = (np.abs(start.q[:, None] - start.q[None]).max(axis=2) + np.eye(len(start.q)) == 0).any()
    times = np.linspace(start.time, start.time + start.length, FRAMES)
    if same or start.length <= 0 or (np.diff(times) <= 0).any():
        return _ordinary(rng, number)
    return assembled(number, name, kind, drawn, start, note=note)


def _thrown(rng: Generator, number: int) -> Draw:
    """Agents that meet a narrow barrier."""
    n, m = int(rng.integers(2, 4)), 2
    width = float(f"{10 ** -rng.uniform(1, 6):.3g}")
    drawn = FAMILIES["narrow"](rng, n, m, width)
    angle = rng.uniform(0, 2 * np.pi, n)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    q, p = np.zeros((n, m)), np.zeros((n, m))
    inside = rng.random() < 0.4
    for i in range(1, n):
        q[i] = ring[i] * ((rng.uniform(1.2, 2.2) if inside else rng.uniform(3.3, 4.5)) if i == 1 else 5.0 + i)
    # The barrier is 50 high: a pair with a reduced mass of 1/2 climbs it at a relative speed of sqrt(200).
    towards = rng.uniform(0.5, 1.3) * np.sqrt(200.0) if rng.random() < 0.5 else rng.uniform(0.5, 5.0)
    p[1] = (ring[1] if inside else -ring[1]) * towards + rng.normal(size=m) * 0.1
    if inside:
        p[1] = ring[1] * rng.uniform(2, 18)
    start = Start(q, p, 0.0, float(f"{rng.uniform(0.5, 3.0):.4g}"), _tolerance(rng))
    return assembled(number, "narrow", "thrown", drawn, start, note=f"width {width:g}")


def _together(rng: Generator, number: int) -> Draw:
    """Two agents that start on the same point, or nearly."""
    n, m = _count(rng), 2
    name, drawn = _law(rng, n, m, lambda x: not x.singular)
    start = _started(rng, drawn, n, m)
    k = int(rng.integers(2, 17))
    apart = 0.0 if drawn.even and rng.random() < 0.5 else 10.0**-k
    angle = rng.uniform(0, 2 * np.pi)
    q, p = start.q.copy(), start.p.copy()
    if apart:
        q[0] = 0.0
    q[1] = q[0] + apart * np.array([np.cos(angle), np.sin(angle)])
    if rng.random() < 0.3:
        p[1] = p[0]
    gap = float(np.linalg.norm(q[1] - q[0]))
    return assembled(number, name, "together", drawn, replace(start, q=q, p=p), note=f"apart {gap:.1e}")


def _fast(rng: Generator, number: int) -> Draw:
    """Agents that fly through each other's range within what else would be one step."""
    n, m = _count(rng), 2
    name, drawn = _law(rng, n, m, lambda x: np.isfinite(x.radius) and not x.singular)
    speed = 10 ** rng.uniform(1, 4)
    start = _started(rng, drawn, n, m)
    q, p = start.q.copy(), start.p.copy()
    when = rng.uniform(0.1, 0.9) * min(start.length, 3.0)
    aim = rng.uniform(0, 0.98) * drawn.radius
    angle = rng.uniform(0, 2 * np.pi)
    along, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    q[1] = q[0] + p[0] * when + aim * across - speed * when * along
    p[1] = speed * along
    return assembled(number, name, "fast", drawn, replace(start, q=q, p=p), note=f"speed {speed:.3g}")


def _symmetric(rng: Generator, number: int) -> Draw:
    """Agents on a regular polygon, or two on a line: links change at one instant, and agents may meet in one point."""
    n, m = _count(rng), 2
    if rng.random() < 0.5:
        name = "even" if rng.random() < 0.7 else "flights"
        drawn, n = FAMILIES[name](rng, 2, m), 2
        half, speed = rng.uniform(0.3, 2.0), rng.uniform(0.2, 3.0)
        axis = np.array([1.0, 0.0]) if rng.random() < 0.7 else np.array([0.0, 1.0])
        q, p = np.outer([-half, half], axis), np.outer([speed, -speed], axis)
        start = Start(q, p, 0.0, float(f"{rng.uniform(1, 5):.4g}"), _tolerance(rng))
        return assembled(number, name, "symmetric", drawn, start, line=True, note="head on")
    name, drawn = _law(rng, n, m, lambda x: x.shifted and not np.ndim(x.agents.masses))
    size = rng.uniform(0.4, 1.0) * (drawn.radius if np.isfinite(drawn.radius) else drawn.scale)
    turn = 2 * np.pi * np.arange(n) / n + rng.uniform(0, 1) * (rng.random() < 0.5)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    around = np.stack([-np.sin(turn), np.cos(turn)], axis=1)
    p = ring * rng.uniform(-1, 1) + around * rng.uniform(0.1, 0.6)
    start = Start(size * ring, p, 0.0, float(f"{rng.uniform(0.5, 4):.4g}"), _tolerance(rng))
    return assembled(number, name, "symmetric", drawn, start, note=f"{n} on a circle")


def _on_the_rim(rng: Generator, number: int) -> Draw:
    """A pair that starts at R (1 +- 10^-k)."""
    n, m = _count(rng), 2
    name, drawn = _law(rng, n, m, lambda x: np.isfinite(x.radius) and not x.singular and "Hysteresis" not in str(x.law))
    start = _started(rng, drawn, n, m)
    k = int(rng.integers(2, 14))
    angle = rng.uniform(0, 2 * np.pi)
    q = start.q.copy()
    reach = drawn.radius * (1 + rng.choice([-1, 1]) * 10.0**-k)
    q[1] = q[0] + reach * np.array([np.cos(angle), np.sin(angle)])
    return assembled(number, name, "rim", drawn, replace(start, q=q), note=f"{reach / drawn.radius - 1:+.1e}")


def _coarse(rng: Generator, number: int) -> Draw:
    """An ordinary run with a very coarse or very fine tolerance, or a long one."""
    n, m = _count(rng), 2
    name, drawn = _law(rng, n, m)
    start = _started(rng, drawn, n, m)
    way = rng.random()
    if way < 0.5:
        start = replace(start, tolerance=float(f"{10 ** rng.uniform(-4, -1.1):.3g}"))
    elif way < 0.8:
        start = replace(start, tolerance=float(f"{10 ** rng.uniform(-15, -12):.3g}"))
    else:
        start = replace(start, length=float(f"{rng.uniform(10, 25):.4g}"))
    return assembled(number, name, "coarse", drawn, start)


HARDSHIPS: dict[str, Callable[[Generator, int], Draw]] = {
    "passing": _passing, "turning": _turning, "moved": _moved, "late": _late, "thrown": _thrown,
    "together": _together, "fast": _fast, "symmetric": _symmetric, "rim": _on_the_rim, "coarse": _coarse,
}  # fmt: skip
"""How the other draws are made to be hard."""
