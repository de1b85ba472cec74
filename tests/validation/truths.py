"""What is true of a drawn run, from the judge's motions alone, for each claim that audits hold against any law."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tests.validation.draws import Draw
from tests.validation.judge.formulas import Node, derivative, parsed
from tests.validation.judge.motion import Judge, Motion

SETTLED = 1e-2
BALANCED = 1e-3
"""Thresholds of the claims about settling, as general_claims states them; within a factor 2 of them all is open."""

SURE = 1e3
"""Distances and speeds that are not this many times the judge's own error decide nothing."""


@dataclass(frozen=True)
class Truth:
    """The judge's motion, the error of its positions, why it knows less than all, and truths by claim (None: open)."""

    motion: Motion
    error: float
    trouble: str
    claims: dict[str, bool | None]
    margin: float

    @property
    def slowest(self) -> float:
        """Smallest rate at which a distance crosses a radius."""
        return min((abs(x.speed) for x in self.motion.switches), default=math.inf)


def truth(draw: Draw, judge: Judge) -> Truth:
    """Run the judge twice; what both runs agree on is known."""
    rough = judge.motion(draw.problem)
    motion = judge.motion(draw.problem, tighter=True)
    if rough.status != "done" or motion.status != "done":
        return Truth(motion, math.inf, motion.status, {}, 0.0)
    size = max(1.0, float(np.abs(motion.q).max()))
    error = float(max(np.abs(motion.q - rough.q).max(), np.abs(motion.p - rough.p).max())) + 1e-18 * size
    trouble = ""
    if [(x.kind, x.graph, x.pair) for x in rough.switches] != [(x.kind, x.graph, x.pair) for x in motion.switches]:
        trouble = "switches depend on the judge's own error"
    margin = discrete_margin(motion)
    if margin < SURE * error:
        trouble = trouble or "a tangency within the judge's own error"
    if error > 1e-6 * size:
        trouble = trouble or "chaotic beyond the judge's digits"
    claims = _claims(draw, motion, error)
    if trouble:
        discrete = ("connected", "links-kept", "switching-stops", "crossings-transversal", "linked-apart")
        claims = {k: None if k in discrete else v for k, v in claims.items()}
    return Truth(motion, error, trouble, claims, margin)


def discrete_margin(motion: Motion) -> float:
    """By how much distances would have to change to add or remove a switch."""
    near = [abs(x.gap) for x in motion.grazes]
    # A pair that crosses at speed v and is turned back by b goes v^2/2b beyond.
    past = [x.speed**2 / (2 * abs(x.bend)) if x.bend else abs(x.speed) for x in motion.switches]
    return min([*near, *past], default=math.inf)


def _claims(draw: Draw, motion: Motion, error: float) -> dict[str, bool | None]:
    broken = [x for x in motion.switches if x.graph == 0 and x.kind == "break"]
    own = [x for x in motion.switches if x.graph == 0]
    slowest = min((abs(x.speed) for x in own), default=math.inf)
    n = len(draw.problem.q)
    span = motion.time
    quiet = (span - own[-1].time) / span if own else 1.0
    supplied = draw.problem.follow is not None
    # Central forces without a stated energy have one all the same, their integral: drags alone change it.
    central = any(x.force for part in draw.problem.parts for x in part.pieces)
    passive = central or motion.rise <= SURE * error * (1.0 + abs(motion.energies[0]))
    balanced, softest = _equilibrium(draw, motion)
    return {
        "ledger": True,
        "momentum": True,
        "energy-falls": True if passive and not supplied else None if supplied else False,
        "velocities-agree": _settled(_spread_at_end(draw, motion), motion.spread, error),
        "distances-settle": _settled(_rate_at_end(motion), 2 * motion.spread, error),
        "connected": all(_connected(n, x) for x in motion.links),
        "links-kept": not broken,
        "switching-stops": None if abs(quiet - 0.1) < 1e-3 else quiet > 0.1,
        "crossings-transversal": True if slowest > SURE * error else None,
        "linked-apart": _apart(motion.closest_linked.distance, error, draw),
        "all-apart": _apart(min(motion.closest_linked.distance, motion.closest_unlinked.distance), error, draw),
        "forces-vanish": balanced,
        "potential-minimal": None if not balanced or -1e-2 < softest < -1e-4 else softest > -1e-3,
    }


