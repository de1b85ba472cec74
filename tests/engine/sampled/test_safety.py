"""The safety filter of held control: what it keeps, when it does not, and the nearest acceleration it takes."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.imperfect.messages.knowledge import Known
from flocking.engine.protocol.session import Stored
from flocking.engine.sampled.nearest_force import nearest
from flocking.engine.sampled.safety import ForceFilter, continuous_bound, filter_counts, sampled_bound
from flocking.engine.sampled.session import SampledSession
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.study.certificates.comparison import compare

ANGLES = np.array([0.3, 0.3 + 2 * np.pi / 3, 0.35 + 4 * np.pi / 3])
OUT = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
LAW = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2"))])


def crossing(control, **changes):
    """Three agents that head for one point at a speed of 1.9 and attract each other."""
    return fk.Scenario(LAW, fk.State(3.0 * OUT, -1.9 * OUT), t_end=8.0, frames=17, control=control, **changes)


def filtered(period, form="sampled", **changes):
    return fk.SafetyFilter(period, distance=0.7, acceleration=10.0, form=form, **changes)


def verdict(run):
    return str(fk.audit(run)["safe-distance"].verdict)


def test_three_double_integrators_collide_without_the_filter_and_not_with_it():
    free = fk.simulate(crossing(fk.Held(0.02)), progress=False)
    assert free.closest.distance < 0.05
    assert verdict(free) == "not applicable"
    for form in ("continuous", "sampled"):
        run = fk.simulate(crossing(filtered(0.02, form)), progress=False)
        assert run.closest.distance >= 0.7 * (1 - 1e-9)
        assert run.closest.distance < 0.75
        assert verdict(run) == "holds"
        assert run.provenance["forces changed by the safety filter"] > 100
        assert run.provenance["its conditions relaxed"] == 0


@pytest.mark.parametrize("period", [0.1, 0.2, 0.4])
def test_sampling_breaks_the_condition_of_continuous_time_and_not_that_of_held_forces(period):
    broken = fk.simulate(crossing(filtered(period, "continuous")), progress=False)
    assert broken.closest.distance < 0.65
    assert verdict(broken) == "fails"
    kept = fk.simulate(crossing(filtered(period)), progress=False)
    assert kept.closest.distance >= 0.7 * (1 - 1e-9)
    assert verdict(kept) == "holds"


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 10**9), st.floats(0.01, 1.0), st.floats(0.1, 50.0), st.sampled_from([1, 2, 3]))
def test_two_agents_never_come_closer_whatever_the_law_and_the_period(seed, period, gain, m):
    rng = np.random.default_rng(seed)
    most = rng.uniform(0.5, 5.0, 2)
    q, p = rng.normal(size=(2, m)) * 2.0, rng.normal(size=(2, m)) * 2.0
    control = fk.SafetyFilter(period, distance=0.5, acceleration=most, gain=gain)
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("k*r**2/2", k=float(rng.uniform(0.1, 20.0))))])
    bodies = fk.PointMass(rng.uniform(0.5, 2.0, 2))
    made = fk.Scenario(law, fk.State(q, p), t_end=12.0, frames=7, control=control, agents=bodies)
    certificates = fk.certify(made)
    apart = np.linalg.norm(q[1] - q[0])
    closing = max(-(q[1] - q[0]) @ (p[1] - p[0]) / apart, 0.0)
    able = apart - 0.5 - closing**2 / (2 * most.sum())
    assume(abs(able) > 1e-6)
    assert certificates["safe_distance"].granted == (able > 0)
    if able < 0:
        return
    run = fk.simulate(made, progress=False)
    assert run.closest.distance >= 0.5 * (1 - 1e-9)
    assert run.provenance["its conditions relaxed"] == 0
    assert all(c.kept is not False for c in compare(certificates, run))
    assert {c.key for c in compare(certificates, run)} == {"safe_distance"}
    assert verdict(run) == "holds"


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**9), st.integers(1, 7), st.sampled_from([2, 3]))
def test_the_nearest_acceleration_is_that_of_another_solver(seed, count, m):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, m))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    inside = rng.normal(size=m) * 0.5
    bounds = normals @ inside - rng.exponential(0.5, count)
    wanted, most = rng.normal(size=m) * 3.0, float(np.linalg.norm(inside) + rng.exponential(0.5))
    found, fits = nearest(wanted, normals, bounds, most)
    assert fits
    assert (normals @ found >= bounds - 1e-8).all()
    assert np.linalg.norm(found) <= most * (1 + 1e-9)
    limits = [{"type": "ineq", "fun": lambda u: normals @ u - bounds},
              {"type": "ineq", "fun": lambda u: most**2 - u @ u}]  # fmt: skip
    other = minimize(lambda u: ((u - wanted) ** 2).sum(), inside, constraints=limits, method="SLSQP",
                     options={"ftol": 1e-14, "maxiter": 500})  # fmt: skip
    assert ((found - wanted) ** 2).sum() <= other.fun + 1e-6


def test_contradicting_conditions_are_relaxed_by_the_least_amount():
    """Between two agents that ask for 1 to the right and 1 to the left: zero, with both short by 1."""
    found, fits = nearest(np.array([0.5, 0.2]), np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([1.0, 1.0]), 4.0)
    assert not fits
    assert found == pytest.approx([0.0, 0.2], abs=1e-9)
    # One asks for more than there is: as much as there is.
    found, fits = nearest(np.array([0.0, 3.0]), np.array([[1.0, 0.0]]), np.array([6.0]), 4.0)
    assert not fits
    assert found == pytest.approx([4.0, 0.0], abs=1e-5)
    # What is missed by more than rounding is told, however little: a millionth of the largest acceleration.
    for asked, kept in ((4e-6, False), (4e-11, True)):
        assert nearest(np.zeros(2), np.array([[1.0, 0.0], [-1.0, 0.0]]), np.full(2, asked), 4.0)[1] == kept


def test_what_is_relaxed_is_told():
    """An agent between two that close in from both sides at their limits."""
    start = fk.State([[-3.0, 0.0], [0.0, 0.0], [3.0, 0.0]], [[3.0, 0.0], [0.0, 0.0], [-3.0, 0.0]])
    control = fk.SafetyFilter(0.1, distance=1.0, acceleration=0.5, gain=50.0)
    run = fk.simulate(fk.Scenario(LAW, start, t_end=4.0, control=control), progress=False)
    assert run.provenance["its conditions relaxed"] > 0
    assert 0.0 <= run.provenance["first relaxed at"] < 4.0
    assert verdict(run) == "fails"


def test_the_bound_of_a_period_is_the_least_that_lets_agents_brake():
    """By small steps: with the bound the reserve after the period is zero, with less it is negative."""
    rng = np.random.default_rng(3)
    for _ in range(300):
        r, closing, braking, period = rng.uniform(1, 4), rng.uniform(-2, 3), rng.uniform(1, 6), rng.uniform(0.01, 1)
        if r - 1.0 - max(closing, 0.0) ** 2 / (2 * braking) < 0.01:
            continue
        bound = float(
            sampled_bound(np.array([r]), np.array([closing]), np.array([braking]), np.array([1.0]), period)[0]
        )
        for less, sign in ((0.0, 0), (0.01 + 0.01 * abs(bound), -1)):
            t = np.linspace(0.0, period, 2001)
            along = r - closing * t + 0.5 * (bound - less) * t**2
            speed = closing - (bound - less) * period
            reserve = min(along.min() - 1.0, along[-1] - 1.0 - max(speed, 0.0) ** 2 / (2 * braking))
            assert reserve == pytest.approx(0.0, abs=1e-5) if sign == 0 else reserve < 0.0


def test_the_condition_of_continuous_time_is_that_of_the_barrier():
    """By differences: at the bound the barrier h falls exactly as fast as its gain allows."""
    rng = np.random.default_rng(4)
    for _ in range(50):
        dp, dv, braking = rng.normal(size=2) * 3, rng.normal(size=2) * 0.3, 8.0
        if np.linalg.norm(dp) < 1.2:
            continue
        n = dp / np.linalg.norm(dp)
        bound = float(continuous_bound(dp[None], dv[None], np.array([braking]), 1.0, 0.4)[0])

        def barrier(t, dp=dp, dv=dv, du=bound * n, braking=braking):
            d, v = dp + t * dv + 0.5 * t**2 * du, dv + t * du
            r = np.linalg.norm(d)
            return np.sqrt(2 * braking * (r - 1.0)) + d @ v / r

        slope = (barrier(1e-5) - barrier(-1e-5)) / 2e-5
        assert slope == pytest.approx(-0.4 * barrier(0.0) ** 3, rel=1e-5, abs=1e-6)


def test_agents_that_are_too_close_already_do_not_switch_off_the_filter():
    """One that is too close and leaves asks for nothing; another one that closes in is braked for all the same."""
    q = [[0.0, 0.0], [-0.5, 0.0], [2.0, 0.0]]
    p = [[0.0, 0.0], [-3.0, 0.0], [-2.0, 0.0]]
    law = fk.Law(fk.Fixed.complete(3), [fk.Consensus(0.0)])
    run = fk.simulate(
        fk.Scenario(
            law, fk.State(q, p), t_end=3.0, frames=61, control=fk.SafetyFilter(0.1, distance=0.7, acceleration=4.0)
        ),
        progress=False,
    )
    away = np.linalg.norm(run.q[:, 0] - run.q[:, 2], axis=1)
    assert away.min() >= 0.7 * (1 - 1e-9)
    assert away.min() < 1.9


@pytest.mark.parametrize("form", ["sampled", "continuous"])
def test_agents_at_the_distance_and_at_one_point_are_pushed_apart(form):
    for gap in (0.0, 0.3, 0.7):
        start = fk.State([[0.0, 0.0], [gap, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
        law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(0.0)])
        session = fk.start(fk.Scenario(law, start, t_end=1.0, frames=3, control=filtered(0.05, form)))
        session.advance(0.01)
        found = session.accelerations()
        assert np.isfinite(found).all()
        if gap:
            assert found[:, 0] == pytest.approx([-10.0, 10.0], rel=1e-5)


def test_forces_stay_within_their_bound():
    session = fk.start(crossing(fk.SafetyFilter(0.05, distance=0.7, acceleration=[1.0, 2.0, 3.0])))
    for t in np.arange(0.01, 4.0, 0.05):
        session.advance(float(t))
        assert (np.linalg.norm(session.accelerations(), axis=1) <= np.array([1.0, 2.0, 3.0]) * (1 + 1e-9)).all()


def test_runs_go_on_with_the_same_bits(tmp_path):
    made = crossing(filtered(0.05, gain=2.0))
    whole = fk.simulate(made, save=tmp_path / "run", progress=False)
    for at in (0.72, 1.0, 3.333):
        session = fk.start(made)
        session.advance(at)
        again = session.moment()()
        again.advance(8.0)
        assert fk.first_difference(again.run(), whole) is None
        assert again.run().provenance == whole.provenance
    assert fk.first_difference(fk.read_run(tmp_path / "run"), whole) is None
    session = fk.start(made)
    session.advance(2.0)
    numbers, arrays = session.pack()
    stored = Stored(made, None, session.records.counts, lambda: session.run("unfinished"))
    for name, wrong in (("filter_normals", np.full((3, 3, 2), 2.0)), ("filter_counts", np.zeros(2, dtype=np.int64))):
        with pytest.raises(MalformedError):
            SampledSession.unpack((numbers, {**arrays, name: wrong}), stored, {})


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"control": filtered(0.1, "continuous")}, "condition is that of held forces"),
        ({}, "two agents"),
        ({"agents": fk.Agents(damping=0.1)}, "two agents"),
    ],
)
def test_no_guarantee_is_given_beyond_the_theorem(changes, reason):
    found = fk.certify(crossing(filtered(0.1)).with_(**changes))["safe_distance"]
    assert found.outcome == "refused"
    assert reason in found.reason


def test_guarantees_of_two_agents_need_their_hypotheses():
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    made = fk.Scenario(law, fk.State([[0.0, 0.0], [3.0, 0.0]]), t_end=1.0, control=filtered(0.1))
    assert fk.certify(made)["safe_distance"].granted
    for changes, reason in (
        ({"information": fk.Messages(0.1)}, "present state"), ({"control": filtered(0.1, phase=0.05)}, "act together"),
        ({"control": filtered(0.1, latency=0.05)}, "act together"), ({"agents": fk.Agents(damping=0.1)}, "undamped"),
        ({"start": fk.State([[0.0, 0.0], [0.6, 0.0]])}, "brake before"), ({"space": fk.Periodic([9.0, 9.0])}, "space"),
    ):  # fmt: skip
        law_ = fk.Law(fk.Proximity(4.0), law.terms) if "space" in changes else law
        found = fk.certify(made.with_(law=law_, **changes))["safe_distance"]
        assert found.outcome == "refused"
        assert reason in found.reason, found.reason
    assert fk.certify(made.with_(control=fk.Held(0.1)))["safe_distance"].outcome == "not applicable"


def test_consensus_behind_a_filter_has_no_certificate_of_linear_consensus():
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    start = fk.State(3.0 * OUT)
    for control, granted in ((fk.Held(0.1), True), (filtered(0.1), False)):
        found = fk.certify(fk.Scenario(law, start, t_end=1.0, control=control))
        assert found["growth_in_world"].granted == granted


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: fk.SafetyFilter(0.1, distance=0.0, acceleration=1.0), "SafetyFilter: distance"),
        (lambda: fk.SafetyFilter(0.1, distance=1.0, acceleration=-1.0), "SafetyFilter: acceleration"),
        (lambda: fk.SafetyFilter(0.1, distance=1.0, acceleration=1.0, form="discrete"), "SafetyFilter: form"),
        (lambda: fk.SafetyFilter(0.1, distance=1.0, acceleration=1.0, gain=0.0), "SafetyFilter: gain"),
        (lambda: fk.SafetyFilter(0.0, distance=1.0, acceleration=1.0), "period"),
        (lambda: crossing(fk.SafetyFilter(0.1, distance=1.0, acceleration=[1.0, 2.0])), "one value for each of the 3"),
        (lambda: crossing(filtered(0.1), agents=fk.Impulsive()), "must be Held alone"),
    ],
)  # fmt: skip
def test_wrong_values_are_refused(make, said):
    with pytest.raises(InvalidInput, match=said):
        make()


@pytest.mark.parametrize("agents", [fk.Agents(damping=0.1), fk.SingleIntegrator()])
def test_agents_that_do_not_brake_by_their_force_alone_are_refused(agents):
    with pytest.raises(UnsupportedLaw, match="undamped point masses"):
        fk.start(crossing(filtered(0.1), agents=agents))


@pytest.mark.parametrize("size", [1e3, 1e7, 1e13, 1e20, 1e200, 1e308])
def test_what_is_nearest_to_a_far_acceleration_is_that_of_its_direction(size):
    """A condition along an axis, and a disc of radius 6: towards the disc alone, or the corner of both."""
    normals, bounds = np.array([[1.0, 0.0]]), np.array([-3.0])
    free, there = nearest(np.array([size, 0.3 * size]), normals, bounds, 6.0)
    np.testing.assert_allclose(free, 6.0 * np.array([1.0, 0.3]) / np.hypot(1.0, 0.3), rtol=1e-9)
    held, also = nearest(np.array([-size, 0.3 * size]), normals, bounds, 6.0)
    np.testing.assert_allclose(held, [-3.0, np.sqrt(27.0)], rtol=1e-9)
    assert there
    assert also


def test_a_safety_filter_is_described_with_its_phase_and_latency():
    keeper = fk.SafetyFilter(0.1, phase=0.03, latency=0.02, distance=0.7, acceleration=10.0)
    assert keeper.summary == "control held for 0.1 behind a safety filter, first at 0.03, acting 0.02 later"


def test_the_first_relaxation_is_told_in_the_scenarios_time():
    """Two that ask one between them for more than it has: at 0.3 s and at 0.4 s after a start at 7."""
    q = np.array([[0.0, 0.0], [-1.2, 0.0], [1.2, 0.0]])
    p = np.array([[0.0, 0.0], [3.0, 0.0], [-3.0, 0.0]])
    own = np.hstack([q, p])
    control = fk.SafetyFilter(0.1, distance=1.0, acceleration=0.5, gain=50.0)
    keeper = ForceFilter(control, np.ones(3), q, fk.Open(), 7.0)
    assert filter_counts(keeper, 7.0) == {"forces changed by the safety filter": 0, "its conditions relaxed": 0}
    for instant in (300_000_000, 400_000_000):
        known = Known(np.array([0]), own[:1], own[None], np.ones((1, 3), dtype=bool), None, instant)
        keeper.filtered(instant, known, np.array([[0.1, 0.0]]))
    assert keeper.memory.relaxed == 2
    assert filter_counts(keeper, 7.0)["first relaxed at"] == pytest.approx(7.3, rel=1e-15)


@pytest.mark.parametrize("form", ["sampled", "continuous"])
def test_each_takes_the_share_of_its_own_largest_acceleration(form):
    """Of what two that close in ask of each other the one takes a quarter and the other three quarters."""
    q, p = np.array([[0.0, 0.0], [2.0, 0.0]]), np.array([[1.0, 0.0], [-1.0, 0.0]])
    control = fk.SafetyFilter(0.1, distance=0.7, acceleration=[1.0, 3.0], form=form)
    keeper, other = ForceFilter(control, np.ones(2), q, fk.Open()), np.array([False, True])
    found = [
        float(keeper._conditions(i, other if i == 0 else ~other, q[[i]] - q[[1 - i]], p[[i]] - p[[1 - i]])[1][0])
        for i in (0, 1)
    ]
    assert found[1] == pytest.approx(3.0 * found[0], rel=1e-12)
    assert found[0] != 0.0
