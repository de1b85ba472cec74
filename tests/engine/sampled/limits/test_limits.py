"""Forces that are computed, held, and then limited: recursions by hand, the limit of short periods, and the log."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.sampled.actuation import Actuation
from flocking.engine.sampled.law_in_force import SampledLaw
from flocking.engine.sampled.session import SampledSession
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.bodies.actuators import scaled_back
from tests.engine.sampled.test_sessions import same

PAIR = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [6.0, 2.0]], [[0.0, 0.0], [-1.0, 0.5]])
FORCES = [1.0, 2.0]


def scenario(shape="ball", force=FORCES, **parts):
    given = {"control": fk.Held(0.1), "bodies": fk.Limited(fk.PointMass(), force=force, shape=shape)}
    return fk.Scenario(PAIR, START, t_end=4.0, frames=41, **{**given, **parts})


def by_hand(limit):
    """Positions at the ticks, and the forces wanted and exerted from each of them."""
    q, p, rows = START.q.copy(), START.p.copy(), []
    for _ in range(40):
        wanted = q[::-1] - q + p[::-1] - p
        u = limit(wanted)
        rows.append((q.copy(), wanted, u))
        q, p = q + 0.1 * p + 0.005 * u, p + 0.1 * u
    return rows, q


def ball(wanted):
    length = np.hypot(wanted[:, 0], wanted[:, 1])
    return wanted * np.minimum(1.0, np.array(FORCES) / length)[:, None]


def box(wanted):
    return np.minimum(np.maximum(wanted, -np.array(FORCES)[:, None]), np.array(FORCES)[:, None])


@pytest.mark.parametrize(("shape", "limit"), [("ball", ball), ("box", box)])
def test_a_held_force_is_scaled_back_as_the_recursion_says(shape, limit):
    run = fk.simulate(scenario(shape), progress=False)
    assert run.fidelity.engine == "sampled"
    rows, last = by_hand(limit)
    assert np.abs(run.q[:40] - np.array([q for q, _, _ in rows])).max() < 1e-12
    assert np.abs(run.q[-1] - last).max() < 1e-12
    assert np.abs(run.residual).max() < 1e-11 * max(1.0, run.turnover)
    assert any((u != wanted).any() for _, wanted, u in rows)
    assert any((u == wanted).all() for _, wanted, u in rows)
    # What the limit takes away works from tick to tick.
    places = [*(q for q, _, _ in rows), last]
    work = sum(float(((u - wanted) * (b - a)).sum()) for (a, wanted, u), b in zip(rows, places[1:], strict=True))
    shares = fk.departed_causes(run).causes
    assert shares["limits"][-1] == pytest.approx(work, abs=1e-10)
    assert abs(shares["limits"][-1]) > 1e-2
    assert not shares["delay"].any()


def test_a_velocity_is_scaled_back_where_agents_have_no_inertia():
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
    bodies = fk.Limited(fk.SingleIntegrator(), speed=1.5)
    made = fk.Scenario(law, fk.State([[0.0], [8.0]]), t_end=4, frames=5, bodies=bodies, control=fk.Held(0.25))
    run = fk.simulate(made, progress=False)
    assert run.q[1:3, 0, 0] == pytest.approx([1.5, 3.0], abs=1e-12)
    assert fk.replay(run).agrees
    assert np.abs(run.residual).max() < 1e-11 * max(1.0, run.turnover)


def test_a_limit_that_is_never_reached_changes_no_bit():
    free = fk.simulate(scenario(bodies=fk.PointMass()), progress=False)
    run = fk.simulate(scenario(force=1e6), progress=False)
    assert same(run, free)
    assert not fk.departed_causes(run).causes["limits"].any()


def test_short_periods_tend_to_the_limited_motion_of_continuous_control():
    ideal = fk.simulate(scenario(control=fk.Continuous(), tolerance=1e-11), progress=False).q[-1]
    gaps = [
        np.abs(fk.simulate(scenario(control=fk.Held(period)), progress=False).q[-1] - ideal).max()
        for period in (0.02, 0.01)
    ]
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(1.0, abs=0.15)


WORLD = {"information": fk.Messages(0.1, delay=0.05, loss=0.2, seed=3), "control": fk.Held(0.1, latency=0.03)}


def test_limited_runs_go_on_with_the_same_bits_and_their_log_is_right():
    made = scenario(**WORLD)
    whole = fk.simulate(made, progress=False)
    session = fk.start(made)
    session.advance(1.234)
    again = session.moment()()
    again.advance(4.0)
    assert same(again.run(), whole)
    found = fk.replay(whole)
    assert found.agrees, str(found)


def test_saturation_before_the_hold_is_caught(monkeypatch):
    """The log holds what was computed; a force that was limited before it was logged is not that of the law."""
    monkeypatch.setattr(SampledSession, "in_blocks", False)
    forces = SampledLaw.forces
    monkeypatch.setattr(SampledLaw, "forces", lambda *given: np.clip(forces(*given), -1.0, 1.0))
    assert "its force is logged as" in str(fk.replay(fk.simulate(scenario(**WORLD), progress=False)))


def test_a_limit_that_is_left_out_is_caught(monkeypatch):
    monkeypatch.setattr(SampledSession, "in_blocks", False)
    monkeypatch.setattr(Actuation, "exerted", lambda self, agents, force, p: force)
    assert "from where the logged forces lead" in str(fk.replay(fk.simulate(scenario(**WORLD), progress=False)))


def test_a_safety_filter_is_for_bodies_that_brake_as_it_says():
    with pytest.raises(UnsupportedLaw, match="SafetyFilter is for"):
        fk.start(scenario(control=fk.SafetyFilter(0.1, distance=0.5, acceleration=2.0)))


@pytest.mark.parametrize(
    ("bodies", "t_end", "said"),
    [
        (fk.Lagged(fk.PointMass(), 1e-6), 0.5, "time_constant must be at least 1.6e-06"),
        (fk.Limited(fk.Lagged(fk.PointMass(), 1e-140), rate=1.0), 0.5, "time_constant"),
        (fk.Lagged(fk.PointMass(), 1e-9), 1e-5, "time_constant must be at least 3.2e-08"),
        (fk.PointMass(damping=1e7), 0.5, "damping must be at most 625000 times the mass"),
        (fk.PointMass(masses=[1.0, 1e-9], damping=1.0), 0.5, "damping"),
    ],
)
def test_time_constants_that_would_make_too_many_pieces_are_refused_by_name(bodies, t_end, said):
    """Pieces are 1/32 of a time constant: at most ten million of them, none below a nanosecond."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    made = fk.Scenario(law, fk.State([[0.0], [1.0]]), t_end=t_end, bodies=bodies, control=fk.Held(t_end / 5))
    with pytest.raises(InvalidInput, match=said):
        fk.start(made, engine="sampled")


