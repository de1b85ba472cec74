"""Energies and powers of printed kernels against a transcription that shares nothing with the declarations.

Storage and dissipation of every term of the library are written out here once more, in plain loops over agents; supply
is what is left of the change of the transcribed energy along the motion. Both printers, of scalar and of array code,
must say the same in every frame, for both orders, with and without compensation.
"""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import flocking as fk
from flocking.engine.kernels.codegen import compiled_kernels
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.kernels.pieces import free_pieces
from flocking.engine.reference.control import evaluate
from flocking.model.graphs.functionals import left_eigenvector

N = 4
RNG = np.random.default_rng(11)
Q = np.array([[0.0, 0.0], [0.9, 0.2], [0.3, 1.1], [1.4, 1.0]])
P = RNG.normal(size=(N, 2))
MASS, DAMPING = np.array([1.0, 0.5, 2.0, 1.5]), np.array([0.3, 0.0, 0.7, 0.1])
WEIGHTS = np.array([[0, 1, 2, 3], [1, 0, 0.5, 0], [2, 0.5, 0, 1], [3, 0, 1, 0]], dtype=float)
UNEVEN = WEIGHTS + np.triu(WEIGHTS, 1)
GAINS = np.array([0.5, 1.0, 0.0, 2.0])
RADIUS, ONSET, T = 1.7, 0.4, 0.3
LEADER = fk.Path(["cos(t)", "0.5"], start=[0.2, -0.1])
BALL = fk.Ball([0.5, 0.4], 0.2)
H = 1e-5


def leader(t):
    """Position and velocity of LEADER."""
    return np.array([0.2 + np.sin(t), -0.1 + 0.5 * t]), np.array([np.cos(t), 0.5])


def psi(r):
    return 0.8 * (r - 1.2) ** 2 + 0.3 / r


def bump(r):
    z = r / RADIUS
    return 1.0 if z < ONSET else 0.5 * (1 + np.cos(np.pi * (z - ONSET) / (1 - ONSET)))


def slip(q, p):
    """What the damping of obstacle avoidance acts on: the velocity of the nearest point of BALL less the agent's."""
    gap = q - np.array([0.5, 0.4])
    n = gap / np.linalg.norm(gap)
    return 0.2 / np.linalg.norm(gap) * (p - (p @ n) * n) - p


def no_energy(q, frame_q, t):
    return 0.0


def no_loss(q, p, frame_p):
    return 0.0


def pairs(function):
    return lambda q, *rest: sum(
        0.5 * function(i, j, q, *rest) for i, j in product(range(N), repeat=2)
        if i != j and np.linalg.norm(q[j] - q[i]) < RADIUS
    )  # fmt: skip


def stored_by_links(weight):
    return pairs(lambda i, j, q, frame_q, t: weight(np.linalg.norm(q[j] - q[i])) * psi(np.linalg.norm(q[j] - q[i])))


def lost_by_links(weight):
    return pairs(lambda i, j, q, p, frame_p: weight(i, j, np.linalg.norm(q[j] - q[i])) * ((p[j] - p[i]) ** 2).sum())


def stored_by_agents(gain, sink=None):
    def stored(q, frame_q, t):
        origin = sink if sink is not None else frame_q
        return 0.0 if origin is None else 0.5 * sum(g * ((x - origin) ** 2).sum() for g, x in zip(gain, q, strict=True))

    return stored


def lost_by_agents(gain):
    return lambda q, p, frame_p: sum(g * ((v - frame_p) ** 2).sum() for g, v in zip(gain, p, strict=True))


def lost_near_ball(q, p, frame_p):
    near = [k for k in range(N) if np.linalg.norm(q[k] - [0.5, 0.4]) - 0.2 <= 1.0]
    assert near
    return 1.3 * sum((slip(q[k], p[k]) ** 2).sum() for k in near)


HARD, SMOOTH = fk.Proximity(RADIUS), fk.Smooth(RADIUS, ONSET)
PSI = fk.Potential("k*(r - d)**2 + b/r", k=0.8, d=1.2, b=0.3)
C1, C2 = np.array([0.3, 1.0, 0.0, 0.6]), np.array([0.5, 0.0, 1.0, 2.0])
SINK = np.array([1.0, -0.5])
NUMBERS = (np.linalg.norm(Q[:, None] - Q, axis=-1) < RADIUS).sum(axis=1) - 1
FUNCTIONAL = left_eigenvector(UNEVEN * (np.linalg.norm(Q[:, None] - Q, axis=-1) < RADIUS))

