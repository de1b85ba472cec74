"""Lost messages near a lattice: sums over all patterns of losses, written out anew, and runs of the engine."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import flocking as fk
from flocking.study.certificates.linear.lossy_lattice import ORTHONORMAL, LossyLattice, deformations
from flocking.study.certificates.linear.near_equilibrium import NearEquilibrium

PSI = fk.Potential("a/r + r**2", a=2.0)
"""Its least energy is at r = 1, where psi'' = 2 a + 2 = 6."""

STIFF = 6.0

TRIANGLE = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])

TWO = np.array([[0.0, 0.0], [0.6, 0.8]])


def lossy(q, period, loss, *, beta=2.0, graph=None, moved=1e-5, seed=1, **world):
    q = np.asarray(q, dtype=float)
    law = fk.Law(graph or fk.Complete(), [fk.Gradient(PSI), fk.Consensus(beta)])
    q = q + moved * np.random.default_rng(3).normal(size=q.shape)
    messages = fk.Messages(period, loss=loss, expires=world.pop("expires", period), seed=seed, **world)
    return fk.Scenario(
        law, fk.State(q, np.zeros_like(q)), t_end=60 * period, frames=61, control=fk.Held(period), information=messages
    )  # fmt: skip


def summed(q, period, probability, beta, *, paired=False):
    """The growth of second moments as the mean over all patterns of losses, with places and velocities as they are."""
    n, m = q.shape
    links = [(i, j) for i in range(n) for j in range(n) if i != j]
    groups = [[(i, j), (j, i)] for i, j in links if i < j] if paired else [[link] for link in links]
    size, total = n * m, 0.0
    # Deformations and relative velocities alone: what forces of intact links act on, and all but the mean.
    forces = np.zeros((size, size))
    for i, j in links:
        forces[i * m : i * m + m] += _force(q, i, j)
    _, sizes, rows = np.linalg.svd(forces)
    deformed = rows[sizes > 1e-9]
    moving = np.linalg.svd(np.eye(size) - np.kron(np.ones((n, n)) / n, np.eye(m)))[2][: size - m]
    basis = np.block([
        [deformed, np.zeros((len(deformed), size))], [np.zeros((len(moving), size)), moving]
    ])  # fmt: skip
    for pattern in product((0, 1), repeat=len(groups)):
        k, b = np.zeros((size, size)), np.zeros((size, size))
        for arrives, members in zip(pattern, groups, strict=True):
            for i, j in members if arrives else ():
                k[i * m : i * m + m] += _force(q, i, j)
                for axis in range(m):
                    b[i * m + axis, i * m + axis] += beta
                    b[i * m + axis, j * m + axis] -= beta
        unit, t = np.eye(size), period
        step = np.block([[unit - t * t / 2 * k, t * unit - t * t / 2 * b], [-t * k, unit - t * b]])
        step = basis @ step @ basis.T
        count = sum(pattern)
        weight = (1 - probability) ** count * probability ** (len(groups) - count)
        total = total + weight * np.kron(step, step)
    return float(np.abs(np.linalg.eigvals(total)).max())


def _force(q, i, j):
    n, m = q.shape
    unit = (q[j] - q[i]) / np.linalg.norm(q[j] - q[i])
    row = np.zeros((m, n * m))
    row[:, i * m : i * m + m] = STIFF * np.outer(unit, unit)
    row[:, j * m : j * m + m] = -STIFF * np.outer(unit, unit)
    return row


@pytest.mark.parametrize(
    ("q", "period", "loss", "beta"),
    [(TWO, 0.1, 0.3, 2.0), (TWO, 0.25, 0.6, 1.0), (TWO, 0.05, 0.9, 0.5), (TRIANGLE, 0.1, 0.3, 2.0)],
)
def test_the_growth_is_that_of_all_patterns_of_losses(q, period, loss, beta):
    exact = summed(q, period, loss, beta)
    found = fk.certify(lossy(q, period, loss, beta=beta))["equilibrium_loss"]
    low, high = LossyLattice(NearEquilibrium(lossy(q, period, loss, beta=beta))).growth
    assert low * (1 - 1e-9) <= exact <= high * (1 + 1e-9)
    assert high - exact < max(0.03 * (1.0 - exact), 1e-3)
    assert found.granted == (exact < 1.0)
    assert found.granted or " fall" in found.reason


def test_both_sides_of_the_stability_are_seen():
    growths = [summed(TWO, period, 0.3, 2.0) for period in (0.1, 0.6)]
    assert growths[0] < 1.0 < growths[1]
    outcomes = [fk.certify(lossy(TWO, period, 0.3))["equilibrium_loss"].outcome for period in (0.1, 0.6)]
    assert outcomes == ["granted", "refused"]


def test_no_period_serves_for_all_probabilities():
    """However short the period, it grows where few messages arrive: velocity consensus brakes too little."""
    assert summed(TWO, 0.01, 0.5, 0.5) < 1.0 < summed(TWO, 0.01, 0.99, 0.5)
    assert summed(TWO, 0.001, 0.99, 0.5) < 1.0 < summed(TWO, 0.001, 0.999, 0.5)


def test_both_directions_of_a_link_may_be_lost_together():
    period, loss = 0.12, fk.Bernoulli(0.5, paired=True)
    exact = summed(TRIANGLE, period, 0.5, 2.0, paired=True)
    low, high = LossyLattice(NearEquilibrium(lossy(TRIANGLE, period, loss))).growth
    assert low * (1 - 1e-9) <= exact <= high * (1 + 1e-9)
    assert abs(exact - summed(TRIANGLE, period, 0.5, 2.0)) > 10 * abs(high - exact)


def test_runs_of_many_seeds_fall_as_the_mean_square_does():
    period, loss = 0.1, 0.4
    squares = []
    for seed in range(60):
        run = fk.simulate(lossy(TRIANGLE, period, loss, seed=seed), progress=False)
        sides = np.linalg.norm(run.q - np.roll(run.q, 1, axis=1), axis=2) - 1.0
        squares.append((sides**2).sum(axis=1))
    mean = np.mean(squares, axis=0)
    # Between ticks 5 and 35 the average falls by some 1e3: by the factor of the slowest mode, or faster.
    seen = (mean[35] / mean[5]) ** (1 / 30)
    low, high = LossyLattice(NearEquilibrium(lossy(TRIANGLE, period, loss))).growth
    assert 0.85 * high < seen < 1.05 * high < 1.0


def test_deformations_are_orthogonal_to_rigid_motions_of_places_within_the_radius():
    """Of places as far from the computed ones as the radius admits, with exact ones from a projection."""
    at = NearEquilibrium(lossy(TRIANGLE, 0.1, 0.3)).equilibrium
    wide = type(at)(at.q, 1e-3, at.links, at.force)
    v, away = deformations(wide)
    rng = np.random.default_rng(0)
    for _ in range(50):
        move = rng.normal(size=at.q.shape)
        other = at.q + 1e-3 * move / np.linalg.norm(move, axis=1).max()
        turn = np.stack([-(other - other.mean(0))[:, 1], (other - other.mean(0))[:, 0]], axis=1).ravel()
        rigid = np.column_stack([np.kron(np.ones(3), [1, 0]), np.kron(np.ones(3), [0, 1]), turn])
        rigid = np.linalg.qr(rigid)[0]
        left, _, right = np.linalg.svd(v - rigid @ (rigid.T @ v), full_matrices=False)
        assert np.linalg.norm(left @ right - v, 2) <= away
    assert away < 1e-2
    assert deformations(at)[1] < 1e-8


def test_places_that_are_known_too_roughly_prove_no_growth(monkeypatch):
    """The bounds need columns that are nearly orthonormal: where a radius leaves them further apart, there is none."""
    near = NearEquilibrium(lossy(TRIANGLE, 0.1, 0.3))
    at = near.equilibrium
    assert LossyLattice(near).growth[1] < 1.0
    for radius, proven in ((1e-12, True), (1e-3, False)):
        rough = type(at)(at.q, radius, at.links, at.force)
        monkeypatch.setattr(NearEquilibrium, "equilibrium", property(lambda _, rough=rough: rough))
        assert (deformations(rough)[1] <= ORTHONORMAL) == proven
        lattice = LossyLattice(NearEquilibrium(near.scenario))
        assert np.isfinite(lattice.recursion().absolute[0]) == proven
        assert proven or not lattice.growth[1] < 1.0


def test_what_is_not_proven_is_refused():
    def reason(made):
        found = fk.certify(made)["equilibrium_loss"]
        assert found.outcome == "refused"
        return found.reason

    made = lossy(TRIANGLE, 0.1, 0.3)
    assert "is not declared" in reason(made.with_(control=fk.Continuous(), information=fk.Instant()))
    assert "older ones" in reason(lossy(TRIANGLE, 0.1, 0.3, expires=None))
    assert "none is lost" in reason(lossy(TRIANGLE, 0.1, 0.0))
    assert "late" in reason(lossy(TRIANGLE, 0.1, 0.3, delay=0.1, expires=0.2))
    assert "exact" in reason(lossy(TRIANGLE, 0.1, 0.3, noise=fk.WhiteNoise(0.01, 0.0)))
    assert "stress" in reason(lossy([[0.0, 0], [0.9, 0], [0.9, 0.9], [0, 0.9]], 0.1, 0.3))


@pytest.mark.parametrize("order", [1, 2])
def test_a_link_that_does_not_come_back_after_a_loss_is_refused(order):
    """Under hysteresis links of length 1 that appear below 0.85 alone: a run with losses keeps a deformation."""
    terms = [fk.Gradient(PSI), *([fk.Consensus(2.0)] if order == 2 else [])]
    law = fk.Law(fk.Hysteresis(1.05, 0.2), terms)
    q = TRIANGLE + 1e-5 * np.random.default_rng(0).normal(size=(3, 2))
    start = fk.State(q, np.zeros((3, 2)), links=~np.eye(3, dtype=bool))
    world = {"control": fk.Held(0.05), "information": fk.Messages(0.05, loss=0.3, expires=0.05, seed=1)}
    bodies = fk.SingleIntegrator() if order == 1 else fk.PointMass()
    made = fk.Scenario(law, start, t_end=5.0, frames=3, bodies=bodies, **world)
    found = fk.certify(made)["equilibrium_loss"]
    assert found.outcome == "refused"
    assert "does not come back" in found.reason
    run = fk.simulate(made, progress=False)
    sides = [np.abs(np.linalg.norm(q - np.roll(q, 1, axis=0), axis=1) - 1.0).max() for q in run.q]
    assert sides[-1] > 1e-7
    wider = made.with_(law=fk.Law(fk.Hysteresis(1.4, 0.2), terms))
    assert fk.certify(wider)["equilibrium_loss"].granted
    run = fk.simulate(wider, progress=False)
    sides = [np.abs(np.linalg.norm(q - np.roll(q, 1, axis=0), axis=1) - 1.0).max() for q in run.q]
    assert sides[-1] < 1e-9
