"""The centre of mass: its drift and its error behind a leader, against the paper's closed forms and runs."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.papers.shi_2009.closed_forms import steady_velocity_error
from flocking.study.certificates.comparison import compare

PULL = fk.Gradient(fk.Potential("1/r + r**2"))
START = fk.State([[0.0, 0], [1, 0], [0, 1.2]], [[0.3, 0], [0, 0.1], [0, 0.5]])
MASSES = np.array([1.0, 2.0, 0.5])


def made(track: fk.Track | None, **changes: object) -> fk.Scenario:
    terms = [PULL, fk.Consensus(0.7)] if track is None else [PULL, fk.Consensus(0.7), track]
    return fk.Scenario(fk.Law(fk.Proximity(3.0), terms), START, t_end=4.0, frames=21, **changes)


@pytest.mark.parametrize("bodies", [fk.PointMass(), fk.PointMass(MASSES)])
def test_without_a_leader_the_centre_drifts_steadily(bodies):
    scenario = made(None, bodies=bodies)
    found = fk.certify(scenario)
    masses = np.broadcast_to(np.asarray(bodies.masses), 3)
    exact = np.linalg.norm((masses[:, None] * START.p).sum(axis=0) / masses.sum())
    assert found["steady_drift"].bound.lo <= exact <= found["steady_drift"].bound.hi
    rows = {r.key: r for r in compare(found, fk.simulate(scenario, progress=False))}
    assert rows["steady_drift"].kept
    assert rows["steady_drift"].tightness == pytest.approx(1.0, abs=1e-9)
    assert fk.certify(made(None, bodies=fk.PointMass(1.0, 0.1)))["steady_drift"].outcome == "not applicable"


@pytest.mark.parametrize(
    ("position", "velocity"), [(0.0, 0.8), (0.1, 2.0), (3.0, 0.5), (1.5, 0.0)]
)  # fmt: skip
def test_the_error_behind_a_steady_leader_is_known_at_all_times(position, velocity):
    track = fk.Track(fk.Velocity([0.5, -0.2], start=[1.0, 1.0]), position, velocity, per_mass=True)
    scenario = made(track, bodies=fk.PointMass(MASSES))
    found = fk.certify(scenario)
    rows = {r.key: r for r in compare(found, fk.simulate(scenario, progress=False))}
    assert rows["mean_leader_error"].kept
    end = rows["mean_leader_error_at_end"]
    assert end.kept
    assert end.observed == pytest.approx(end.promised, rel=1e-6)
    assert found["steady_leader_error"].granted == (velocity > 0)


@pytest.mark.parametrize(("position", "law"), [(0.0, 12), (2.0, 15)])
def test_the_steady_error_is_that_of_the_paper(position, law):
    """v0 = (sin t, cos t): 1/sqrt(1 + h0^2) under (12), 1/sqrt((r0 - 1)^2 + h0^2) under (15), all axes alike."""
    track = fk.Track(fk.Path(["sin(t)", "cos(t)"]), position, 0.7, per_mass=True)
    bound = fk.certify(made(track))["steady_leader_error"].bound
    exact = steady_velocity_error(law, 0.7, position) * np.sqrt(2.0)
    assert bound.lo <= exact * (1 + 1e-12)
    assert exact * (1 - 1e-12) <= bound.hi
    assert bound.hi - bound.lo < 1e-12
    known = fk.Track(fk.Path(["sin(t)", "cos(t)"]), position, 0.7, 1.0, per_mass=True)
    assert fk.certify(made(known))["steady_leader_error"].bound.hi == 0.0


def test_a_constant_acceleration_leaves_a_constant_error():
    """|a0| = 0.5: 0.5/c1 of positions, 0.5/c2 of velocities."""
    for position, exact in ((2.0, 0.25), (0.0, 0.625)):
        track = fk.Track(fk.Path(["3*t/10", "4*t/10"]), position, 0.8)
        scenario = made(track)
        bound = fk.certify(scenario)["steady_leader_error"].bound
        assert bound.hi == pytest.approx(exact)
        run = fk.simulate(scenario.with_(t_end=40.0, frames=2), progress=False)
        leader = track.leader.at(40.0)
        error = run.q[-1].mean(axis=0) - leader[0] if position else run.p[-1].mean(axis=0) - leader[1]
        assert np.linalg.norm(error) == pytest.approx(exact, rel=1e-4)
        assert fk.certify(scenario)["mean_leader_error"].outcome == "refused"


@pytest.mark.parametrize(
    ("track", "bodies", "reason"),
    [
        (fk.Track([1.0, 0.0], 0.0, [1.0, 1.0, 0.0]), fk.PointMass(), "gains differ"),
        (fk.Track([1.0, 0.0]), fk.PointMass(MASSES), "masses differ"),
        (fk.Track([1.0, 0.0], 0.0, fk.Schedule([1.0], [1.0, 0.0])), fk.PointMass(), "change in time"),
        (fk.Track([1.0, 0.0], saturated=True), fk.PointMass(), "saturated"),
        (fk.Track(fk.Path(["where(t < 1, 0, 5)", "0"])), fk.PointMass(), "continuous at 1"),
    ],
)  # fmt: skip
def test_what_is_not_a_motion_of_the_centre_alone_is_refused(track, bodies, reason):
    found = fk.certify(made(track, bodies=bodies))["mean_leader_error"]
    assert found.outcome == "refused"
    assert reason in found.reason
