"""Scenarios on which the kernels on many ranks are held against brute force and the tiled engine.

Borders of the domains fly with a group as a whole. So groups turn in open space, or fly through space that repeats:
every agent crosses the borders again and again.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import sympy

import flocking as fk
from flocking.arrays import Array
from flocking.engine.driver.registry import engine_named
from flocking.papers import ALL_KEYS, paper
from tests.engine.tiles import flow_laws
from tests.engine.tiles.laws import PerAgentRadii, structural
from tests.engine.tiles.laws import shi as shi_potential
from tests.engine.tiles.laws import zhou as zhou_law
from tests.mpi.laws import law, start

N = 150
STEP, T_END = 0.01, 0.5
PAPER_STEPS, PAPER_STEP = 100, 0.002
"""Steps of the scenarios of papers, and their length."""


RATE = 4 * np.pi
"""Rate at which groups turn: once in a run, in which an agent crosses a line through the origin twice."""


@dataclass(frozen=True)
class Turn(fk.BodyTerm):
    """A force under which agents turn about the origin in the plane of the first and the last axis: swirl J q - pull q.

    Parameters
    ----------
    swirl
        Force across the position: the rate times the damping, so that damping stops no agent that turns.
    pull
        Force to the origin: the square of the rate times the mass.
    """

    swirl: float | Array = 0.0
    pull: float | Array = 0.0

    @property
    def parameters(self):
        return {"swirl": self.swirl, "pull": self.pull}

    @property
    def structure(self):
        return ("Turn",)

    def force(self, x):
        swirl, pull = x.parameter("swirl"), x.parameter("pull")
        a, *between, b = x.q
        return [-swirl * b - pull * a, *[sympy.Integer(0) for _ in between], swirl * a - pull * b]

    def storage(self, x):
        return x.parameter("pull") * (x.q[0] ** 2 + x.q[-1] ** 2) / 2

    def balance(self, x):
        swirl, pull = x.parameter("swirl"), x.parameter("pull")
        a, b = x.q[0], x.q[-1]
        across = swirl * (a * (x.p[-1] - x.frame_p[-1]) - b * (x.p[0] - x.frame_p[0]))
        return sympy.Integer(0), across + pull * (a * x.frame_p[0] + b * x.frame_p[-1])


def turning(law, state, agents=None, *, drag=0.0):
    """A law with a term that lets its agents turn, and the state in which they do.

    Parameters
    ----------
    law, state, agents
        The law, a state about the origin, and the agents.
    drag
        Velocity gain of the law's own terms.
    """
    agents = agents or fk.Agents()
    if agents.order == 1:
        return fk.Law(law.graph, [*law.terms, Turn(RATE, 0.0)]), state
    undamped = any(isinstance(term, fk.Compensate) for term in law.terms)
    swirl = RATE * (drag + (0.0 if undamped else np.asarray(agents.damping)))
    pull = RATE**2 * np.asarray(agents.masses)
    if state.dimension == 2 and np.ndim(pull) == 0 and np.all(swirl == 0):
        # A part of the library, so that runs can be stored.
        term = fk.Track(fk.Sink(np.zeros(2)), position_gain=float(pull), velocity_gain=0.0)
    else:
        term = Turn(*(x if np.ndim(x) else float(x) for x in (swirl, pull)))
    p = state.p.copy()
    p[:, 0] -= RATE * state.q[:, -1]
    p[:, -1] += RATE * state.q[:, 0]
    return fk.Law(law.graph, [*law.terms, term]), fk.State(state.q, p, state.t, columns=state.columns)


def lattice_in_box(counts, side, speed, flight):
    """A square lattice that fills a box that repeats and flies through it.

    Parameters
    ----------
    counts, side
        Agents along each axis, and the distance between them.
    speed
        Standard deviation of the velocities.
    flight
        Lengths of the box that the group flies along each axis in a unit of time.
    """
    rng, lengths = np.random.default_rng(5), side * np.array(counts)
    places = np.stack(np.meshgrid(*[np.arange(k) for k in counts], indexing="ij"), axis=-1).reshape(-1, len(counts))
    q = side * (places + 0.5 + rng.uniform(-0.015, 0.015, places.shape))
    return fk.State(q, speed * rng.normal(size=q.shape) + flight * lengths), fk.Periodic(lengths.tolist())


def _lattice(dimension, side, n=N, speed=1.0, seed=3):
    state = start(dimension, n, seed=seed, speed=speed)
    return fk.State(state.q * side / 5.6, state.p)


def _zhou(*counts):
    """So even a lattice that no pair is near the radius of Zhou's law, where its potential is infinite."""
    state, space = lattice_in_box(counts, 2.15, 0.3, 4.0)
    return zhou_law(), state, {"space": space}