CASES = {
    "Gradient": (HARD, fk.Gradient(PSI), stored_by_links(lambda r: 1.0), no_loss),
    "Gradient, smooth": (SMOOTH, fk.Gradient(PSI), stored_by_links(bump), no_loss),
    "Consensus": (HARD, fk.Consensus(1.4), no_energy, lost_by_links(lambda i, j, r: 1.4)),
    "Consensus, weights": (HARD, fk.Consensus(1.4, weights=WEIGHTS), no_energy,
                           lost_by_links(lambda i, j, r: 1.4 * WEIGHTS[i, j])),
    "Consensus, uneven": (HARD, fk.Consensus(GAINS, weights=UNEVEN), no_energy,
                          lost_by_links(lambda i, j, r: GAINS[i] * UNEVEN[i, j])),
    "Consensus, functional": (HARD, fk.Consensus(1.0, weights=UNEVEN, functional=True), no_energy,
                              lost_by_links(lambda i, j, r: FUNCTIONAL[i] * UNEVEN[i, j])),
    "Consensus, weighted": (SMOOTH, fk.Consensus(1.4, weighted=True), no_energy,
                            lost_by_links(lambda i, j, r: 1.4 * bump(r))),
    "VelocityAverage": (HARD, fk.VelocityAverage(1.4), no_energy,
                        lost_by_links(lambda i, j, r: 1.4 / (1.0 + NUMBERS[i]))),
    "CuckerSmale": (HARD, fk.CuckerSmale(1.4, 0.7, 0.6), no_energy,
                    lost_by_links(lambda i, j, r: 1.4 / (0.36 + r * r) ** 0.7)),
    "Track": (HARD, fk.Track(LEADER, C1, C2), stored_by_agents(C1), lost_by_agents(C2)),
    "Track, sink": (HARD, fk.Track(fk.Sink(SINK), C1, C2), stored_by_agents(C1, SINK), lost_by_agents(C2)),
    "Track, masses": (HARD, fk.Track(LEADER, C1, C2, 1.0, per_mass=True), stored_by_agents(C1 * MASS),
                      lost_by_agents(C2 * MASS)),
    "Track, shared": (HARD, fk.Track(LEADER, C1, C2, shared=True), no_energy, no_loss),
    "Track, saturated": (HARD, fk.Track(LEADER, C1, C2, saturated=True), no_energy, no_loss),
    "Avoid": (HARD, fk.Avoid((BALL,), fk.Velocity([1.0, 0.3]), range=1.0, damping_gain=1.3), no_energy, lost_near_ball),
}  # fmt: skip
FRAMES = {"lab": fk.Energy(), "centre of mass": fk.Energy("centre of mass"), "leader": fk.Energy("leader", LEADER)}


def frame(name, q, p, t):
    if name == "centre of mass":
        return MASS @ q / MASS.sum(), MASS @ p / MASS.sum()
    return leader(t) if name == "leader" else (None, np.zeros(2))


def printed(law, energy, order):
    """Stored and kinetic energy, control, and the three rates by the kernels, run as plain Python."""
    agents = fk.Agents(MASS, DAMPING if order == 2 else 0.0, order)
    layout = Layout(law, energy, agents)
    module = compiled_kernels(layout, 2)
    slots = layout.values(agents, N, T)
    lists = [np.nonzero(g.start_links(Q)) for g in law.graphs]
    distances = ObstacleDistances(law)
    lists += [np.nonzero(distances.within(x, Q, T)) for x in distances.levels if x.kind == "obstacle"]
    senders, sensed = (np.concatenate([x[k] for x in lists]) for k in (0, 1))
    offsets = np.cumsum([0, *(len(x[0]) for x in lists)])
    p = P if order == 2 else np.zeros_like(P)
    functional = 1.0 / (1.0 + NUMBERS) if isinstance(law.terms[0], fk.VelocityAverage) else FUNCTIONAL
    rest = (senders, sensed, offsets, *free_pieces(len(senders)), *slots, functional[None])
    u, rates = np.zeros((N, 2)), np.zeros(3)
    module.control.py_func(T, Q, p, *rest, u, rates)
    return module.energies.py_func(T, Q, p, *rest), u, rates


