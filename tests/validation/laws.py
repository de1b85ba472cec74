"""Laws of a few structures with drawn parameters, each stated twice: for the library, and for the judge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

import flocking as fk
from tests.validation.judge.motion import Follow, Links, PairPart, Piece

Generator = np.random.Generator


@dataclass(frozen=True)
class Drawn:
    """A law with its parameters in both forms.

    ``radius`` is where links of its own graph change; ``scale`` a typical distance. ``even`` laws have a force that
    is smooth where two agents coincide, ``singular`` ones one that is infinite there. ``free`` laws exert no force
    on agents that are not linked, so that a radius can be set by where they go; ``shifted`` ones look the same from
    every place and frame of reference, ``ageless`` ones at every time.
    """

    law: fk.Law
    graphs: tuple[Links, ...]
    parts: tuple[PairPart, ...]
    radius: float
    scale: float
    agents: fk.Agents = field(default_factory=fk.Agents)
    energy: fk.Energy = field(default_factory=fk.Energy)
    follow: Follow | None = None
    even: bool = False
    singular: bool = False
    free: bool = False
    shifted: bool = True
    ageless: bool = True


def _log(rng: Generator, low: float, high: float) -> float:
    """A number between, evenly on a logarithmic scale, with few digits."""
    return float(f"{np.exp(rng.uniform(np.log(low), np.log(high))):.5g}")


def _even(rng: Generator, low: float, high: float) -> float:
    return float(f"{rng.uniform(low, high):.5g}")


def _gain(rng: Generator) -> float:
    return 0.0 if rng.random() < 0.2 else _log(rng, 0.03, 3.0)


def _edges(rng: Generator, n: int) -> tuple[tuple[int, int], ...]:
    """A chain and some more pairs."""
    found = {(k, k + 1) for k in range(n - 1)}
    found |= {(i, j) for i in range(n) for j in range(i + 2, n) if rng.random() < 0.5}
    return tuple(sorted(found))


def _near(radius: float) -> tuple[Links, ...]:
    return (Links(radius, radius),)


def _drag(gain: float, graph: int = 0) -> PairPart:
    return PairPart((Piece(drag="c"),), {"c": gain}, graph)


def springs(rng: Generator, n: int, m: int) -> Drawn:
    """Springs between agents that sense each other: the force jumps where a link changes."""
    radius, c = _even(rng, 1.2, 2.5), _gain(rng)
    values = {"k": _log(rng, 0.1, 3.0), "d": _even(rng, 0.4, 1.1)}
    psi = fk.Potential("k*(r - d)**2/2", **values)
    return Drawn(
        fk.Law(fk.Proximity(radius), [fk.Gradient(psi), fk.Consensus(c)]), _near(radius),
        (PairPart((Piece("k*(r - d)**2/2"),), values), _drag(c)), radius, radius, free=True,
    )  # fmt: skip


def watched(rng: Generator, n: int, m: int) -> Drawn:
    """Springs over given pairs, consensus (or nothing) over those that sense each other."""
    radius, c, edges = _even(rng, 0.8, 3.0), _gain(rng) * (rng.random() < 0.5), _edges(rng, n)
    values = {"k": _log(rng, 0.1, 3.0), "d": _even(rng, 0.5, 2.0)}
    spring = fk.Gradient(fk.Potential("k*(r - d)**2/2", **values), over=fk.Fixed(n, edges))
    return Drawn(
        fk.Law(fk.Proximity(radius), [spring, fk.Consensus(c)]), (Links(radius, radius), Links(fixed=edges)),
        (PairPart((Piece("k*(r - d)**2/2"),), values, 1), _drag(c)), radius, 2.0,
    )  # fmt: skip


def barriers(rng: Generator, n: int, m: int) -> Drawn:
    """Links that cannot break, with hysteresis (Zhou (8))."""
    radius = _even(rng, 2.0, 4.0)
    gap, c = _even(rng, 0.05, 0.5), _log(rng, 0.1, 2.0)
    psi = fk.Potential("1/r + 1/(R - r)", R=radius)
    return Drawn(
        fk.Law(fk.Hysteresis(radius, gap), [fk.Gradient(psi), fk.Consensus(c)]), (Links(radius - gap, radius),),
        (PairPart((Piece("1/r + 1/(R - r)"),), {"R": radius}), _drag(c)), radius - gap, radius, singular=True,
        free=True,
    )  # fmt: skip


def logarithms(rng: Generator, n: int, m: int) -> Drawn:
    """A fixed net (Tanner I (5))."""
    c, edges, values = _gain(rng), _edges(rng, n), {"a": _log(rng, 0.2, 2.0)}
    psi = fk.Potential("a/r**2 + log(r**2)", **values)
    return Drawn(
        fk.Law(fk.Fixed(n, edges), [fk.Gradient(psi), fk.Consensus(c)]), (Links(fixed=edges),),
        (PairPart((Piece("a/r**2 + log(r**2)"),), values), _drag(c)), np.inf, 2.0, singular=True,
    )  # fmt: skip


def capped(rng: Generator, n: int, m: int) -> Drawn:
    """A potential that stays constant from the radius on (Tanner II (5))."""
    radius, c, values = _even(rng, 1.5, 3.0), _gain(rng), {"a": _log(rng, 0.2, 2.0)}
    psi = fk.Potential("a/r**2 + log(r**2)", **values).capped(radius)
    top = values["a"] / radius**2 + np.log(radius**2)
    return Drawn(
        fk.Law(fk.Proximity(radius), [fk.Gradient(psi), fk.Consensus(c)]), _near(radius),
        (PairPart((Piece("a/r**2 + log(r**2)"),), values), _drag(c)), radius, radius,
        energy=fk.Energy(unlinked=float(top)), singular=True, free=True,
    )  # fmt: skip


_COSINE = "((1 + cos(pi*(r/R - k)/(1 - k)))/2)"
_QUINTIC = "(((1 - r/R)/(1 - k))**3*(1 + 3*(r/R - k)/(1 - k) + 6*((r/R - k)/(1 - k))**2))"


def _smooth(rng: Generator, bump: str, weighting: str, weighted: bool) -> Drawn:
    radius, onset = _even(rng, 1.5, 2.5), _even(rng, 0.3, 0.9)
    c, scale, d = _gain(rng), _log(rng, 0.3, 3.0), _even(rng, 0.5, 1.3)
    psi = fk.Potential("a*(r - d)**2", a=scale, d=d)
    fade = _COSINE if bump == "cosine" else _QUINTIC
    border, values = onset * radius, {"a": scale, "d": d, "R": radius, "k": onset, "c": c}
    drags = ("c", f"c*{fade}") if weighted else ("c", "c")
    if weighting == "energy":
        energies = (Piece("a*(r - d)**2", border), Piece(f"a*(r - d)**2*{fade}", radius))
    else:
        energies = (Piece(force="2*a*(r - d)", border=border), Piece(force=f"2*a*(r - d)*{fade}", border=radius))
    return Drawn(
        fk.Law(fk.Smooth(radius, onset, bump), [fk.Gradient(psi, weighting), fk.Consensus(c, weighted=weighted)]),
        _near(radius),
        (PairPart(energies, values), PairPart((Piece(drag=drags[0], border=border), Piece(drag=drags[1])), values)),
        radius, radius, free=True,
    )  # fmt: skip


def smooth_energies(rng: Generator, n: int, m: int) -> Drawn:
    """Energies that fade out (Olfati-Saber (35), the drag as printed)."""
    return _smooth(rng, "cosine", "energy", False)


def smooth_forces(rng: Generator, n: int, m: int) -> Drawn:
    """Forces and drags that fade out (Olfati-Saber (36))."""
    return _smooth(rng, "cosine", "force", True)


def smooth_quintic(rng: Generator, n: int, m: int) -> Drawn:
    """Energies and drags that fade out with two continuous derivatives."""
    return _smooth(rng, "quintic", "energy", True)


def narrow(rng: Generator, n: int, m: int, width: float | None = None) -> Drawn:
    """A well, and beyond it a barrier of a given width."""
    w = _log(rng, 0.03, 0.1) if width is None else width
    c = _gain(rng) / 10
    psi = fk.Potential("where(r < 2.5, 10*(r - 1)**2 - 22.5, h*exp(-((r - 3)/w)**2))", h=50.0, w=w)
    # Farther from its middle than 9 widths the barrier is below 1e-33; nearer, its logarithm's slope is at most 18/w.
    far, values = 9 * w, {"h": 50.0, "w": w}
    pieces = [Piece("10*(r - 1)**2 - 22.5", 2.5)]
    if 3 - far > 2.5:
        pieces.append(Piece("0*r", 3 - far))
    pieces += [Piece("h*exp(-((r - 3)/w)**2)", 3 + far, longest=w / 2), Piece("0*r")]
    radius = 8.0
    return Drawn(
        fk.Law(fk.Proximity(radius), [fk.Gradient(psi), fk.Consensus(c)]), _near(radius),
        (PairPart(tuple(pieces), values), _drag(c)), radius, 4.0,
    )  # fmt: skip


def even(rng: Generator, n: int, m: int) -> Drawn:
    """A force that is smooth where agents coincide."""
    c, edges = _gain(rng), tuple((i, j) for i in range(n) for j in range(i + 1, n))
    values = {"k": _log(rng, 0.1, 2.0), "d": _even(rng, 0.5, 1.5)}
    psi = fk.Potential("k*(r**2 - d**2)**2/4", **values)
    return Drawn(
        fk.Law(fk.Fixed(n, edges), [fk.Gradient(psi), fk.Consensus(c)]), (Links(fixed=edges),),
        (PairPart((Piece("k*(s - d**2)**2/4"),), values), _drag(c)), np.inf, 2.0, even=True,
    )  # fmt: skip


def powers(rng: Generator, n: int, m: int) -> Drawn:
    """Powers of the distance that are not whole, with hysteresis."""
    radius = _even(rng, 1.5, 3.0)
    gap, c = _even(rng, 0.05, 0.5), _gain(rng)
    values = {"a": _log(rng, 0.2, 2.0), "b": _log(rng, 0.2, 2.0)}
    psi = fk.Potential("a*r**1.5 + b*r**-0.5", **values)
    return Drawn(
        fk.Law(fk.Hysteresis(radius, gap), [fk.Gradient(psi), fk.Consensus(c)]), (Links(radius - gap, radius),),
        (PairPart((Piece("a*r**1.5 + b*r**-0.5"),), values), _drag(c)), radius - gap, radius, singular=True, free=True,
    )  # fmt: skip


def exponentials(rng: Generator, n: int, m: int) -> Drawn:
    """Attraction and repulsion that fall off exponentially (Morse)."""
    c, edges = _gain(rng), tuple((i, j) for i in range(n) for j in range(i + 1, n))
    values = {"a": _log(rng, 0.5, 2.0), "b": _log(rng, 1.0, 4.0), "l": _even(rng, 1.0, 2.0), "g": _even(rng, 0.3, 0.9)}
    text = "b*exp(-r/g) - a*exp(-r/l)"
    psi = fk.Potential(text, **values)
    return Drawn(
        fk.Law(fk.Fixed(n, edges), [fk.Gradient(psi), fk.Consensus(c)]), (Links(fixed=edges),),
        (PairPart((Piece(text),), values), _drag(c)), np.inf, 2.0,
    )  # fmt: skip


def pursuit(rng: Generator, n: int, m: int) -> Drawn:
    """Springs, and a leader with constant velocity that some agents know (Zhou (24))."""
    radius, c = _even(rng, 1.2, 2.5), _gain(rng)
    values = {"k": _log(rng, 0.1, 3.0), "d": _even(rng, 0.4, 1.1)}
    speed, place = (tuple(_even(rng, -1, 1) for _ in range(m)) for _ in range(2))
    gains = [np.array([_log(rng, 0.1, 2.0) * (rng.random() < 0.7 or k == 0) for k in range(n)]) for _ in range(2)]
    track = fk.Track(fk.Velocity(speed, place), position_gain=gains[0], velocity_gain=gains[1])
    psi = fk.Potential("k*(r - d)**2/2", **values)
    names = {f"v{k}": x for k, x in enumerate(speed)}
    return Drawn(
        fk.Law(fk.Proximity(radius), [fk.Gradient(psi), fk.Consensus(c), track]), _near(radius),
        (PairPart((Piece("k*(r - d)**2/2"),), values), _drag(c)), radius, radius,
        follow=Follow(tuple(f"v{k} + 0*t" for k in range(m)), names, place, *gains, np.zeros(n)),
        shifted=False, ageless=False,
    )  # fmt: skip


def circling(rng: Generator, n: int, m: int) -> Drawn:
    """A fixed net, and a leader whose velocity turns, with its acceleration known to some (Shi (12), (15))."""
    c, edges, values = _gain(rng), _edges(rng, n), {"k": _log(rng, 0.1, 3.0), "d": _even(rng, 0.4, 1.1)}
    turn = {"a": _log(rng, 0.2, 2.0), "w": _log(rng, 0.3, 3.0)}
    texts = ["a*sin(w*t)", "a*cos(w*t)", "a*sin(w*t/2)"][:m]
    gain = np.array([_log(rng, 0.1, 2.0) for _ in range(n)])
    known = np.array([float(rng.random() < 0.5) for _ in range(n)])
    track = fk.Track(fk.Path(texts, **turn), velocity_gain=gain, acceleration_gain=known)
    psi = fk.Potential("k*(r - d)**2/2", **values)
    return Drawn(
        fk.Law(fk.Fixed(n, edges), [fk.Gradient(psi), fk.Consensus(c), track]), (Links(fixed=edges),),
        (PairPart((Piece("k*(r - d)**2/2"),), values), _drag(c)), np.inf, 2.0,
        follow=Follow(tuple(texts), turn, (0.0,) * m, np.zeros(n), gain, known), shifted=False, ageless=False,
    )  # fmt: skip


def damped(rng: Generator, n: int, m: int) -> Drawn:
    """Agents of different masses in a resistive medium, with weights of their own for each neighbour."""
    radius, c = _even(rng, 1.5, 3.0), _log(rng, 0.1, 1.0)
    values = {"k": _log(rng, 0.2, 2.0), "d": _even(rng, 0.4, 1.1)}
    weights = np.array([[0.0 if i == j else _log(rng, 0.2, 2.0) for j in range(n)] for i in range(n)])
    masses, damping = np.array([_log(rng, 0.3, 3.0) for _ in range(n)]), np.array([_gain(rng) for _ in range(n)])
    psi = fk.Potential("k*(r - d*log(r))", **values)
    return Drawn(
        fk.Law(fk.Proximity(radius), [fk.Gradient(psi), fk.Consensus(c, weights=weights)]), _near(radius),
        (
            PairPart((Piece("k*(r - d*log(r))"),), values),
            PairPart((Piece(drag="c"),), {"c": c}, weights=weights),
        ),
        radius, radius, agents=fk.Agents(masses, damping), singular=True, free=not damping.any(),
        shifted=not damping.any(),
    )  # fmt: skip


def flights(rng: Generator, n: int, m: int) -> Drawn:
    """Nothing but a graph: agents fly straight."""
    radius = _even(rng, 1.0, 3.0)
    return Drawn(
        fk.Law(fk.Proximity(radius), [fk.Consensus(0.0)]), _near(radius), (_drag(0.0),), radius, radius,
        even=True, free=True,
    )  # fmt: skip


def hyperbolas(rng: Generator, n: int, m: int) -> Drawn:
    """A force that levels off, with hysteresis."""
    radius = _even(rng, 1.5, 3.0)
    gap, c = _even(rng, 0.05, 0.5), _gain(rng)
    values = {"k": _log(rng, 0.1, 2.0), "d": _even(rng, 0.5, 1.3)}
    psi = fk.Potential("k*log(cosh(r - d))", **values)
    return Drawn(
        fk.Law(fk.Hysteresis(radius, gap), [fk.Gradient(psi), fk.Consensus(c)]), (Links(radius - gap, radius),),
        (PairPart((Piece("k*log((exp(r - d) + exp(d - r))/2)"),), values), _drag(c)), radius - gap, radius, free=True,
    )  # fmt: skip


def waves(rng: Generator, n: int, m: int) -> Drawn:
    """A cosine well that ends smoothly inside the radius (Shi (3)): a kink of the second derivative."""
    radius, c, end = _even(rng, 2.0, 3.0), _gain(rng), _even(rng, 1.0, 1.9)
    values = {"b": _log(rng, 0.2, 2.0), "e": end}
    psi = fk.Potential("where(r < e, b*(1 + cos(pi*r/e)), 0)", **values)
    return Drawn(
        fk.Law(fk.Proximity(radius), [fk.Gradient(psi), fk.Consensus(c)]), _near(radius),
        (PairPart((Piece("b*(1 + cos(pi*r/e))", end), Piece("0*r")), values), _drag(c)), radius, radius, free=True,
    )  # fmt: skip


def bent(rng: Generator, n: int, m: int) -> Drawn:
    """Springs of different stiffness when pressed and when stretched, over all pairs."""
    c, edges = _gain(rng), tuple((i, j) for i in range(n) for j in range(i + 1, n))
    values = {"j": _log(rng, 0.5, 5.0), "k": _log(rng, 0.1, 1.0), "d": _even(rng, 0.5, 1.5)}
    psi = fk.Potential("where(r < d, j*(r - d)**2/2, k*(r - d)**2/2)", **values)
    pieces = (Piece("j*(r - d)**2/2", values["d"]), Piece("k*(r - d)**2/2"))
    return Drawn(
        fk.Law(fk.Fixed(n, edges), [fk.Gradient(psi), fk.Consensus(c)]), (Links(fixed=edges),),
        (PairPart(pieces, values), _drag(c)), np.inf, 2.0,
    )  # fmt: skip


FAMILIES: dict[str, Callable[..., Drawn]] = {
    f.__name__: f
    for f in (springs, watched, barriers, logarithms, capped, smooth_energies, smooth_forces, smooth_quintic, narrow,
              even, powers, exponentials, pursuit, circling, damped, flights, hyperbolas, waves, bent)
}  # fmt: skip
"""Structures by name. Each compiles one kernel for each number of dimensions it is drawn in."""
