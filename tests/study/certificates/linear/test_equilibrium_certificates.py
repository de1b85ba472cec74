"""The linearisation at an equilibrium: closed forms of two and three agents, and runs on both sides of the bounds."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.certificates.linear.equilibria import Equilibrium
from flocking.study.certificates.linear.equilibrium_certificates import KEYS
from flocking.study.certificates.linear.near_equilibrium import NearEquilibrium

PSI = fk.Potential("a/r + r**2", a=2.0)
"""Its least energy is at r = 1, where psi'' = 2 a + 2 = 6."""

TRIANGLE = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])


def scenario(q: object, *, graph: fk.Graph | None = None, beta: float | None = None, p: object = None, **world: object):
    q = np.asarray(q, dtype=float)
    terms = [fk.Gradient(PSI), *([] if beta is None else [fk.Consensus(beta)])]
    bodies = fk.SingleIntegrator() if beta is None else fk.PointMass(1.0)
    p = np.zeros_like(q) if p is None else p
    return fk.Scenario(fk.Law(graph or fk.Complete(), terms), fk.State(q, p), t_end=1.0, bodies=bodies, **world)


def holds(bound, exact, width=1e-7):
    assert bound.lo <= exact * (1 + 1e-12)
    assert exact * (1 - 1e-12) <= bound.hi
    assert bound.hi - bound.lo < width * exact


def test_two_agents_of_first_order_have_closed_forms():
    """One deformation, with the stiffness 2 psi'' = 12."""
    found = fk.certify(scenario([[0.0, 0.3], [1.7, 0.0]]))
    for key, exact in (
        ("equilibrium_decay_rate", 12.0), ("equilibrium_settling_time", np.log(50.0) / 12.0),
        ("equilibrium_delay", np.pi / 24.0), ("equilibrium_period", 1.0 / 6.0), ("equilibrium_loss", 1.0 / 6.0),
        ("equilibrium_noise", 1.0 / 48.0),
    ):  # fmt: skip
        holds(found[key].bound, exact)
        assert "linearisation near the equilibrium" in found[key].statement
    assert "smallest distance 1, largest 1," in found["equilibrium"].statement
    assert found["equilibrium"].bound.hi < 1e-9


def test_the_triangle_has_the_spectrum_of_three_springs():
    """Deformations of three springs k in a triangle: 3 k of all sides, 3 k/2 twice."""
    near = NearEquilibrium(scenario(TRIANGLE * 1.3 + [[0.1, 0.0], [0.0, 0.05], [0.0, 0.0]]))
    holds(near.least_stiffness, 9.0)
    holds(near.largest_stiffness, 18.0)
    assert near.equilibrium.rigid_motions == 3
    assert near.unstressed


def test_the_second_derivative_under_stress_is_that_of_differences():
    """Four agents of which all act on all: sides press, diagonals pull. Differences of forces written out anew."""
    near = NearEquilibrium(scenario([[0.0, 0], [1.1, 0], [1.1, 1.1], [0, 1.0]]))
    assert not near.unstressed

    def slope(x: np.ndarray) -> np.ndarray:
        q = x.reshape(4, 2)
        found = np.zeros_like(q)
        for i in range(4):
            for j in range(4):
                if i != j:
                    r = np.linalg.norm(q[j] - q[i])
                    found[i] -= (-2.0 / r**2 + 2.0 * r) * (q[j] - q[i]) / r
        return found.ravel()

    x = near.equilibrium.q.ravel()
    assert np.abs(slope(x)).max() < 1e-9
    step = 1e-5
    rows = [(slope(x + step * e) - slope(x - step * e)) / (2 * step) for e in np.eye(8)]
    assert np.abs(np.array(rows) - near.stiffness.values).max() < 1e-7
    values = np.linalg.eigvalsh(0.5 * (np.array(rows) + np.array(rows).T))
    assert near.least_stiffness.lo - 1e-7 <= values[3] <= near.least_stiffness.hi + 1e-7


def test_two_agents_of_second_order_have_closed_forms():
    """Along their line h = 12 and b = 2 beta; across it b alone. Both commute, so that nothing is lost."""
    beta = 0.8
    found = fk.certify(scenario([[0.0, 0.3], [1.7, 0.0]], beta=beta))
    b, h = 2 * beta, 12.0
    rate = min(-np.roots([1, b, h]).real.max(), b)
    holds(found["equilibrium_decay_rate"].bound, rate, 1e-6)
    w = np.sqrt((b**2 + np.sqrt(b**4 + 4 * h**2)) / 2)
    # The ratio of H to B is proven within 1e-9.
    for key, exact in (("equilibrium_delay", np.arctan(b * w / h) / w), ("equilibrium_period", min(2 * b / h, 2 / b))):
        assert exact * (1 - 1e-8) < found[key].bound.lo <= exact
    holds(found["equilibrium_noise"].bound, 2 / (2 * b * 2))
    assert "may grow" in found["equilibrium_settling_time"].reason
    assert "order 2" in found["equilibrium_loss"].reason


def test_bounds_of_motions_that_do_not_commute_are_safe():
    """A larger lattice with consensus over its links: companion matrices of NumPy are stable inside of the bounds."""
    rng = np.random.default_rng(1)
    places = [[x + 0.5 * (y % 2), y * np.sqrt(0.75)] for y in range(3) for x in range(3)]
    made = scenario(np.array(places) + 0.03 * rng.normal(size=(9, 2)), graph=fk.Hysteresis(1.4, 0.1), beta=1.1)
    near = NearEquilibrium(made)
    assert isinstance(near.found, Equilibrium)
    h, b = near.stiffness.values, near.full_damping.values
    size, unit = len(h), np.eye(len(h))
    motion = np.block([[np.zeros((size, size)), unit], [-h, -b]])
    values = np.linalg.eigvals(motion)
    rest = values[np.abs(values) > 1e-4]
    rate = near.rate()
    assert rate.lo <= -rest.real.max() <= rate.hi
    assert len(values) - len(rest) == 2 * 2 + 1
    for share, stable in ((0.999, True), (1.3, False)):
        t = share * float(near.period().lo)
        step = np.block([[unit - t * t / 2 * h, t * unit - t * t / 2 * b], [-t * h, unit - t * b]])
        assert (np.abs(np.linalg.eigvals(step)).max() < 1.0 + 1e-6) == stable
    tau = float(near.delay().lo)
    w = np.linspace(0.05, 40.0, 1500)
    for x in w:
        # No root on the imaginary axis for delays up to the bound.
        for late in np.linspace(0.05, 1.0, 5) * tau:
            turned = np.exp(-1j * x * late)
            assert np.linalg.svd(-x * x * unit + (h + 1j * x * b) * turned, compute_uv=False)[-1] > 1e-6


@pytest.mark.parametrize(("share", "falls"), [(0.9, True), (1.1, False)])
def test_runs_near_a_lattice_end_on_the_promised_side(share, falls):
    start = TRIANGLE + 1e-4 * np.random.default_rng(3).normal(size=(3, 2))
    found = fk.certify(scenario(start))
    held = fk.Held(round(share * found["equilibrium_period"].bound.lo, 9))
    late = fk.Delayed(share * found["equilibrium_delay"].bound.lo, self_delayed=True)
    for world, length in (({"control": held}, 40 * held.period), ({"information": late}, 40 * late.tau)):
        run = fk.simulate(scenario(start, **world).with_(t_end=float(length), frames=2), progress=False)
        away = [np.abs(np.linalg.norm(q - np.roll(q, 1, axis=0), axis=1) - 1.0).max() for q in run.q]
        assert (away[1] < 0.2 * away[0]) == falls


@pytest.mark.parametrize("weighted", [False, True])
def test_a_lattice_of_weighted_forces_is_found(weighted):
    """Olfati-Saber (2006): links of weighted forces. Consensus has the weight of its links only where told to."""
    law = fk.Law(fk.Smooth(1.4, 0.5), [fk.Gradient(PSI, weighting="force"), fk.Consensus(1.0, weighted=weighted)])
    made = fk.Scenario(law, fk.State(1.1 * TRIANGLE, np.zeros((3, 2))), t_end=1.0)
    near = NearEquilibrium(made)
    assert near.hypotheses[-1].holds
    assert near.equilibrium.distances == pytest.approx([1.0] * 3, abs=1e-9)
    weight = float(law.graph.weight(1.0, lambda name: law.graph.parameters[name]))
    assert weight < 0.9
    holds(near.damped, 3 * weight if weighted else 3.0)
    holds(near.largest_stiffness, 18.0 * weight)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("share", [0.95, 1.05])
def test_damping_over_a_smooth_graph_is_that_of_the_law(weighted, share):
    """Under held control at both sides of the period, where damping alone decides: 2/(3 beta) or 2/(3 beta a)."""
    law = fk.Law(fk.Smooth(1.4, 0.5), [fk.Gradient(PSI, weighting="force"), fk.Consensus(8.0, weighted=weighted)])
    start = fk.State(TRIANGLE, 1e-6 * np.random.default_rng(1).normal(size=(3, 2)))
    made = fk.Scenario(law, start, t_end=1.0)
    period = round(share * fk.certify(made)["equilibrium_period"].bound.lo, 9)
    held = made.with_(control=fk.Held(period), t_end=120 * period, frames=2)
    run = fk.simulate(held, progress=False)
    moving = [np.linalg.norm(p - p.mean(axis=0)) for p in run.p]
    assert (moving[1] < moving[0]) == (share < 1.0)


def test_what_is_not_proven_is_refused():
    square = fk.Fixed(4, ((0, 1), (1, 2), (2, 3), (3, 0)))
    corners = [[0.0, 0], [1.1, 0], [1.1, 1.1], [0, 1.1]]
    floppy = fk.certify(scenario(corners, graph=square))["equilibrium_decay_rate"]
    assert floppy.outcome == "refused"
    assert "directions" in floppy.reason
    law = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("r**2/2"))])
    linear = fk.Scenario(law, fk.State(TRIANGLE), t_end=1.0, bodies=fk.SingleIntegrator())
    assert fk.certify(linear)["equilibrium"].outcome == "not applicable"
    away = fk.Law(fk.Complete(), [fk.Gradient(fk.Potential("1/r"))])
    parting = fk.Scenario(away, fk.State(TRIANGLE), t_end=1.0, bodies=fk.SingleIntegrator())
    assert "none was reached" in fk.certify(parting)["equilibrium"].reason
    # Of four agents that all attract, links press on each other: lost messages turn the group.
    pressed = fk.certify(scenario(corners))
    assert "stress" in pressed["equilibrium_loss"].reason
    assert pressed["equilibrium_period"].granted
    assert all(any(c.key == key for c in pressed) for key in KEYS)


def test_lost_messages_move_agents_away_from_an_equilibrium_under_stress():
    """No certificate of loss could be true there: a square at rest is deformed by a thousandth and more."""
    seen = {}
    for name, places in (("square", [[0.0, 0], [1.1, 0], [1.1, 1.1], [0, 1.1]]), ("triangle", TRIANGLE)):
        near = NearEquilibrium(scenario(places))
        period = round(0.1 * float(near.period().lo), 9)
        world = {"control": fk.Held(period), "information": fk.Messages(period, loss=0.3, expires=period, seed=1)}
        made = scenario(near.equilibrium.q, **world).with_(t_end=50 * period, frames=51)
        run = fk.simulate(made, progress=False)
        lengths = np.array([np.linalg.norm(q[:, None] - q[None], axis=2) for q in run.q])
        seen[name] = np.abs(lengths[1:] - lengths[0]).max(axis=(1, 2))
        assert near.unstressed == (name == "triangle")
    # Until the first message is lost the square stays.
    assert seen["square"][10:].min() > 1e-3
    assert seen["triangle"].max() < 1e-9


def test_the_refusal_of_a_large_group_gives_its_size():
    """The graph is right, and its name alone would not say what is wrong."""
    start = fk.start.hexagonal(101, spacing=1.0, seed=0)
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    found = fk.certify(fk.Scenario(law, start, t_end=1.0))["equilibrium"]
    (why,) = [x for x in found.hypotheses if not x.holds]
    assert "of 200 coordinates at most" in why.statement
    assert why.found == "202 coordinates of 101 agents, Proximity, undirected"