BOTH = np.arange(2 * N)
NEAR = fk.Hysteresis(6.4, 1.0)
DRAGS = {"olfati-saber (58), obstacles": 10.0, "schedule": 1.0}
"""Velocity gains of navigation, which would stop a group that turns."""
SETTLED = {"tanner I", "tanner I, all linked", "cucker-smale", "order 1, directed"}
"""Cases with fixed graphs alone: agents are divided by their numbers, and none changes its rank."""


def _crossing(graph, dimension=2):
    """Two streams through each other, whose links appear and break with a gap."""
    state = start(dimension, 2 * N, speed=4.0)
    way = np.where(np.arange(2 * N) % 2, 1.0, -1.0)[:, None]
    psi = fk.Potential("(r - 7)**2/2")
    found = fk.Law(graph, [fk.Gradient(psi), fk.Consensus(0.3)])
    return found, fk.State(state.q, state.p + way * np.array([40.0, 20.0, 5.0][:dimension]), 0.0), {}


def _repeating(lengths, graph, n=2 * N, share=1.0, flight=2.0):
    """Streams through each other in space that repeats, which fly through it together; most start lengths away."""
    rng = np.random.default_rng(11)
    finite = np.array([x if x else 40.0 for x in lengths])
    each = int(np.ceil(n ** (1 / len(lengths))))
    places = np.stack(np.meshgrid(*[np.arange(each)] * len(lengths)), axis=-1).reshape(-1, len(lengths))[:n]
    q = (places + rng.uniform(-0.2, 0.2, places.shape)) * finite / each
    q += np.array([x or 0.0 for x in lengths]) * rng.integers(-3, 4, q.shape)
    way = np.where(np.arange(n) % 2, 1.0, -1.0)[:, None] * share
    p = 4.0 * rng.normal(size=q.shape) + way * np.array([150.0, 70.0, 40.0][: len(lengths)])
    p += flight * np.array([x or 0.0 for x in lengths])
    found = fk.Law(graph, [fk.Gradient(fk.Potential("(r - 7)**2/2")), fk.Consensus(0.3)])
    return found, fk.State(q, p), {"space": fk.Periodic(lengths)}


def _looking_ahead(made):
    """Unicycles with headings of all directions."""
    law, state, more = made
    angles = np.linspace(-3.1, 3.1, state.n)
    heading = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    start = fk.State(state.q, state.p, state.t, columns={"heading": heading})
    return law, start, more | {"agents": fk.Unicycle(40.0)}


def _bodied(bodies, made):
    """A case whose agents are more than points."""
    found, state, more = made
    return found, state, {**more, "agents": bodies}


def _chain():
    """Unicycles whose limited force lags and who are blown about before and behind the lag."""
    blown = fk.Disturbed(fk.Unicycle(8.0 + 0.01 * BOTH, damping=0.1), 5.0, 0.04, seed=5)
    return fk.Limited(fk.Disturbed(fk.Lagged(blown, 0.1 + 0.001 * BOTH), 2.0, 0.05), force=20.0)


def _every_part():
    rng = np.random.default_rng(2)
    agents = fk.Agents(masses=rng.uniform(0.5, 1, N), damping=rng.uniform(0, 2, N))
    track = fk.Track(fk.Path(["sin(t)", "cos(t)"]), 0.3, rng.uniform(0, 1, N), per_mass=True)
    weights = fk.HashedWeights(0.2, 1.0, seed=7)
    terms = [
        fk.Gradient(shi_potential()),
        fk.Consensus(rng.uniform(0.05, 0.2, N), weights=weights),
        track,
        fk.Compensate(),
    ]
    return fk.Law(fk.Proximity(4.0), terms), _lattice(2, 2.0), {"agents": agents, "step": 0.004}


