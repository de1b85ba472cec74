"""Fields of view that turn with the bodies: closed forms, another integrator, stored sessions, and who refuses them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.arrays import Array, Links
from flocking.engine.c_export.exported_law import exported_law
from flocking.engine.driver.nodes import simulate_nodes
from flocking.errors import Chattering, FlockingError, InvalidInput
from flocking.model.bodies.body import MotionSymbols
from flocking.study.scenario_files.scenario_file import parse_scenario, scenario_to_text
from tests.engine.exact.events.loose_tolerances import difference_within_errors

OFFSET = 0.15


@dataclass(frozen=True, eq=False)
class Turret(fk.Body):
    """A point mass that looks around in space: its direction turns about the third axis, once in two pi."""

    @property
    def order(self) -> int:
        return 2

    @property
    def columns(self) -> tuple[fk.Column, ...]:
        return (fk.Column("sight", 3),)

    @property
    def directions(self) -> tuple[str, ...]:
        return ("sight",)

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        a, b, _ = x.columns["sight"]
        return {"p": [u / x.mass for u in x.u], "sight": [-b, a, sympy.Integer(0)]}


def robots(seed: int, n: int = 6) -> fk.Scenario:
    """Robots on wheels that see ahead and take the mean velocity of whom they see."""
    rng = np.random.default_rng(seed)
    q, p, angle = rng.uniform(-1, 1, (n, 2)), rng.uniform(-0.5, 0.5, (n, 2)), rng.uniform(-np.pi, np.pi, n)
    start = fk.State(q, p, columns={"heading": np.stack([np.cos(angle), np.sin(angle)], axis=1)})
    law = fk.Law(fk.FieldOfView(1.2, 1.0, "heading"), [fk.Consensus(1.0)])
    return fk.Scenario(law, start, 3.0, agents=fk.Unicycle(OFFSET), frames=7)


def exact(scenario: fk.Scenario) -> fk.Run:
    return fk.simulate(scenario, engine="exact", progress=False)


def test_a_robot_that_turns_along_a_tractrix_sees_another_from_and_until_the_closed_times() -> None:
    # Hand points move with speed v along the first axis: the angle of the heading has tan(angle/2) falling as
    # exp(-v t/d), and the bearing of the other robot stays.
    speed, bearing, half, angle = 0.4, 0.9, 0.6, 1.8
    q = [[0.0, 0.0], [np.cos(bearing), np.sin(bearing)]]
    heading = [[np.cos(angle), np.sin(angle)], [1.0, 0.0]]
    law = fk.Law(fk.FieldOfView(2.0, half, "heading"), [fk.Consensus(0.0)])
    start = fk.State(q, [[speed, 0.0], [speed, 0.0]], columns={"heading": heading})
    run = exact(fk.Scenario(law, start, 4.0, agents=fk.Unicycle(OFFSET)))
    expected = [OFFSET / speed * np.log(np.tan(angle / 2) / np.tan(x / 2)) for x in (bearing + half, bearing - half)]
    assert [(s["kind"], s["i"], s["j"]) for s in run.switches] == [("appear", 0, 1), ("break", 0, 1)]
    assert (np.abs(run.switches["time"] - expected) <= run.switches["time_error"]).all()
    assert (run.switches["time_error"] < 1e-7).all()
    assert run.certain.all()
    # The distance stays: what crosses the border is the bearing, g = cos(bearing - angle) - cos(half) at distance 1.
    there = np.array([bearing + half, bearing - half])
    leaving = np.sin(bearing - there) * speed / OFFSET * np.sin(there)
    assert (np.abs(run.switches["speed"] - leaving) <= run.switches["speed_error"]).all()
    assert (run.switches["speed_error"] < 1e-6).all()
    assert not run.switches["tangential"].any()
    assert fk.audit(run)["crossings-transversal"].verdict == "holds"


@pytest.mark.parametrize("half_angle", [1.0, 2.2, np.pi / 2])
def test_a_body_of_a_user_sees_in_space_at_the_closed_times(half_angle: float) -> None:
    raised = 0.3
    q = [[0.0, 0.0, 0.0], [np.cos(raised), 0.0, np.sin(raised)]]
    law = fk.Law(fk.FieldOfView(2.0, half_angle, "sight"), [fk.Consensus(0.0)])
    start = fk.State(q, np.zeros((2, 3)), columns={"sight": [[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]})
    run = exact(fk.Scenario(law, start, 7.4, agents=Turret()))
    lost = float(np.arccos(np.cos(half_angle) / np.cos(raised)))
    found = run.switches[run.switches["i"] == 0]
    assert found["kind"].tolist() == ["break", "appear"] + ["break"] * (2 * np.pi + lost < 7.4)
    expected = np.array([lost, 2 * np.pi - lost, 2 * np.pi + lost])[: len(found)]
    assert (np.abs(found["time"] - expected) <= found["time_error"]).all()
    assert (found["time_error"] < 1e-7).all()
    assert run.accuracy is not None
    assert len(run.accuracy.doubts) == 0


def seen(scenario: fk.Scenario, q: Array, heading: Array) -> Array:
    """How far inside the field of view of agent i agent j is, negative outside; shape (N, N)."""
    graph = scenario.law.graph
    assert isinstance(graph, fk.FieldOfView)
    away = q[None] - q[:, None]
    distance = np.linalg.norm(away, axis=2)
    ahead = np.einsum("ijk,ik->ij", away, heading) - np.cos(graph.half_angle) * distance
    inside = np.minimum(graph.radius - distance, ahead)
    np.fill_diagonal(inside, -1.0)
    return np.asarray(inside)


def changes(scenario: fk.Scenario, links: Links) -> list[Callable[[float, Array], float]]:
    """An event of SciPy for each ordered pair: the next change of its link."""
    n = scenario.start.n

    def change(i: int, j: int) -> Callable[[float, Array], float]:
        def margin(t: float, y: Array) -> float:
            q, _, heading = y.reshape(3, n, 2)
            return float(seen(scenario, q, heading)[i, j])

        margin.terminal, margin.direction = True, -1.0 if links[i, j] else 1.0  # type: ignore[attr-defined]
        return margin

    return [change(i, j) for i in range(n) for j in range(n) if i != j]


def integrated(scenario: fk.Scenario) -> tuple[Array, Links, list[tuple[float, int, int]]]:
    """Final state, shape (3, N, 2), links and switches by SciPy, every change of a link an event of its own."""
    start, n = scenario.start, scenario.start.n
    y = np.stack([start.q, start.p, start.columns["heading"]]).ravel()
    links = seen(scenario, start.q, start.columns["heading"]) >= 0
    t, found = start.t, []
    pairs = [(i, j) for i in range(n) for j in range(n) if i != j]
    while True:
        now = links.copy()

        def slope(t: float, y: Array, now: Links = now) -> Array:
            _, p, e = y.reshape(3, n, 2)
            u = (now[:, :, None] * (p[None] - p[:, None])).sum(axis=1)
            turn = (e[:, 0] * p[:, 1] - e[:, 1] * p[:, 0]) / OFFSET
            return np.stack([p, u, turn[:, None] * np.stack([-e[:, 1], e[:, 0]], axis=1)]).ravel()

        # Short steps, so that no event is overlooked: SciPy looks for changes of sign between steps.
        solved = solve_ivp(
            slope,
            (t, scenario.t_end),
            y,
            method="DOP853",
            rtol=1e-12,
            atol=1e-13,
            events=changes(scenario, links),
            max_step=0.02,
        )
        t, y = float(solved.t[-1]), solved.y[:, -1]
        if solved.status == 0:
            return y.reshape(3, n, 2), links, found
        # Of several events at one time SciPy gives the first alone; the others may be past already, by rounding.
        q, _, heading = y.reshape(3, n, 2)
        past = (seen(scenario, q, heading) >= 0) != links
        for pair, times in zip(pairs, solved.t_events, strict=True):
            if len(times) or past[pair]:
                links[pair] = ~links[pair]
                found.append((t, *pair))


@pytest.mark.parametrize("seed", range(4))
def test_flocks_of_robots_move_as_another_integrator_says(seed: int) -> None:
    scenario = robots(seed)
    run, (y, links, switches) = exact(scenario), integrated(scenario)
    assert [(s["i"], s["j"]) for s in run.switches] == [(i, j) for _, i, j in switches]
    assert len(switches) >= 2
    assert (run.links[-1] == links).all()
    off = np.abs(run.switches["time"] - [t for t, _, _ in switches])
    assert (off <= run.switches["time_error"] + 1e-11).all()
    assert run.accuracy is not None
    for error, got, expected in zip(run.accuracy.frames[-1], (run.q, run.p), y[:2], strict=True):
        assert np.abs(got[-1] - expected).max() <= error + 1e-11
    assert np.abs(run.columns["heading"][-1] - y[2]).max() < 1e-7


@pytest.mark.parametrize("column", ["heading", ""])
def test_a_switch_by_bearing_leaves_no_doubt_once_it_is_beyond_the_error(column: str) -> None:
    # Every pair that had switched counted as near to switching back, which made the errors of the run useless.
    for seed in range(3):
        scenario = robots(seed)
        if not column:
            angle = np.arctan2(*scenario.start.columns["heading"].T[::-1])
            law = fk.Law(fk.FieldOfView(1.2, 1.0), [fk.Consensus(1.0)])
            start = fk.State(scenario.start.q, scenario.start.p)
            scenario = fk.Scenario(law, start, 3.0, agents=fk.PointMass(headings=angle), frames=7)
        run = exact(scenario)
        assert run.accuracy is not None
        assert len(run.switches) >= 2
        assert len(run.accuracy.doubts) == 0
        assert run.accuracy.frames.max() < 1e-6


def test_errors_hold_at_loose_tolerances() -> None:
    assert max(difference_within_errors(robots(seed)) for seed in range(6)) > 1e-8


def test_sessions_go_on_as_they_were_and_files_say_the_column() -> None:
    scenario = robots(2)
    whole = exact(scenario)
    session = fk.ExactSession(scenario)
    session.advance(1.0)
    again = fk.ExactSession.resume(session.snapshot())
    again.advance(3.0)
    for name in ("q", "p", "links", "switches"):
        assert (getattr(again.run(), name) == getattr(whole, name)).all()
    read = parse_scenario(scenario_to_text(scenario))
    assert isinstance(read.law.graph, fk.FieldOfView)
    assert read.law.graph.heading_column == "heading"
    assert (exact(read).q == whole.q).all()


def test_replacements_keep_what_agents_see() -> None:
    scenario = robots(1)
    whole = exact(scenario)
    session = fk.ExactSession(scenario)
    session.advance(1.0)
    session.replace(law=scenario.law)
    session.advance(3.0)
    assert np.abs(session.run().q[-1] - whole.q[-1]).max() < 1e-7
    # A state at the same place is looked at by the headings it has.
    other = fk.ExactSession(scenario)
    other.advance(1.0)
    now = other.state
    turned = {"heading": -np.asarray(now.columns["heading"])}
    other.replace(state=fk.State(now.q, now.p, now.t, columns=turned))
    assert (other.state.links == (seen(scenario, now.q, turned["heading"]) >= 0)).all()


def test_processes_of_agents_refuse_headings_that_turn_by_name_and_exports_take_them() -> None:
    scenario = robots(0).with_(control=fk.Held(0.1), information=fk.Messages(0.1))
    assert exported_law(scenario).heading
    with pytest.raises(FlockingError, match="that look along their headings"):
        simulate_nodes(scenario, processes=False)


def test_views_along_what_bodies_do_not_have_are_refused() -> None:
    law = fk.Law(fk.FieldOfView(1.0, 1.0, "heading"), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [0.5, 0.0]], np.zeros((2, 2)))
    with pytest.raises(InvalidInput, match=r"FieldOfView: heading_column must be 'p' or a direction of Agents"):
        fk.Scenario(law, start, 1.0)
    mixed = fk.Mixture((fk.PointMass(), fk.Unicycle(0.2)), [0, 1])
    with pytest.raises(InvalidInput, match=r"unit vector in 2 dimensions for each agent.*of agent 0"):
        fk.Scenario(law, start, 1.0, agents=mixed)
    with pytest.raises(InvalidInput, match=r"heading_column must be a column of the state"):
        fk.control(law, start, agents=fk.Unicycle(0.2))
    with pytest.raises(InvalidInput, match=r"heading_column must be the name of a column"):
        fk.FieldOfView(1.0, 1.0, 3)  # type: ignore[arg-type]


def test_symmetries_of_turning_views() -> None:
    plain, turning = fk.FieldOfView(1.0, 1.0), fk.FieldOfView(1.0, 1.0, "heading")
    assert plain.symmetries - turning.symmetries == {"galilean"}
    assert fk.FieldOfView(1.0, np.pi, "heading").symmetries == fk.FieldOfView(1.0, np.pi).symmetries


@dataclass(frozen=True, eq=False)
class Scanner(Turret):
    """A point mass in the plane whose sight swings to both sides, by half a radian."""

    @property
    def columns(self) -> tuple[fk.Column, ...]:
        return (fk.Column("sight", 2),)

    def rates(self, x: MotionSymbols) -> dict[str, Sequence[sympy.Expr]]:
        a, b = x.columns["sight"]
        turn = sympy.cos(x.t) / 2
        return {"p": [u / x.mass for u in x.u], "sight": [-turn * b, turn * a]}


def test_a_view_that_all_but_reaches_an_agent_is_in_doubt_for_no_longer_than_the_sight_is_near_it() -> None:
    # The sight is within the error b of the border for about 2 sqrt(2 b/a), where a = |d| sin(half)/2 turns it back.
    bearing, half = 0.5 + 0.8 + 1e-9, 0.8
    law = fk.Law(fk.FieldOfView(3.0, half, "sight"), [fk.Gradient(fk.Potential("r"))])
    start = fk.State([[0.0, 0.0], [np.cos(bearing), np.sin(bearing)]], columns={"sight": [[1.0, 0.0], [1.0, 0.0]]})
    run = exact(fk.Scenario(law, start, 3.0, agents=Scanner(), frames=4, tolerance=1e-7))
    assert run.accuracy is not None
    assert len(run.switches) == 0
    assert [(d["i"], d["j"], d["kind"]) for d in run.accuracy.doubts] == [(0, 1, "near miss")]
    error, force = float(run.accuracy.doubts["error"][0]), 1.0
    longest = 3.0 * np.sqrt(2.0 * error / (np.sin(half) / 2.0))
    assert run.accuracy.frames[-1, 1] <= 4.0 * 1.1 * force * longest + 1e-6
    assert run.accuracy.frames[-1, 1] >= force * np.sqrt(error)


@pytest.mark.parametrize("column", ["heading", "p"])
def test_stated_errors_of_speeds_at_the_sides_of_views_cover_those_of_a_tight_run(column: str) -> None:
    checked = 0
    for seed in range(8):
        rng = np.random.default_rng(seed)
        angles, n = rng.uniform(-np.pi, np.pi, 6), 6
        start = fk.State(rng.uniform(0, 2.5, (n, 2)), rng.normal(size=(n, 2)),
                         columns={"heading": np.stack([np.cos(angles), np.sin(angles)], axis=1)})  # fmt: skip
        # Strong forces turn velocities out of view again.
        strength = 1.0 if column == "heading" else 0.05
        terms = [fk.Consensus(0.6 * strength), fk.Gradient(fk.Potential("k*exp(-r**2)", k=strength))]
        law = fk.Law(fk.FieldOfView(1.8, 1.1, column), terms)
        made = fk.Scenario(law, start, t_end=1.5, frames=4, bodies=fk.Unicycle(0.15), tolerance=1e-6)
        try:
            run, tight = (fk.simulate(x, progress=False).switches for x in (made, made.with_(tolerance=3e-14)))
        except Chattering:
            continue
        order = ["i", "j", "kind", "time"]
        run, tight = np.sort(run, order=order), np.sort(tight, order=order)
        if run[order[:3]].tolist() != tight[order[:3]].tolist():
            continue
        late = np.abs(run["speed"] - tight["speed"])
        assert (late <= run["speed_error"] + tight["speed_error"]).all()
        checked += len(run)
    assert checked > 20
