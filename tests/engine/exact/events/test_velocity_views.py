"""Fields of view along velocities: closed forms, another integrator, agents at rest, and what they keep."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import flocking as fk
from flocking.arrays import Array, Links
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.exact.crossings.turning_view_guards import TurningView
from flocking.errors import InvalidInput
from tests.engine.exact.events.loose_tolerances import difference_within_errors

RADIUS, GAIN = 1.2, 0.2


def exact(scenario: fk.Scenario) -> fk.Run:
    return fk.simulate(scenario, engine="exact", progress=False)


@pytest.mark.parametrize("half_angle", [1.1, np.pi / 2, 2.0])
def test_two_agents_on_a_spring_see_each_other_at_the_closed_times(half_angle: float) -> None:
    # Their offset d goes round an ellipse, (a cos wt, b sin wt) with w = sqrt 2; agent 0 moves with -d'/2.
    a, b, w = 1.0, 0.4, np.sqrt(2.0)
    spring = fk.Gradient(fk.Potential("r**2/2"), over=fk.Fixed.complete(2))
    law = fk.Law(fk.FieldOfView(3.0, half_angle, "p"), [spring, fk.Consensus(0.0)])
    start = fk.State([[-a / 2, 0.0], [a / 2, 0.0]], [[0.0, -b * w / 2], [0.0, b * w / 2]])
    run = exact(fk.Scenario(law, start, 4.0, tolerance=1e-10))

    def inside(t: float) -> float:
        x, y = np.cos(w * t), np.sin(w * t)
        toward = (a**2 - b**2) * x * y
        return float(toward - np.cos(half_angle) * np.hypot(a * x, b * y) * np.hypot(a * y, b * x))

    fine = np.linspace(0.0, 4.0, 4001)[1:]
    values = np.array([inside(t) for t in fine])
    places = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    expected = np.array([brentq(inside, fine[k], fine[k + 1], xtol=1e-14) for k in places])
    for i, j in ((0, 1), (1, 0)):
        found = run.switches[(run.switches["i"] == i) & (run.switches["j"] == j) & (run.switches["graph"] == 0)]
        found = found[found["time"] > 1e-6]
        assert len(found) == len(expected) >= 3
        assert (np.abs(found["time"] - expected) <= found["time_error"]).all()
        assert (found["time_error"] < 1e-7).all()


def group(seed: int, half_angle: float, drift: tuple[float, float] = (0.0, 0.0), n: int = 8) -> fk.Scenario:
    rng = np.random.default_rng(seed)
    q, p = rng.uniform(-1.5, 1.5, (n, 2)), rng.uniform(-0.7, 0.7, (n, 2)) + drift
    law = fk.Law(fk.FieldOfView(RADIUS, half_angle, "p"), [fk.Consensus(GAIN)])
    return fk.Scenario(law, fk.State(q, p), 3.0, frames=7)


def seen(half_angle: float, q: Array, p: Array) -> Array:
    """How far inside the view of agent i agent j is, shape (N, N)."""
    away = q[None] - q[:, None]
    distance = np.linalg.norm(away, axis=2)
    ahead = np.einsum("ijk,ik->ij", away, p / np.linalg.norm(p, axis=1, keepdims=True)) - np.cos(half_angle) * distance
    found = np.minimum(RADIUS - distance, ahead)
    np.fill_diagonal(found, -1.0)
    return np.asarray(found)


def integrated(scenario: fk.Scenario, half_angle: float) -> tuple[Array, Links, Array]:
    """Final state, links and times of switches by SciPy, whose events are changes of all signs at once."""
    n, y, t = scenario.start.n, np.stack([scenario.start.q, scenario.start.p]).ravel(), 0.0
    links, times = seen(half_angle, scenario.start.q, scenario.start.p) >= 0, []
    pairs = [(i, j) for i in range(n) for j in range(n) if i != j]
    while True:
        now = links.copy()

        def slope(t: float, y: Array, now: Links = now) -> Array:
            p = y.reshape(2, n, 2)[1]
            return np.stack([p, GAIN * (now[:, :, None] * (p[None] - p[:, None])).sum(axis=1)]).ravel()

        events = []
        for i, j in pairs:

            def margin(t: float, y: Array, i: int = i, j: int = j) -> float:
                return float(seen(half_angle, *y.reshape(2, n, 2))[i, j])

            margin.terminal, margin.direction = True, -1.0 if now[i, j] else 1.0  # type: ignore[attr-defined]
            events.append(margin)
        span = (t, scenario.t_end)
        solved = solve_ivp(slope, span, y, method="DOP853", rtol=1e-12, atol=1e-13, events=events, max_step=0.03)
        t, y = float(solved.t[-1]), solved.y[:, -1]
        if solved.status == 0:
            return y.reshape(2, n, 2), links, np.array(times)
        # Of several events at one time SciPy gives the first alone; the others may be past already, by rounding.
        past = (seen(half_angle, *y.reshape(2, n, 2)) >= 0) != links
        for pair, found in zip(pairs, solved.t_events, strict=True):
            if len(found) or past[pair]:
                links[pair] = ~links[pair]
                times.append(t)


@pytest.mark.parametrize(
    ("seed", "half_angle", "drift"), [(1, 1.0, (0.0, 0.0)), (3, 2.3, (0.0, 0.0)), (0, 1.0, (5.0, -3.0))]
)
def test_groups_move_as_another_integrator_says(seed: int, half_angle: float, drift: tuple[float, float]) -> None:
    scenario = group(seed, half_angle, drift)
    run, (y, links, times) = exact(scenario), integrated(scenario, half_angle)
    assert len(run.switches) == len(times) >= 3
    assert (np.abs(run.switches["time"] - times) <= run.switches["time_error"] + 1e-11).all()
    assert (run.links[-1] == links).all()
    assert run.accuracy is not None
    assert len(run.accuracy.doubts) == 0
    for error, got, expected in zip(run.accuracy.frames[-1], (run.q, run.p), y, strict=True):
        assert np.abs(got[-1] - expected).max() <= error + 1e-11


@pytest.mark.parametrize("unit", [True, False])
@pytest.mark.parametrize("cosine", [0.5, -0.4])
def test_rates_at_a_border_are_differences_of_how_far_inside_an_agent_is(unit: bool, cosine: float) -> None:
    rng = np.random.default_rng(5)
    C, errors = rng.normal(size=(8, 8)), rng.normal(size=8)
    segment, view = Segment(1.0, 1.5, C), TurningView(4, 2, 2, np.full(2, cosine), unit=unit)
    largest = 1.0 if unit else float(np.linalg.norm(C[:, 4:6], axis=1).max())

    def inside(y: Array) -> float:
        d, heading = y[2:4] - y[:2], y[4:6] / largest
        length = 1.0 if unit else float(np.linalg.norm(heading))
        return float(d @ heading - cosine * np.linalg.norm(d) * length)

    apart = C[:, 2:4] - C[:, :2]
    found = view.bearing(segment, (0, 1), apart, errors[2:4] - errors[:2], errors)
    h, y = 1e-5, C[-1]
    now, before, earlier = (inside(segment.at(1.5 - k * h)) for k in range(3))
    assert found.inside == pytest.approx(now, rel=1e-12)
    assert found.rate == pytest.approx((3 * now - 4 * before + earlier) / (2 * h), rel=1e-5)
    assert found.off == pytest.approx((inside(y + h * errors) - inside(y - h * errors)) / (2 * h), rel=1e-6)


def test_errors_hold_at_loose_tolerances() -> None:
    cases = ((1, 1.0), (1, 2.3), (3, 1.0), (3, np.pi / 2), (4, 1.0), (4, 2.3))
    assert max(difference_within_errors(group(*case)) for case in cases) > 1e-8


def test_an_agent_at_rest_looks_all_around() -> None:
    law = fk.Law(fk.FieldOfView(1.0, 0.5, "p"), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [-1.5, 0.2]], [[0.0, 0.0], [1.0, 0.0]])
    run = exact(fk.Scenario(law, start, 3.0, frames=4))
    reach = np.sqrt(1.0 - 0.2**2)
    found = run.switches[run.switches["i"] == 0]
    assert found["time"] == pytest.approx([1.5 - reach, 1.5 + reach], abs=1e-9)
    # Agent 1 passes agent 0, which is ahead of it within half an angle until it is near.
    ahead = run.switches[run.switches["i"] == 1]
    assert ahead["time"] == pytest.approx([1.5 - reach, 1.5 - 0.2 / np.tan(0.5)], abs=1e-9)
    q = np.array([[0.0, 0.0], [-0.5, 0.0], [0.5, 0.0]])
    assert law.graph.start_links(q, np.zeros((3, 2)))[0].tolist() == [False, True, True]


def test_an_agent_that_turns_back_looks_the_other_way_from_then_on() -> None:
    # On a spring along a line it stands still at pi/(2 w), with a companion that is ahead until then.
    w = np.sqrt(2.0)
    spring = fk.Gradient(fk.Potential("r**2/2"), over=fk.Fixed(3, [(0, 1)]))
    law = fk.Law(fk.FieldOfView(9.0, 1.0, "p"), [spring, fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [0.0, 0.0], [2.0, 0.1]], [[0.5, 0.0], [-0.5, 0.0], [0.0, 0.3]])
    run = exact(fk.Scenario(law, start, 1.5, frames=4))
    found = run.switches[(run.switches["i"] == 0) & (run.switches["j"] == 2)]
    assert found["kind"].tolist() == ["break"]
    assert abs(found["time"][0] - np.pi / (2 * w)) <= found["time_error"][0] < 1e-5
    assert run.links[-1][0].tolist() == [False, True, False]


def test_turned_groups_move_alike_and_drifting_ones_do_not() -> None:
    graph = fk.FieldOfView(RADIUS, 1.0, "p")
    assert "rotation" in graph.symmetries
    assert "galilean" not in graph.symmetries
    scenario = group(1, 1.0)
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    start = fk.State(scenario.start.q @ turn.T, scenario.start.p @ turn.T)
    plain, turned = exact(scenario), exact(scenario.with_(start=start))
    assert np.abs(plain.q @ turn.T - turned.q).max() < 1e-7
    drifting = fk.State(scenario.start.q, scenario.start.p + [5.0, -3.0])
    assert (exact(scenario.with_(start=drifting)).links[-1] != plain.links[-1]).any()


def test_bodies_without_a_velocity_are_refused() -> None:
    law = fk.Law(fk.FieldOfView(1.0, 1.0, "p"), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [0.5, 0.0]])
    with pytest.raises(InvalidInput, match="must not be the velocity of SingleIntegrator"):
        fk.Scenario(law, start, 1.0, agents=fk.SingleIntegrator())
