"""No agent ever enters an obstacle: a claim about any run whose law or filter declares obstacles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.model.leaders_and_obstacles.leaders import Leader, Path
from flocking.study.evidence import Evidence
from flocking.study.evidence.obstacle_approach import nearest_obstacle

KEY = "outside-obstacles"


def blind(*obstacles: fk.Obstacle) -> fk.Avoid:
    """Obstacles without a force."""
    return fk.Avoid(obstacles, range=1e-3, repulsion_gain=0.0, damping_gain=0.0, gamma_agents=False)


def coasting(obstacle: fk.Obstacle, start: list[float], velocity: list[float], frames: int = 21) -> fk.Scenario:
    """One agent that nothing disturbs."""
    law = fk.Law(fk.Proximity(1.0), [blind(obstacle)])
    return fk.Scenario(law, fk.State([start], [velocity]), t_end=10.0, frames=frames)


def verdict(run: fk.Run) -> tuple[str, str]:
    """Verdict and note."""
    found = next(r for r in fk.audit(run).results if r.claim.key == KEY)
    return str(found.verdict), found.note


@pytest.mark.parametrize(("aside", "expected"), [(1.2, "holds"), (0.8, "fails"), (-0.99, "fails"), (-1.01, "holds")])
def test_an_agent_that_flies_past_or_through_a_ball_between_two_frames(aside: float, expected: str) -> None:
    run = fk.simulate(coasting(fk.Ball([0.0, 0.0], 1.0), [-11.3, aside], [2.0, 0.0], 6), progress=False)
    found = Evidence(run).nearest_obstacle
    assert found.distance == pytest.approx(abs(aside) - 1.0, abs=1e-9)
    assert found.at_samples > found.distance + 0.005
    assert verdict(run)[0] == expected


def test_who_begins_inside_fails_at_once_with_the_depth_the_time_and_the_agent() -> None:
    law = fk.Law(fk.Proximity(1.0), [blind(fk.Ball([0.0, 0.0], 1.0))])
    start = fk.State([[5.0, 0.0], [0.4, 0.0], [-5.0, 0.0]], np.zeros((3, 2)))
    run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=2), progress=False)
    assert verdict(run) == ("fails", "0.6 inside an obstacle at t = 0 (agent 1)")


def test_no_obstacle_is_not_applicable_and_one_frame_shows_nothing_between() -> None:
    free = fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]), fk.State([[3.0, 0.0]], [[0.0, 0.0]]), 1.0)
    assert verdict(fk.simulate(free, progress=False)) == ("not applicable", "no obstacle is declared")
    far = coasting(fk.Ball([0.0, 0.0], 1.0), [3.0, 0.0], [0.0, 0.0], 1)
    assert verdict(fk.simulate(far, progress=False))[0] == "not resolved"
    late = coasting(fk.Ball([0.0, 0.0], 1.0), [3.0, 0.0], [0.0, 0.0])
    parts = fk.simulate(late.with_(frames=(4.0, 5.0, 6.0, 7.0)), progress=False)
    assert verdict(parts)[0] == "not resolved"
    assert verdict(replace(parts, status="running"))[0] == "not resolved"


def circling(radius: float, rate: float) -> Leader:
    """A place that goes round the origin."""
    return Path([f"{radius}*cos({rate}*t)", f"{radius}*sin({rate}*t)"])


@pytest.mark.parametrize("make", [lambda c: fk.Ball(c, 0.5), lambda c: fk.Wall(c, [0.6, 0.8])], ids=["ball", "wall"])
@pytest.mark.parametrize("leader", [circling(3.0, 0.7), fk.Velocity([0.3, -0.2], [-1.0, 1.0])], ids=["circle", "line"])
def test_obstacles_that_move_are_passed_as_a_dense_sample_says(make, leader: Leader) -> None:
    obstacle = make(leader)
    run = fk.simulate(coasting(obstacle, [-4.0, 5.0], [0.9, -0.35], 41), progress=False)
    found = nearest_obstacle(run, [obstacle])
    times = np.linspace(0.0, 10.0, 20001)
    places = np.array([-4.0, 5.0]) + times[:, None] * np.array([0.9, -0.35])
    dense = min(float(obstacle.distance(q[None], t)[0]) for t, q in zip(times[::5], places[::5], strict=True))
    assert found.distance - found.error <= dense + 1e-9
    assert abs(found.distance - dense) < found.error + 1e-5
    assert found.error < 2e-3


def test_an_obstacle_that_dashes_through_an_agent_between_two_frames_is_not_overlooked() -> None:
    """Its path is far from the cubic through its places at the frames, which is in the error."""
    dash = Path(["a*sin(w*t)", "0"], [0.0, 0.0], a=12.0 * np.pi, w=4.0 * np.pi)
    scenario = coasting(fk.Ball(dash, 0.5), [5.0, 0.0], [0.0, 0.0], 21)
    found = Evidence(run := fk.simulate(scenario, progress=False)).nearest_obstacle
    assert found.at_samples == pytest.approx(4.5)
    assert found.distance - found.error < -1.0
    said, note = verdict(run)
    assert said == "not resolved"
    assert note.startswith("closest 4.5 to an obstacle at frames; between them ")
    assert " is possible, at t = " in note


@pytest.mark.parametrize("turns", [1, 18])
def test_an_obstacle_that_goes_to_and_fro_in_step_with_the_frames_is_not_overlooked(turns: int) -> None:
    """At frames, and at places between that divide them evenly, it is where it began, at rest."""
    sway = Path(["a*w*sin(w*t)", "0"], [0.0, 0.0], a=4.5, w=2.0 * np.pi * turns / 0.5)
    run = fk.simulate(coasting(fk.Ball(sway, 0.5), [9.0, 0.0], [0.0, 0.0], 3).with_(t_end=1.0), progress=False)
    found = Evidence(run).nearest_obstacle
    assert found.at_samples == pytest.approx(8.5)
    assert found.distance - found.error <= -0.5
    assert verdict(run)[0] == "not resolved"


@pytest.mark.parametrize("order", [1, 2])
def test_an_agent_that_is_back_at_every_frame_is_not_taken_to_have_stayed(order: int) -> None:
    """Cubic curves through frames that are a period apart are points; the ledger has the energy in between."""
    track = fk.Track(fk.Sink([0.0, 0.0]), (2.0 * np.pi) ** 2, 0.0)
    if order == 1:
        track = fk.Track(Path(["-w*sin(w*t)", "0"], [1.0, 0.0], w=2.0 * np.pi), 1.0, 1.0)
    law = fk.Law(fk.Proximity(0.5), [blind(fk.Ball([-1.0, 0.0], 0.5)), track])
    agents = fk.SingleIntegrator() if order == 1 else fk.PointMass()
    scenario = fk.Scenario(law, fk.State([[1.0, 0.0]], [[0.0, 0.0]]), t_end=4.0, frames=5, agents=agents)
    run = fk.simulate(scenario, progress=False)
    assert np.ptp(run.q, axis=0).max() < 1e-6
    assert verdict(run)[0] == "not resolved"
    assert verdict(fk.simulate(scenario.with_(frames=401), progress=False))[0] == "fails"
    assert verdict(fk.simulate(scenario, fine=True, progress=False))[0] == "fails"


@pytest.mark.parametrize("engine", ["exact", "tiles"])
def test_an_agent_that_touches_a_boundary_within_rounding_is_on_no_side_of_it(engine: str) -> None:
    touching = coasting(fk.Ball([0.0, 0.0], 1.0), [-3.0, 1.0], [2.0, 0.0], 61).with_(t_end=3.0)
    options = {"step": 0.05} if engine == "tiles" else {}
    run = fk.simulate(touching, engine=engine, progress=False, **options)
    found, note = verdict(run)
    assert found == "not resolved"
    assert "inside" not in note


def test_an_agent_of_order_1_with_held_velocities_that_is_back_at_every_frame_is_not_taken_to_have_stayed() -> None:
    track = fk.Track(Path(["-w*sin(w*t)", "0"], [1.0, 0.0], w=2.0 * np.pi), 1.0, 1.0)
    law = fk.Law(fk.Proximity(0.5), [blind(fk.Ball([-1.0, 0.0], 0.5)), track])
    scenario = fk.Scenario(
        law, fk.State([[1.0, 0.0]], [[0.0, 0.0]]), t_end=4.0, frames=5, agents=fk.SingleIntegrator(),
        control=fk.Held(0.05),
    )  # fmt: skip
    assert verdict(fk.simulate(scenario, progress=False))[0] == "not resolved"
    assert verdict(fk.simulate(scenario.with_(frames=81), progress=False))[0] == "fails"


def jumping(gain: float, agents: object, **world: object) -> fk.Scenario:
    """One agent about a place where an obstacle is, and another one that goes slowly far away."""
    pull = fk.Track(fk.Sink([0.0, 0.0]), np.array([gain, 0.1]), 0.0)
    law = fk.Law(fk.Proximity(2.0), [pull, blind(fk.Ball([0.0, 0.0], 0.3))])
    start = fk.State([[1.0, 0.0], [9.0, 9.0]], np.zeros((2, 2)))
    return fk.Scenario(law, start, t_end=4.0, frames=21, agents=agents, **world)


ONE_SAMPLE = {"information": fk.Messages(0.1, self_known="measured")}


@pytest.mark.parametrize("world", [{"control": fk.Held(0.1)}, ONE_SAMPLE], ids=["held", "own sample"])
def test_a_velocity_that_turns_round_once_between_two_frames_is_not_overlooked(world) -> None:
    """Of gain 2/period agents of order 1 are on the other side after a period, and back after two."""
    scenario = jumping(20.0, fk.SingleIntegrator(), **world)
    run = fk.simulate(scenario, progress=False)
    assert np.ptp(run.q[:, 0], axis=0).max() < 1e-9
    assert verdict(run)[0] == "not resolved"
    assert verdict(fk.simulate(scenario.with_(frames=41), progress=False))[0] != "holds"
    assert verdict(fk.simulate(scenario.with_(frames=401), progress=False))[0] == "fails"
    away = scenario.with_(start=fk.State([[1e-3, 5.0], [9.0, 9.0]]), law=jumping(0.1, fk.SingleIntegrator()).law)
    assert verdict(fk.simulate(away.with_(frames=41), progress=False))[0] == "holds"


def test_velocities_set_at_ticks_that_bring_agents_back_at_every_frame_are_not_taken_for_rest() -> None:
    sway = Path(["-w*sin(w*t)", "0"], [1.0, 0.0], w=2.0 * np.pi)
    terms = [fk.Track(sway, np.array([100.0, 0.1]), np.array([20.0, 0.1]), np.array([1.0, 0.0]))]
    start = fk.State([[1.0, 0.0], [9.0, 9.0]], [[0.0, 0.0], [1.0, 0.0]])
    law = fk.Law(fk.Proximity(2.0), [*terms, blind(fk.Ball([0.0, 0.0], 0.3))])
    scenario = fk.Scenario(
        law, start, t_end=8.0, frames=9, agents=fk.Impulsive(), control=fk.Held(0.02),
    )  # fmt: skip
    assert verdict(fk.simulate(scenario, progress=False))[0] == "not resolved"
    assert verdict(fk.simulate(scenario.with_(frames=401), progress=False))[0] == "fails"
    beside = fk.Law(fk.Proximity(2.0), [*terms, blind(fk.Ball([0.0, 3.0], 0.3))])
    for frames, expected in ((401, "holds"), (201, "holds"), (101, "not resolved")):
        run = fk.simulate(scenario.with_(law=beside, frames=frames), progress=False)
        assert verdict(run)[0] == expected


def test_an_agent_that_is_back_at_every_frame_after_the_end_of_the_ledger_is_not_taken_to_have_stayed() -> None:
    scenario = jumping((2.0 * np.pi) ** 2, fk.PointMass(), control=fk.Held(0.01)).with_(frames=5)
    run = fk.simulate(scenario, progress=False)
    ended = {**run.provenance, "ledger ends": 0.0}
    assert verdict(replace(run, trace=run.trace[:1], provenance=ended))[0] == "not resolved"


class Swelling(fk.Ball):
    """A ball whose radius grows: it does not rest in the frame of its leader."""

    def signed_distance(self, q, t, parameter):
        """|q - b| - l (1 + t)."""
        found = super().signed_distance(q, t, parameter)
        return [replace(piece, distance=piece.distance - t * parameter("radius")) for piece in found]


def test_an_obstacle_that_changes_its_shape_is_judged_at_the_frames_alone() -> None:
    run = fk.simulate(coasting(Swelling([0.0, 0.0], 0.1), [3.0, 0.0], [0.0, 0.0]), progress=False)
    found = Evidence(run).nearest_obstacle
    assert found.error == np.inf
    assert found.distance == pytest.approx(1.9)
    assert verdict(run)[0] == "not resolved"
    run = fk.simulate(coasting(Swelling([0.0, 0.0], 0.3), [3.0, 0.0], [0.0, 0.0]), progress=False)
    assert verdict(run)[0] == "fails"


@pytest.mark.parametrize("engine", ["exact", "tiles", "sampled", "delayed"])
def test_every_engine_judges_it(engine: str) -> None:
    scenario = coasting(fk.Ball([0.0, 0.0], 1.0), [-11.3, 0.5], [2.0, 0.0], 201)
    if engine == "sampled":
        scenario = scenario.with_(control=fk.Held(0.1))
    if engine == "delayed":
        scenario = scenario.with_(information=fk.Delayed(0.1))
    options = {"step": 0.01} if engine == "tiles" else {}
    run = fk.simulate(scenario, engine=engine, progress=False, **options)
    assert verdict(run)[0] == "fails"
    clear = scenario.with_(start=fk.State([[-11.3, 1.5]], [[2.0, 0.0]]))
    run = fk.simulate(clear, engine=engine, progress=False, **options)
    assert verdict(run)[0] == "holds"


def test_bodies_of_order_one_and_steering_obstacles_count_too() -> None:
    disc = fk.ShillDisc([0.0, 0.0], 1.5, 1.0, 1.0, 1.0)
    assert [type(x) for x in disc.solids(2)] == [fk.Ball]
    walls = fk.ShillWalls(4.0, 1.0, 1.0, 1.0).solids(2)
    q = np.array([[3.0, 0.0], [-4.5, 0.0], [0.0, 4.25], [0.0, -3.5]])
    assert np.min([x.distance(q) for x in walls], axis=0) == pytest.approx([1.0, -0.5, -0.25, 0.5])