def _matrix():
    rng = np.random.default_rng(3)
    track = fk.Track(fk.Sink([5.0, 1.0]), position_gain=1.0, velocity_gain=0.5, shared=True, saturated=True)
    found = fk.Law(fk.Proximity(8.4), [fk.Gradient(fk.Potential("(r - 7)**2/2")),
                                       fk.Consensus(0.7, weights=rng.random((N, N))), track])  # fmt: skip
    agents = fk.Agents(masses=rng.uniform(0.5, 1, N))
    return found, _lattice(2, 5.6), {"agents": agents, "energy": fk.Energy("centre of mass")}


def _two_graphs():
    ring = fk.Fixed(N, tuple((k, (k + 1) % N) for k in range(N)), directed=True)
    terms = [fk.Gradient(structural(7.0)), fk.Consensus(0.5), fk.Consensus(0.2, over=ring)]
    return fk.Law(fk.Proximity(8.4), terms), _lattice(2, 5.6), {}


def _scheduled():
    track = fk.Track([2.0, 0.0], velocity_gain=fk.Schedule([0.255], [1.0, 0.1]))
    return fk.Law(fk.Smooth(8.4, 0.8), [fk.Gradient(structural(7.0)), track]), _lattice(2, 5.6), {}


def _fixed(graph, gain=0.3):
    return fk.Law(graph, [fk.Gradient(fk.Potential("(r - 7)**2/20")), fk.Consensus(gain)]), _lattice(2, 5.6), {}


def _alignment():
    return fk.Law(fk.Complete(), [fk.CuckerSmale(0.05, 0.4, 3.0)]), _lattice(2, 5.6), {}


def _and_near(made, state, more):
    """The same beside a graph by distance: under fixed graphs alone ranks have the same agents for good."""
    return fk.Law(made.graph, [*made.terms, fk.Gradient(fk.Potential("(r - 5)**2/20"), over=NEAR)]), state, more


def _of(name, dimension=2):
    found, agents = law(name, dimension, N)
    return found, _lattice(dimension, 5.6), {"agents": agents}


def _flow(name, m=2):
    found, energy = flow_laws.laws(N, m)[name]
    return found, _lattice(m, 1.0), {"agents": fk.SingleIntegrator(), "energy": energy}