def starts_connected(draw: Draw, motion: Motion) -> bool:
    return _connected(len(draw.problem.q), motion.links[0])


def _connected(n: int, links: frozenset[tuple[int, int]]) -> bool:
    reached, last = {0}, 0
    while len(reached) != last:
        last = len(reached)
        reached |= {b for a, b in links if a in reached} | {a for a, b in links if b in reached}
    return len(reached) == n


def _apart(distance: float, error: float, draw: Draw) -> bool | None:
    same = any((draw.problem.q[i] == draw.problem.q[j]).all() for i in range(len(draw.problem.q)) for j in range(i))
    if same or (draw.line and distance < 1e-15):
        return False
    return True if distance > SURE * error else None


def _settled(value: float, largest: float, error: float) -> bool | None:
    if largest <= SURE * error:
        return None
    ratio = value / largest
    return None if SETTLED / 2 < ratio < 2 * SETTLED else ratio < SETTLED


def _spread_at_end(draw: Draw, motion: Motion) -> float:
    masses = draw.problem.masses if draw.problem.masses is not None else np.ones(len(draw.problem.q))
    p = motion.p[-1]
    mean = (masses[:, None] * p).sum(axis=0) / masses.sum()
    return float(np.sqrt(((p - mean) ** 2).sum(axis=1)).max())


def _rate_at_end(motion: Motion) -> float:
    q, p = motion.q[-1], motion.p[-1]
    i, j = np.triu_indices(len(q), 1)
    d, v = q[j] - q[i], p[j] - p[i]
    r = np.sqrt((d * d).sum(axis=1))
    return float(np.abs((d * v).sum(axis=1) / np.where(r > 0, r, 1)).max())


def _equilibrium(draw: Draw, motion: Motion) -> tuple[bool | None, float]:
    """Whether the potential forces balance at the end, and the smallest stiffness as a share of the largest.

    Forces are measured by stiffness times length. Nothing is said where forces are no slopes of energies, nor
    where two agents that are linked end at one point.
    """
    q = motion.q[-1].astype(float)
    n, m = q.shape
    forces, hessian, lengths = np.zeros((n, m)), np.zeros((n * m, n * m)), []
    for part in draw.problem.parts:
        if not any(x.energy or x.force for x in part.pieces):
            continue
        if part.graph != 0 or any(x.force for x in part.pieces):
            return None, 0.0
        for i, j in motion.links[-1]:
            d = q[j] - q[i]
            r = float(np.linalg.norm(d))
            if r == 0.0:
                return None, 0.0
            piece = next(x for x in part.pieces if r <= x.border or x is part.pieces[-1])
            psi = parsed(piece.energy.replace("s", "(r*r)") if "s -" in piece.energy else piece.energy, part.values)
            first = derivative(psi, "r")
            slope, bend = (value_of(x, r) for x in (first, derivative(first, "r")))
            normal = d / r
            block = bend * np.outer(normal, normal) + slope / r * (np.eye(m) - np.outer(normal, normal))
            forces[i] += slope * normal
            forces[j] -= slope * normal
            for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
                hessian[a * m : a * m + m, b * m : b * m + m] += sign * block
            lengths.append(r)
    if not lengths:
        return None, 0.0
    stiffness = np.linalg.eigvalsh(hessian)
    size = float(np.abs(stiffness).max() * np.mean(lengths))
    if not size > 0:
        return None, 0.0
    ratio = float(np.linalg.norm(forces, axis=1).max()) / size
    softest = float(stiffness[0] / np.abs(stiffness).max())
    return None if BALANCED / 2 < ratio < 2 * BALANCED else ratio < BALANCED, softest


def value_of(node: Node, r: float) -> float:
    """Value of a tree at distance ``r`` in doubles."""
    x = node.operation
    if x == "input":
        return r
    if x in ("constant", "pi"):
        return math.pi if x == "pi" else float(node.value)
    a = [value_of(y, r) for y in node.arguments]
    simple = {"add": lambda: a[0] + a[1], "subtract": lambda: a[0] - a[1], "multiply": lambda: a[0] * a[1],
              "divide": lambda: a[0] / a[1], "power": lambda: a[0] ** float(node.value)}  # fmt: skip
    return float(simple[x]()) if x in simple else float(getattr(math, x)(*a))