@pytest.mark.parametrize(
    ("order", "compensate"), [pytest.param(1, False, marks=pytest.mark.slow), (2, False), (2, True)]
)
@pytest.mark.parametrize("frame_name", FRAMES)
@pytest.mark.parametrize("name", CASES)
def test_printed_powers_are_those_of_the_terms(name, frame_name, order, compensate):
    graph, term, stored, lost = CASES[name]
    law = fk.Law(graph, [term, fk.Compensate()] if compensate else [term])
    energy = FRAMES[frame_name]
    p = P if order == 2 else np.zeros_like(P)
    agents = fk.Agents(MASS, DAMPING if order == 2 else 0.0, order)
    (links, bodies, kinetic), u, (work, dissipated, supplied) = printed(law, energy, order)
    frame_q, frame_p = frame(frame_name, Q, p, T)

    def total(h):
        """The transcribed energy a time h on, along the motion."""
        velocity = P if order == 2 else u
        force = (u - DAMPING[:, None] * P) / MASS[:, None]
        q = Q + h * velocity + (h**2 / 2 * force if order == 2 else 0.0)
        later = P + h * force if order == 2 else p
        place, speed = frame(frame_name, q, later, T + h)
        moving = 0.5 * (MASS[:, None] * (later - speed) ** 2).sum() if order == 2 else 0.0
        return stored(q, place, T + h) + moving

    damped = 0.0 if compensate or order == 1 else (DAMPING[:, None] * p * (p - frame_p)).sum()
    loss = lost(Q, p, frame_p) + damped if order == 2 else (u**2).sum()
    size = 1 + abs(loss) + abs(total(0.0)) + abs(supplied)
    assert links + bodies + kinetic == pytest.approx(total(0.0), abs=1e-12 * size)
    assert dissipated == pytest.approx(loss, abs=1e-12 * size)
    assert supplied == pytest.approx((total(H) - total(-H)) / (2 * H) + loss, abs=1e-7 * size)
    assert work == pytest.approx((u * (p if order == 2 else u)).sum(), abs=1e-12 * size)
    arrays = evaluate(law, fk.State(Q, p, T), agents=agents, energy=energy)
    assert (arrays.dissipation, arrays.supply) == pytest.approx((dissipated, supplied), abs=1e-12 * size)
    assert arrays.storage + arrays.kinetic == pytest.approx(total(0.0), abs=1e-12 * size)


@pytest.mark.parametrize("name", ["Consensus", "Consensus, uneven", "Track", "Avoid"])
@pytest.mark.parametrize("factor", [0.5, 10.0, -3.0])
def test_a_printer_that_alters_the_dissipation_is_noticed(name, factor, monkeypatch, tmp_path):
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path))
    import flocking.formula.compiled as compiled
    import flocking.formula.printing as printing

    # What was printed before must not serve.
    monkeypatch.setattr(compiled, "_modules", {})
    right = printing.statements

    def wrong(results, **arguments):
        return right({k: factor * v if k == "dissipation" else v for k, v in results.items()}, **arguments)

    monkeypatch.setattr(printing, "statements", wrong)
    with pytest.raises(AssertionError):
        test_printed_powers_are_those_of_the_terms(name, "lab", 2, False)


def test_every_term_of_the_library_is_written_out_here():
    from flocking.model.terms.avoidance import ObstacleTerm
    from flocking.model.terms.balances import from_library
    from flocking.model.terms.pair_terms import Term
    from flocking.model.terms.steering import Steering

    def concrete(kind):
        below = [x for k in kind.__subclasses__() for x in concrete(k)]
        return below if getattr(kind, "__abstractmethods__", None) else [kind, *below]

    written = {type(term) for _, term, _, _ in CASES.values()} | {fk.Compensate}
    # Steering terms are functions of arrays: they state no formulas and keep no ledger, so nothing of them is printed.
    formulas = {k for k in concrete(Term) if not issubclass(k, Steering)}
    known = {k for k in formulas if k.__module__.startswith("flocking.model")} - {ObstacleTerm}
    assert known == written
    assert all(from_library(term) for _, term, _, _ in CASES.values())