CASES = {
    "zhou in the plane": lambda: _zhou(12, 12),
    "zhou in space": lambda: _zhou(5, 5, 5),
    "streams with hysteresis": lambda: _crossing(fk.Hysteresis(8.4, 1.0)),
    "streams with hysteresis in space": lambda: _crossing(fk.Hysteresis(8.4, 1.0), 3),
    "streams": lambda: _crossing(fk.Proximity(8.4)),
    "streams in periodic space with hysteresis": lambda: _repeating([90.0, 80.0], fk.Hysteresis(8.4, 1.0)),
    "streams in a periodic channel": lambda: _repeating([90.0, None], fk.Proximity(8.4)),
    "streams in periodic space of three axes": lambda: _repeating([40.0, 30.0, 35.0], fk.Hysteresis(8.4, 1.0)),
    "streams in the smallest periodic space": lambda: (
        *_repeating([17.0, 60.0], fk.Hysteresis(8.4, 1.0), 40, flight=6.0)[:2],
        {"space": fk.Periodic([17.0, 60.0]), "skin": 9.0},
    ),
    "tanner I": lambda: _fixed(fk.Fixed.random_connected(N, 0.05, 1)),
    "tanner I, all linked": lambda: _fixed(fk.Fixed.complete(N), 0.02),
    "cucker-smale": _alignment,
    "tanner I and near agents": lambda: _and_near(*_fixed(fk.Fixed.random_connected(N, 0.05, 1))),
    "tanner I, all linked, and near agents": lambda: _and_near(*_fixed(fk.Fixed.complete(N), 0.02)),
    "cucker-smale and near agents": lambda: _and_near(*_alignment()),
    "tanner II": lambda: _of("tanner II (5)"),
    "shi, hashed weights and gains of each agent": _every_part,
    "shi, matrix weights and the centre of mass": _matrix,
    "shi (4)": lambda: _of("shi (4)", 3),
    "olfati-saber (34)": lambda: _of("olfati-saber (34)"),
    "olfati-saber (58), obstacles": lambda: _of("olfati-saber (58)"),
    "olfati-saber (66), means": lambda: _of("olfati-saber (66)", 3),
    "smooth weighted damping": lambda: (
        fk.Law(fk.Smooth(8.4, 0.6, "cosine"), [fk.Gradient(structural(7.0)), fk.Consensus(1.0, weighted=True)]),
        _lattice(2, 5.6), {},
    ),
    "radius of each agent": lambda: (
        fk.Law(PerAgentRadii(np.random.default_rng(8).uniform(5.0, 9.0, N)), [fk.Gradient(structural(7.0))]),
        _lattice(2, 5.6), {},
    ),
    "fields of view": lambda: (
        fk.Law(fk.FieldOfView(8.4, 1.9), [fk.Gradient(structural(7.0)), fk.Consensus(0.5)]), _lattice(2, 5.6),
        {"agents": fk.PointMass(headings=np.random.default_rng(9).uniform(-np.pi, np.pi, N))},
    ),
    "cones of each agent": lambda: (
        fk.Law(
            fk.Cone(np.random.default_rng(10).uniform(5.0, 9.0, N), np.linspace(0.5, 3.0, N), "wrapped"),
            [fk.Gradient(structural(7.0)), fk.Consensus(0.5)],
        ), _lattice(2, 5.6), {"agents": fk.PointMass(headings=np.random.default_rng(9).uniform(-9.0, 9.0, N))},
    ),
    "streams of several headings": lambda: _bodied(
        fk.PointMass(headings=np.linspace(-9.0, 9.0, 2 * N)), _crossing(fk.Cone(8.4, 1.0, "wrapped"))
    ),
    "smooth cones": lambda: (
        fk.Law(
            fk.SmoothCone(8.4, 0.4, 2.0, measure="wrapped"),
            [fk.Gradient(structural(7.0)), fk.Consensus(0.5, weighted=True)],
        ), _lattice(2, 5.6), {"agents": fk.PointMass(headings=np.random.default_rng(9).uniform(-9.0, 9.0, N))},
    ),
    "streams of several headings whose links fade": lambda: _bodied(
        fk.PointMass(headings=np.linspace(-9.0, 9.0, 2 * N)), _crossing(fk.SmoothCone(8.4, 0.3, 1.5))
    ),
    "streams that look along their velocities": lambda: _crossing(fk.FieldOfView(8.4, 1.2, "p")),
    "unicycles that look ahead": lambda: _looking_ahead(_crossing(fk.FieldOfView(8.4, 1.2, "heading"))),
    "two graphs, one fixed": _two_graphs,
    "schedule": _scheduled,
    "damped": lambda: (*_of("own potential")[:2], {"agents": fk.Agents(damping=30.0), "scheme": "damped"}),
    "rk4": lambda: (*_of("olfati-saber (35)")[:2], {"scheme": "rk4"}),
    "order 1, rk4": lambda: _flow("gradient and consensus"),
    "order 1, gains of each agent": lambda: _flow("gain of each agent"),
    "order 1, euler, centre of mass": lambda: (*_flow("tracked in the centre of mass")[:2],
                                               {**_flow("tracked in the centre of mass")[2], "scheme": "euler"}),
    "order 1, obstacles": lambda: _flow("obstacles and pulls"),
    "order 1, directed": lambda: _flow("directed"),
    "order 1, directed, and near agents": lambda: _and_near(*_flow("directed")),
    "streams, lagged": lambda: _bodied(
        fk.Lagged(fk.PointMass(1.0 + 0.01 * BOTH, 0.3), 0.05 + 0.001 * BOTH),
        _repeating([90.0, 80.0], fk.Hysteresis(8.4, 1.0)),
    ),
    "streams, a chain of bodies": lambda: _bodied(_chain(), _repeating([90.0, 80.0], fk.Hysteresis(8.4, 1.0))),
    "streams, limited, periodic": lambda: _bodied(
        fk.Limited(fk.PointMass(), force=5.0 + 0.01 * BOTH), _repeating([90.0, None], fk.Proximity(8.4))
    ),
    "streams, limited force and rate, in space": lambda: _bodied(
        fk.Limited(fk.Lagged(fk.PointMass(), 0.2), force=8.0, rate=200.0),
        _repeating([40.0, 30.0, 35.0], fk.Proximity(8.4)),
    ),
    "order 1, lagged in gusts and limited": lambda: _bodied(
        fk.Limited(fk.Lagged(fk.Disturbed(fk.SingleIntegrator(), 0.3, 0.05), 0.02), speed=80.0),
        _flow("gradient and consensus"),
    ),
}  # fmt: skip


