"""Laws to hold against the contracts. A new part is registered once, in `STRUCTURES`, and every contract tries it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from hypothesis import strategies as st

import flocking as fk
from flocking.model.graphs.distance_graphs import pair_distances
from flocking.model.potentials.bumps import BUMPS

RADIUS = 3.0
SMOOTH = fk.Smooth(RADIUS, 0.5)
SIGMA = fk.Smooth(RADIUS, 0.3, sigma_norm=0.4)


@dataclass(frozen=True)
class Draw:
    """Random parameters of one law: ``n`` agents in ``m`` dimensions."""

    rng: np.random.Generator
    n: int
    m: int

    def one(self, low: float = 0.2, high: float = 2.0) -> float:
        return float(self.rng.uniform(low, high))

    def each(self) -> np.ndarray:
        return self.rng.uniform(0.2, 2.0, self.n)

    def vector(self) -> np.ndarray:
        return self.rng.normal(size=self.m)

    def zhou(self) -> fk.Gradient:
        return fk.Gradient(fk.Potential("k/r + 1/(R - r)", k=self.one(), R=RADIUS + self.one()))

    def tanner(self, cap: bool = False) -> fk.Gradient:
        psi = fk.Potential("a/r^2 + log(r^2)", a=self.one())
        return fk.Gradient(psi.capped(RADIUS - 0.5) if cap else psi)

    def matrix(self, symmetric: bool) -> np.ndarray:
        w = self.rng.uniform(0, 1, (self.n, self.n))
        return w + w.T if symmetric else w

    def path(self) -> fk.Path:
        formulas = ["a*sin(t)", "cos(2*t)", "t"][: self.m]
        return fk.Path(formulas, start=self.vector(), a=self.one())

    def moving(self) -> fk.Velocity:
        return fk.Velocity(self.vector(), start=self.vector(), start_time=self.one())

    def proximity(self) -> fk.Proximity:
        return fk.Proximity(self.one(1.0, RADIUS))

    def hysteresis(self) -> fk.Hysteresis:
        return fk.Hysteresis(self.one(1.0, RADIUS), 0.2)

    def radii(self) -> fk.PerAgentRadii:
        return fk.PerAgentRadii(self.rng.uniform(1.0, RADIUS, self.n))

    def avoid(self) -> fk.Avoid:
        bodies = [fk.Ball(self.moving(), self.one()) for _ in range(3)] + [fk.Wall(self.vector(), self.vector())]
        settings = {"repulsion_gain": self.one(), "damping_gain": self.one(), "offset": self.one(), "onset": 0.6}
        return fk.Avoid(bodies, self.path(), range=self.one(1.0, 2.0), **settings)

    def fading(self) -> fk.Avoid:
        bodies = [fk.Ball(self.moving(), self.one()) for _ in range(3)] + [fk.Wall(self.vector(), self.vector())]
        settings = {"repulsion_gain": self.one(), "damping_gain": self.one(), "onset": 0.6, "sigma_norm": self.one()}
        return fk.Avoid(bodies, range=self.one(1.0, 2.0), gamma_agents=False, fading_damping=True, **settings)

    def fixed(self, directed: bool = False) -> fk.Fixed:
        pairs = [(i, j) for i in range(self.n) for j in range(self.n) if i != j and self.rng.random() < 0.4]
        return fk.Fixed(self.n, pairs, directed=directed)


@dataclass(frozen=True)
class Structure:
    """One law structure.

    Parameters
    ----------
    make
        Draws its parameters.
    conservative
        Whether, at rest, its force is minus the gradient of its storage.
    brute
        Force of a part from outside on agent i by agent j, (term, draw, i, j, q, p) -> (m,), by class.
    """

    make: Callable[[Draw], fk.Law]
    conservative: bool = True
    brute: dict[type, Callable[..., np.ndarray]] = field(default_factory=dict)


def _law(graph: Callable[[Draw], fk.Graph], *terms: Callable[[Draw], object]) -> Callable[[Draw], fk.Law]:
    return lambda d: fk.Law(graph(d), [term(d) for term in terms])


def _hashed(d: Draw) -> fk.Consensus:
    return fk.Consensus(d.one(), weights=fk.HashedWeights(0.1, 1.0, int(d.rng.integers(1000))))


def _smooth_slope(term: fk.Gradient, i: int, j: int, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    r = float(np.linalg.norm(q[j] - q[i]))
    rho, slope = (f(r / SMOOTH.radius, SMOOTH.onset) for f in (SMOOTH.shape, SMOOTH.shape.slope))
    along = float(rho * term.potential.slope(r) + slope / SMOOTH.radius * term.potential(r))
    return along * (q[j] - q[i]) / r


def _sigma(length: float, epsilon: float) -> float:
    return float((np.sqrt(1 + epsilon * length**2) - 1) / epsilon)


def _sigma_slope(term: fk.Gradient, i: int, j: int, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    r = float(np.linalg.norm(q[j] - q[i]))
    rho = float(BUMPS["cosine"](_sigma(r, 0.4) / _sigma(RADIUS, 0.4), 0.3))
    return rho * float(term.potential.slope(r)) * (q[j] - q[i]) / r


def _sigma_drag(term: fk.Consensus, i: int, j: int, q: np.ndarray, p: np.ndarray) -> np.ndarray:
    r = float(np.linalg.norm(q[j] - q[i]))
    return term.gain * float(BUMPS["cosine"](_sigma(r, 0.4) / _sigma(RADIUS, 0.4), 0.3)) * (p[j] - p[i])


def _faded(term: fk.Avoid, case: Case, i: int) -> np.ndarray:
    """beta-agents whose bump compares sigma-norms and multiplies the damping too."""
    u = np.zeros_like(case.state.q[i])
    for body in term.obstacles:
        seen = {name: value[0] for name, value in body.at(case.state.q[[i]], case.state.p[[i]], case.state.t).items()}
        if seen["distance"] <= term.range:
            share = _sigma(abs(seen["distance"]), term.sigma_norm) / _sigma(term.range, term.sigma_norm)
            rho = float(BUMPS["cosine"](share, term.onset))
            u -= term.repulsion_gain * rho * float(term.repulsion.slope(seen["distance"])) * seen["normal"]
            u += term.damping_gain * rho * (seen["boundary"] - case.state.p[i])
    return u


def _avoided(term: fk.Avoid, case: Case, i: int) -> np.ndarray:
    """(54) from the geometry of each obstacle."""
    q, p, t = case.state.q[i], case.state.p[i], case.state.t
    heading = term.leader.at(t)[1]
    u = np.zeros_like(q)
    for body in term.obstacles:
        seen = {name: value[0] for name, value in body.at(q[None], p[None], t).items()}
        if seen["distance"] > term.range:
            continue
        rho = float(BUMPS["cosine"](seen["distance"] / term.range, term.onset))
        u -= term.repulsion_gain * rho * float(term.repulsion.slope(seen["distance"])) * seen["normal"]
        u += term.damping_gain * (seen["boundary"] - p)
        if isinstance(body, fk.Ball):
            away = body.centre.at(t)[0] + term.offset * heading / np.linalg.norm(heading) - q
            far = float(np.linalg.norm(away))
            u += float(term.attraction.slope(far)) * away / far
    return u


STRUCTURES: dict[str, Structure] = {
    "smooth": Structure(
        _law(lambda d: SMOOTH, Draw.zhou, lambda d: fk.Consensus(d.one())), brute={fk.Gradient: _smooth_slope}
    ),
    "sigma-norms": Structure(
        _law(
            lambda d: SIGMA,
            lambda d: fk.Gradient(fk.Potential("exp(-r)*k + r**2/9", k=d.one()), weighting="force"),
            lambda d: fk.Consensus(d.one(), weighted=True),
        ),
        brute={fk.Gradient: _sigma_slope, fk.Consensus: _sigma_drag},
    ),
    "fading obstacles": Structure(
        _law(Draw.proximity, Draw.zhou, Draw.fading), conservative=False, brute={fk.Avoid: _faded}
    ),
    "radii per agent": Structure(_law(Draw.radii, Draw.zhou, lambda d: fk.Consensus(d.one())), conservative=False),
    "obstacles": Structure(_law(Draw.proximity, Draw.zhou, Draw.avoid), conservative=False, brute={fk.Avoid: _avoided}),
    "gradient, proximity": Structure(_law(Draw.proximity, Draw.zhou)),
    "gradient, hysteresis": Structure(_law(Draw.hysteresis, Draw.tanner)),
    "gradient, fixed": Structure(_law(Draw.fixed, Draw.tanner)),
    "capped": Structure(_law(lambda d: fk.Proximity(RADIUS + 1), lambda d: d.tanner(cap=True))),
    "smoothed": Structure(
        _law(Draw.fixed, lambda d: fk.Gradient(fk.Potential("d*(r - 1)^2", d=d.one()).smoothed(2.5, 1.5)))
    ),
    "tanner": Structure(_law(Draw.fixed, Draw.tanner, lambda d: fk.Consensus())),
    "zhou": Structure(_law(Draw.hysteresis, Draw.zhou, lambda d: fk.Consensus(d.one()))),
    "two potentials": Structure(_law(Draw.proximity, Draw.zhou, Draw.tanner, lambda d: fk.Consensus(d.one()))),
    "two graphs": Structure(
        _law(
            Draw.hysteresis,
            Draw.zhou,
            lambda d: fk.Consensus(d.one(), over=d.proximity()),
            lambda d: fk.Gradient(fk.Potential("(r - 1)^2*k", k=d.one()), over=fk.Proximity(2.0)),
        )
    ),
    "agent gains": Structure(_law(Draw.proximity, Draw.zhou, lambda d: fk.Consensus(d.each()))),
    "hashed weights": Structure(_law(Draw.fixed, Draw.tanner, _hashed)),
    "alignment of all pairs": Structure(
        _law(lambda d: fk.Complete(), Draw.tanner, lambda d: fk.CuckerSmale(d.one(), d.one(), d.one()))
    ),
    "averages": Structure(_law(Draw.hysteresis, Draw.zhou, lambda d: fk.VelocityAverage(d.each()))),
    "alignment over a graph": Structure(
        _law(Draw.hysteresis, Draw.zhou, lambda d: fk.CuckerSmale(d.one(), d.one(), over=fk.Complete()))
    ),
    "even weights": Structure(_law(Draw.fixed, lambda d: fk.Consensus(weights=d.matrix(True)))),
    "uneven weights": Structure(_law(Draw.fixed, lambda d: fk.Consensus(d.one(), weights=d.matrix(False)))),
    "directed": Structure(_law(lambda d: d.fixed(directed=True), Draw.tanner, _hashed), conservative=False),
    "sink": Structure(_law(Draw.hysteresis, Draw.zhou, lambda d: fk.Track(fk.Sink(d.vector()), d.one(), d.one()))),
    "sink, masses, agent gains": Structure(
        _law(Draw.proximity, Draw.zhou, lambda d: fk.Track(fk.Sink(d.vector()), d.each(), d.each(), per_mass=True))
    ),
    "velocity leader": Structure(
        _law(Draw.hysteresis, Draw.zhou, lambda d: fk.Consensus(), lambda d: fk.Track(d.moving())), conservative=False
    ),
    "path leader": Structure(
        _law(Draw.proximity, Draw.tanner, lambda d: fk.Track(d.path(), d.one(), d.each(), 1.0, per_mass=True)),
        conservative=False,
    ),
    "shi": Structure(
        _law(
            Draw.proximity,
            lambda d: d.tanner(cap=True),
            _hashed,
            lambda d: fk.Track(d.path(), 0.0, d.each(), d.each(), per_mass=True),
            lambda d: fk.Compensate(),
        ),
        conservative=False,
    ),
    "shared feedback": Structure(
        _law(Draw.proximity, Draw.zhou, lambda d: fk.Track(fk.Sink(d.vector()), d.one(), d.one(), shared=True)),
        conservative=False,
    ),
    "saturated feedback": Structure(
        _law(Draw.proximity, Draw.zhou, lambda d: fk.Track(fk.Sink(d.vector()), d.one(), d.one(), saturated=True)),
        conservative=False,
    ),
    "compensated": Structure(_law(Draw.proximity, Draw.zhou, lambda d: fk.Compensate())),
}


@dataclass(frozen=True)
class Case:
    """One law with a state and agents it can act on."""

    structure: Structure
    law: fk.Law
    state: fk.State
    agents: fk.Agents
    rng: np.random.Generator = field(compare=False)

    @property
    def links(self) -> list[np.ndarray]:
        """Links of every graph of the law."""
        rest = [g.initial(self.state.q) for g in self.law.graphs[1:]]
        return [np.asarray(self.state.links), *rest]

    def with_state(self, **changes: object) -> Case:
        values = {name: getattr(self.state, name) for name in ("q", "p", "t", "links")}
        return Case(self.structure, self.law, fk.State(**{**values, **changes}), self.agents, self.rng)


def case_of(structure: Structure, n: int, m: int, seed: int) -> Case:
    """A random law of one structure, with a random state in which no pair is close to a border of a formula."""
    rng = np.random.default_rng(seed)
    law = structure.make(Draw(rng, n, m))
    borders = [0.0, *(k for t in law.pair_terms for k in t.kinks())]
    radii = np.concatenate([np.ravel(g.break_radius) for g in law.graphs])
    borders += [*(k for g in law.graphs for k in g.kinks()), *radii[np.isfinite(radii)].tolist()]
    while True:
        q = rng.normal(size=(n, m)) * 1.2 * n ** (1 / m)
        distances = pair_distances(q)
        if all(abs(distances - b).min() > (0.3 if b == 0 else 1e-3) for b in borders):
            break
    agents = fk.Agents(rng.uniform(0.5, 2, n), rng.uniform(0, 1, n))
    state = fk.State(q, rng.normal(size=(n, m)), float(rng.uniform(0, 3)), law.graph.initial(q))
    return Case(structure, law, state, agents, rng)


@st.composite
def laws(draw, names=None, dimensions=(1, 2, 3), smallest=1):
    """Cases of all registered structures, or those in ``names``."""
    name = draw(st.sampled_from(sorted(STRUCTURES if names is None else names)))
    n, m = draw(st.integers(smallest, 7)), draw(st.sampled_from(dimensions))
    return case_of(STRUCTURES[name], n, m, draw(st.integers(0, 2**32)))
