"""Positions that jump, or that a file rounded, decide nothing; those of honest motions jump nowhere."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.sample_files.jumps import largest_jump
from flocking.study.sample_files.reading import read_samples
from flocking.study.sample_files.sampled_runs import motion_of
from flocking.study.sample_files.samples import Samples

T = np.linspace(0.0, 10.0, 201)
NAMES = ("a", "b", "c")
BOX = 10.0
OPEN = (Verdict.NOT_RESOLVED, Verdict.NOT_YET)


def row_of_agents():
    """Three agents in a row, 0.8 apart, that move along it; the middle one swings a little beside it."""
    q, p = np.zeros((201, 3, 2)), np.zeros((201, 3, 2))
    q[:, :, 0] = T[:, None] + np.array([0.0, 0.8, 1.6])
    q[:, :, 1] = 5.0
    q[:, 1, 1] += 0.05 * np.sin(T)
    p[:, :, 0] = 1.0
    p[:, 1, 1] = 0.05 * np.cos(T)
    return q, p


def audited(q, p, radius=2.0, t=T):
    return motion_of(Samples(t, q, p, NAMES[: q.shape[1]]), radius=radius)


@pytest.mark.parametrize("given", [True, False])
def test_positions_wrapped_into_a_box_do_not_refute_that_neighbours_stay_together(given):
    """At all times neighbours are at most 0.81 apart; wrapped, they are seen 8.4 or more apart."""
    q, p = row_of_agents()
    honest = audited(q, p if given else None).audit()
    assert honest["connected"].verdict is honest["neighbours-kept"].verdict is Verdict.HOLDS
    found = audited(q % BOX, p if given else None)
    assert found.run.fidelity.position_error == pytest.approx(BOX, rel=0.01)
    assert "wrapped into a box" in found.run.provenance["velocities"]
    for key in ("connected", "neighbours-kept", "apart"):
        assert found.audit()[key].verdict is Verdict.NOT_RESOLVED, key


def test_a_ledger_of_wrapped_positions_is_open():
    q, p = row_of_agents()
    q, p = q[:, [0, 2]], p[:, [0, 2]]
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("k*(r - 1.6)**2/2", k=1.0))])
    declared = fk.Scenario(law, fk.State(q[0], p[0]), t_end=10.0)
    samples = Samples(T, q, p, NAMES[:2])
    assert motion_of(samples, declared).audit()["ledger"].verdict is Verdict.HOLDS
    wrapped = Samples(T, q % BOX, p, NAMES[:2])
    assert motion_of(wrapped, declared).audit()["ledger"].verdict is Verdict.NOT_RESOLVED


@pytest.mark.parametrize("given", [True, False])
def test_agents_that_exchange_their_names_are_found(given):
    q, p = row_of_agents()
    q[100:], p[100:] = q[100:, [2, 1, 0]], p[100:, [2, 1, 0]]
    found = largest_jump(T, q, p if given else None)
    assert found.size == pytest.approx(1.6, rel=0.05)
    assert found.time == T[100]
    assert found.agent in (0, 2)


@pytest.mark.parametrize("given", [True, False])
def test_one_lost_place_is_found(given):
    q, p = row_of_agents()
    q[60, 1] = 0.0
    found = largest_jump(T, q, p if given else None)
    assert (found.agent, found.time) in [(1, T[60]), (1, T[61])]
    assert found.size == pytest.approx(5.0, abs=0.2)


@pytest.mark.parametrize("given", [True, False])
@pytest.mark.parametrize("noise", [0.0, 1e-6, 1e-3, 0.1])
@pytest.mark.parametrize("offset", [0.0, 5.4e6])
def test_honest_motions_do_not_jump(given, noise, offset):
    """A circle, a start from rest, a stop, a swing and a turn on the spot, with noise, far away, at late times."""
    draw = np.random.default_rng(3)
    ramp = np.clip(T - 5.0, 0.0, 2.0)
    q = np.stack(
        [
            np.stack([np.cos(T), np.sin(T)], axis=1),
            np.stack([0.5 * ramp**2, 0.0 * T], axis=1),
            np.stack([np.sin(3 * T), np.abs(T - 5.0)], axis=1),
        ],
        axis=1,
    )
    p = np.stack(
        [
            np.stack([-np.sin(T), np.cos(T)], axis=1),
            np.stack([ramp * (T < 7.0), 0.0 * T], axis=1),
            np.stack([3 * np.cos(3 * T), np.sign(T - 5.0)], axis=1),
        ],
        axis=1,
    )
    measured = q + offset + noise * draw.normal(size=q.shape)
    assert largest_jump(T, measured, p if given else None) is None
    assert largest_jump(T + 1.7e9, measured, p if given else None) is None


def east_and_north(tmp_path, speed, velocities, kind):
    """Two agents 1.99 m apart and one beside the first, as a file of single precision holds them: rounded to 0.5 m."""
    place = np.array([[4.5e5, 5.4e6], [4.5e5 + 0.01, 5.4e6 + 0.2], [4.5e5 + 1.99, 5.4e6]])
    p = np.zeros((201, 3, 2))
    p[:, :, 1] = speed
    q = (place + p * T[:, None, None]).astype(np.float32)
    path = tmp_path / f"places.{kind}"
    if kind == "npz":
        np.savez(path, t=T, q=q, **({"p": p} if velocities else {}))
        return read_samples(path)
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    flat = {"t": np.repeat(T, 3), "id": np.tile(np.arange(3), 201), "x": q[..., 0].ravel(), "y": q[..., 1].ravel()}
    if velocities:
        flat |= {"vx": p[..., 0].ravel(), "vy": p[..., 1].ravel()}
    parquet.write_table(pyarrow.table(flat), path)
    return read_samples(path)


@pytest.mark.parametrize("kind", ["npz", "parquet"])
@pytest.mark.parametrize("velocities", [True, False])
@pytest.mark.parametrize("speed", [0.0, 0.01])
def test_rounding_of_single_precision_is_an_error(tmp_path, speed, velocities, kind):
    """Places of 0.2 m apart are stored as one, and 1.99 m as 2: neither is what the agents did."""
    samples = east_and_north(tmp_path, speed, velocities, kind)
    assert samples.rounding[0] == 0.25
    found = motion_of(samples, radius=2.0)
    assert found.run.fidelity.position_error >= 0.25
    for key in ("apart", "connected", "neighbours-kept"):
        assert found.audit()[key].verdict is Verdict.NOT_RESOLVED, key
    if not velocities:
        assert found.run.fidelity.velocity_error > speed


def test_slow_agents_whose_places_are_rounded_are_not_said_to_have_met():
    """Velocities of 1 cm/s beside places in steps of 0.5 m, in double precision: a place is the same for 50 s."""
    t = np.arange(201.0)
    p = np.zeros((201, 2, 2))
    p[:, :, 1] = 0.01
    q = p * t[:, None, None] + np.array([[0.0, 0.0], [0.1, 0.2]])
    found = audited((2.0 * q).round() / 2.0, p, t=t)
    assert found.run.fidelity.position_error == pytest.approx(0.49, abs=0.02)
    assert found.audit()["apart"].verdict is Verdict.NOT_RESOLVED


def test_distances_do_not_settle_by_rounding():
    """The middle agent swings for ever, by less than the positions are rounded."""
    q, p = row_of_agents()
    exact = audited(q, p).audit()["distances-settle"].verdict
    assert exact in OPEN
    q[..., 1] = q[..., 1].round()
    assert audited(q, p).audit()["distances-settle"].verdict in OPEN


@pytest.mark.parametrize("unit", [1.0, 1e-3, 1e-9, 1e6])
def test_a_mean_velocity_that_turns_is_not_constant_in_any_unit(unit):
    """Two agents 1 apart on equal circles: the energy is constant, and the mean velocity turns."""
    q, p = np.zeros((201, 2, 2)), np.zeros((201, 2, 2))
    q[:, :, 0], q[:, :, 1] = np.sin(T)[:, None], -np.cos(T)[:, None]
    q[:, 1, 1] += 1.0
    p[:, :, 0], p[:, :, 1] = np.cos(T)[:, None], np.sin(T)[:, None]
    law = fk.Law(fk.Proximity(5.0 * unit), [fk.Consensus(0.5)])
    declared = fk.Scenario(law, fk.State(unit * q[0], unit * p[0]), t_end=10.0)
    report = motion_of(Samples(T, unit * q, unit * p, NAMES[:2]), declared).audit()
    assert report["ledger"].verdict is Verdict.HOLDS
    assert report["momentum"].verdict is Verdict.FAILS
    rest = motion_of(Samples(T, unit * q[:1].repeat(201, 0), 0.0 * p, NAMES[:2]), declared).audit()
    assert rest["momentum"].verdict is Verdict.HOLDS


def test_velocities_that_are_set_at_ticks_may_be_others_between_two_samples():
    """An agent that goes back for half the time between two samples is where it was: in continuous time it jumped."""
    t = np.arange(20.0)
    q, p = np.zeros((20, 2, 1)), np.ones((20, 2, 1))
    q[:, :, 0] = t[:, None] + [0.0, 5.0]
    q[8:, 0] -= 1.0
    assert largest_jump(t, q, p, discrete=True) is None
    found = largest_jump(t, q, p)
    assert (found.size, found.time, found.agent) == (1.0, 8.0, 0)
    q[8:, 0] -= 1.5
    assert largest_jump(t, q, p, discrete=True).size == 2.5