PAIRS = 60
"""Pairs at the radii: as many at the one at which links break as at the one at which they appear."""


def _at_the_radii(space):
    """Pairs across the border of two ranks, whose distance is a radius within a few units in the last place.

    Half of them are linked and at the radius at which links break, half are not and at that at which they appear. All
    fly with one velocity: rounding moves them about the radius.
    """
    rng, graph = np.random.default_rng(9), fk.Hysteresis(4.0, 0.3)
    k = np.arange(PAIRS)
    radius = np.where(k % 2, graph.break_radius, graph.appear_radius) * (1 + np.finfo(float).eps * (k // 2 % 9 - 4))
    angle, middle = rng.uniform(-1, 1, PAIRS), rng.uniform(-0.3, 0.3, PAIRS)
    half = 0.5 * radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    centre = np.stack([middle, 12.0 * (k - k.mean())], axis=1)
    # Two agents far off make the group longer along the first axis, across which it is divided.
    q = np.concatenate([centre - half, centre + half, [[-1000.0, 0.0], [1000.0, 0.0]]])
    links = np.zeros((len(q), len(q)), dtype=bool)
    broken = k[k % 2 == 1]
    links[broken, broken + PAIRS] = links[broken + PAIRS, broken] = True
    state = fk.State(q, np.tile([0.37, 0.21], (len(q), 1)), links=links)
    return fk.Law(graph, [fk.Consensus(0.0)]), state, {"space": space, "skin": 0.004}


EDGES = {
    "pairs at the radii": lambda: _at_the_radii(fk.Open()),
    "pairs at the radii, periodic": lambda: _at_the_radii(fk.Periodic([2100.0, 800.0])),
}


def case(name):
    """Scenario of a case, and the options that it needs."""
    makes = CASES | EDGES
    if name not in makes:
        found = _of_papers()[name](0)
        found = found.with_(t_end=found.start.t + PAPER_STEPS * PAPER_STEP, frames=3)
        return found, {"step": PAPER_STEP} | _thin_skin(found.law)
    made, state, more = makes[name]()
    options = {"step": STEP} | _thin_skin(made)
    options |= {name: more.pop(name) for name in ("scheme", "skin", "step") if name in more}
    if "space" not in more:
        made, state = turning(made, state, more.get("agents"), drag=DRAGS.get(name, 0.0))
    return fk.Scenario(made, state, t_end=T_END, frames=4, name=name, **more), options


def _thin_skin(made):
    """Lists hold while the group flies as a whole: a thin skin makes agents be exchanged at nearly every step."""
    reach = [float(np.max(graph.break_radius)) for graph in made.graphs if graph.moves]
    return {"skin": 0.004 * max(reach)} if reach else {}


@cache
def _of_papers():
    """Scenarios of every paper of the library."""
    return {name: make for key in ALL_KEYS for name, make in paper(key).scenarios().items()}


def paper_names():
    """Scenarios of papers that are cases. Each is made to see whether it is one: what runs on ranks needs no list."""

    def runs(make):
        scenario = make(0)
        return scenario.control.ideal and scenario.start.n <= 500 and not engine_named("tiles").why_not(scenario)

    return tuple(sorted(name for name, make in _of_papers().items() if runs(make)))