def test_a_tiny_largest_rate_holds_a_lagged_force_without_a_warning(recwarn):
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    made = fk.Scenario(
        law, fk.State([[0.0], [1.0]]), t_end=0.2, frames=3, control=fk.Held(0.1),
        bodies=fk.Limited(fk.Lagged(fk.PointMass(), 0.2), rate=1e-300),
    )  # fmt: skip
    run = fk.simulate(made, engine="sampled", progress=False)
    assert np.abs(run.q[-1] - run.q[0]).max() < 1e-290
    assert not [w for w in recwarn if issubclass(w.category, RuntimeWarning)]


@pytest.mark.parametrize("unit", [1e-300, 1e-170, 1e160, 1e300])
def test_forces_whose_squares_overflow_or_vanish_are_scaled_back_to_the_limit(unit):
    force, most = np.array([[3.0, -4.0], [0.3, 0.4], [0.0, 0.0]]) * unit, np.full((3, 1), 2.0 * unit)
    found = scaled_back(force, most, each_axis=False) / unit
    assert np.allclose(found, [[1.2, -1.6], [0.3, 0.4], [0.0, 0.0]], rtol=1e-14)


@pytest.mark.parametrize("constant", [1e90, 1e70])
def test_a_huge_desired_force_is_limited_in_the_native_loop_too(constant):
    """Two agents that repel each other so are pushed apart with the largest force, not left without one."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("-a*b*r", a=1e90, b=constant))])
    body = fk.Limited(fk.PointMass(), force=2.0)
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [3.0, 4.0]]), t_end=1.0, frames=3, agents=body, control=fk.Held(0.25))
    # A force of 2 along (3, 4)/5 for a time of 1 leads 1 away.
    assert np.allclose(fk.simulate(made, progress=False).q[-1], [[-0.6, -0.8], [3.6, 4.8]], rtol=1e-12)
