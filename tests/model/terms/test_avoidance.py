"""The avoidance term (54): a plain loop, its power balance, and runs around obstacles."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.potentials.bumps import BUMPS

DRIFT = np.array([10.0, 0.0])
CENTRES = np.array([[0.0, 0.0], [9.0, 1.0], [4.0, -8.0]])
RADII = np.array([2.0, 3.0, 1.5])
C3, C4, R0, D_BETA, LAMBDA, D_GAMMA, K0 = 100.0, 2.0, 4.2, 3.9, 0.7, 7.0, 0.6


def balls() -> list[fk.Ball]:
    return [fk.Ball(b, float(radius)) for b, radius in zip(CENTRES, RADII, strict=True)]


def term(**changes: object) -> fk.Avoid:
    settings = {
        "range": R0, "repulsion_gain": C3, "damping_gain": C4, "offset": LAMBDA, "onset": K0,
        "repulsion": fk.Potential("sqrt(1 + (r - d)^2) - (r - d)", d=D_BETA),
    }  # fmt: skip
    return fk.Avoid(balls(), fk.Velocity(DRIFT), **(settings | changes))  # type: ignore[arg-type]


def plain(q: np.ndarray, p: np.ndarray, gamma: bool = True) -> np.ndarray:
    """(54) with (55)-(57), agent by agent, outside the obstacles."""
    a, b = 1.0, 5.0
    c = (b - a) / (2 * np.sqrt(a * b))
    u = np.zeros_like(q)
    for i in range(len(q)):
        for centre, radius in zip(CENTRES, RADII, strict=True):
            reach = np.linalg.norm(q[i] - centre)
            gap = reach - radius
            if gap > R0:
                continue
            s = radius / reach
            qhat = s * q[i] + (1 - s) * centre
            n = (qhat - q[i]) / gap
            phat = s * (p[i] - n * (n @ p[i]))
            z = gap - D_BETA
            rho = float(BUMPS["cosine"](gap / R0, K0))
            u[i] += C3 * rho * (z / np.sqrt(1 + z**2) - 1) * n + C4 * (phat - p[i])
            if gamma:
                away = centre + LAMBDA * DRIFT / np.linalg.norm(DRIFT) - q[i]
                far = np.linalg.norm(away)
                x = far - D_GAMMA + c
                u[i] += ((a + b) / 2 * x / np.sqrt(1 + x**2) + (a - b) / 2) * away / far
    return u


def cloud(count: int = 60) -> fk.State:
    rng = np.random.default_rng(2)
    q = rng.uniform(-8, 15, (4 * count, 2))
    outside = np.all([~b.contains(q) for b in balls()], axis=0)
    return fk.State(q[outside][:count], rng.normal(size=(count, 2)) * 3)


@pytest.mark.parametrize("gamma", [True, False])
def test_against_a_plain_loop(gamma: bool) -> None:
    state = cloud()
    law = fk.Law(fk.Proximity(0.1), [term(gamma_agents=gamma)])
    expected = plain(state.q, state.p, gamma)
    assert (np.abs(expected).max(axis=1) > 0).sum() > 20
    assert (np.abs(expected).max(axis=1) == 0).any()
    np.testing.assert_allclose(fk.control(law, state), expected, rtol=1e-10, atol=1e-10)
    for i in (0, 7, 30):
        alone = fk.control_of(law, fk.Agent(state.q[i], state.p[i], i), [])
        np.testing.assert_allclose(alone, expected[i], rtol=1e-10, atol=1e-10)


def test_gains_without_obstacles_in_reach() -> None:
    law = fk.Law(fk.Proximity(0.1), [term()])
    state = fk.State([[-50.0, 0.0], [50.0, 50.0]], [[1.0, 2.0], [3.0, 4.0]])
    np.testing.assert_array_equal(fk.control(law, state), 0.0)


@pytest.mark.parametrize("frame", ["lab", "centre of mass", "leader"])
def test_power_of_the_force_is_supplied_less_dissipated(frame: str) -> None:
    state, leader = cloud(), fk.Velocity([0.5, -1.0])
    energy = fk.Energy(frame, leader if frame == "leader" else None)
    law = fk.Law(fk.Proximity(0.1), [term()])
    found = fk.evaluate(law, state, energy=energy)
    frame_p = {"lab": np.zeros(2), "centre of mass": state.p.mean(axis=0), "leader": np.array([0.5, -1.0])}[frame]
    power = float((found.u * (state.p - frame_p)).sum())
    assert found.dissipation > 1.0
    assert found.supply - found.dissipation == pytest.approx(power, rel=1e-9)


def test_pushes_outwards_from_inside_and_at_the_centre() -> None:
    law = fk.Law(fk.Proximity(0.1), [term(gamma_agents=False)])
    angle = np.linspace(0, 6, 7)
    ring = 1.2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    u = fk.control(law, fk.State(ring))
    assert ((u * ring).sum(axis=1) > 0).all()
    at_centre = fk.control(law, fk.State(np.zeros((1, 2)), [[1.0, 1.0]]))
    assert np.isfinite(at_centre).all()
    edge = np.array([[2.0 - 1e-8, 0.0], [2.0 + 1e-8, 0.0]])
    two = fk.control(law, fk.State(edge, [[1.0, 2.0], [1.0, 2.0]]))
    np.testing.assert_allclose(two[0], two[1], atol=1e-5)


def test_run_has_the_control_of_the_reference_and_its_switches() -> None:
    """The compiled control along a run is the reference's, and obstacles switch exactly at the range."""
    rng = np.random.default_rng(0)
    start = fk.State(np.stack([rng.uniform(-14, -8, 6), rng.uniform(-5, 5, 6)], axis=1), np.tile(DRIFT, (6, 1)))
    law = fk.Law(
        fk.Smooth(2.4, 0.8),
        [
            fk.Gradient(fk.structural_potential(2.0)),
            fk.Consensus(),
            fk.Track(fk.Velocity(DRIFT), velocity_gain=3.0),
            term(),
        ],
    )
    h = 1e-5
    near = fk.simulate(
        fk.Scenario(law, start, 0.9 + h, frames=[0.9 - h, 0.9, 0.9 + h], tolerance=1e-12), progress=False
    )
    u = (near.p[2] - near.p[0]) / (2 * h)
    expected = fk.control(law, near.state(1))
    assert np.abs(expected).max() > 5
    np.testing.assert_allclose(u, expected, rtol=1e-5, atol=1e-4)
    run = fk.simulate(fk.Scenario(law, start, 3.0, frames=601), progress=False)
    events = run.switches[run.switches["kind"] == "obstacle"]
    assert len(events) >= 6
    assert not events["tangential"].any()
    distances = np.array([[ball.distance(q) for ball in balls()] for q in run.q])
    for event in events:
        k = int(np.searchsorted(run.t, event["time"]))
        before, after = distances[k - 1 : k + 1, event["j"], event["i"]]
        assert (before - R0) * (after - R0) < 0
        assert np.sign(event["speed"]) == np.sign(after - before)
    crossed = (np.diff(np.sign(distances - R0), axis=0) != 0).sum()
    assert crossed == len(events)
    assert np.abs(run.residual).max() < 1e-8 * run.turnover
    assert distances.min() > 0


def test_located_to_rounding_for_straight_flight() -> None:
    """Without any force before the range the time of the switch is known."""
    start = fk.State([[-20.0, 0.0], [-20.0, 5.0]], [[2.0, 0.0], [3.0, 0.0]])
    bodies = [fk.Ball([0.0, 0.0], 2.0), fk.Ball(fk.Velocity([0.0, 1.0], start=[0.0, 0.0]), 0.5)]
    law = fk.Law(fk.Proximity(0.1), [fk.Avoid(bodies, range=3.0, gamma_agents=False)])
    run = fk.simulate(fk.Scenario(law, start, 8.0), progress=False)
    first = run.switches[0]
    # Agent 1 meets the moving ball at the time with (20 - 3 t)^2 + (5 - t)^2 = 3.5^2.
    roots = np.roots([10.0, -130.0, 425.0 - 3.5**2])
    assert first["kind"] == "obstacle"
    assert (first["i"], first["j"]) == (1, 1)
    assert first["time"] == pytest.approx(roots.min(), rel=1e-12)
    other = run.switches[(run.switches["i"] == 0) & (run.switches["j"] == 0)][0]
    assert other["time"] == pytest.approx(7.5, rel=1e-12)
    assert other["speed"] == pytest.approx(-2.0, rel=1e-6)


@pytest.mark.slow
def test_obstacles_of_all_shapes_in_one_run() -> None:
    bodies = [
        fk.Ball([6.0, 0.0], 1.0),
        fk.Wall([0.0, -4.0], [0.0, 1.0]),
        fk.ConvexPolygon([[3.0, 3.0], [6.0, 3.0], [5.0, 5.0]], 0.3),
        fk.Ball(fk.Path(["0", "sin(t)"], start=[11.0, 0.0]), 1.0),
    ]
    rng = np.random.default_rng(1)
    start = fk.State(rng.uniform([-4, -3.5], [-1, 4], (8, 2)), np.tile([2.0, -0.2], (8, 1)))
    avoid = fk.Avoid(bodies, fk.Velocity([2.0, 0.0]), range=1.0, repulsion_gain=20.0)
    law = fk.Law(fk.Proximity(0.5), [fk.Track(fk.Velocity([2.0, 0.0])), avoid])
    run = fk.simulate(fk.Scenario(law, start, 8.0), progress=False)
    assert run.finished
    assert len({int(j) for j in run.switches["j"][run.switches["kind"] == "obstacle"]}) >= 3
    clearance = min(b.distance(q, float(t)).min() for q, t in zip(run.q, run.t, strict=True) for b in bodies)
    assert clearance > 0
    assert np.abs(run.residual).max() < 1e-7 * run.turnover


def test_snapshot_amid_obstacles_goes_on_bit_for_bit() -> None:
    start = fk.State([[-6.0, 0.5], [-7.0, -0.5]], np.tile(DRIFT, (2, 1)))
    law = fk.Law(fk.Proximity(0.1), [fk.Track(fk.Velocity(DRIFT)), term()])
    whole = fk.simulate(fk.Scenario(law, start, 2.0), progress=False)
    session = fk.start(fk.Scenario(law, start, 2.0))
    session.advance(0.5)
    again = fk.ExactSession.resume(session.snapshot())
    again.advance(2.0)
    np.testing.assert_array_equal(again.run().q, whole.q)


def test_errors() -> None:
    with pytest.raises(InvalidInput, match="leader"):
        fk.Avoid(balls(), range=1.0)
    with pytest.raises(InvalidInput, match="obstacles"):
        fk.Avoid([1.0], range=1.0, gamma_agents=False)  # type: ignore[list-item]
    with pytest.raises(InvalidInput, match="dimension"):
        fk.control(fk.Law(fk.Proximity(1.0), [term(gamma_agents=False)]), fk.State(np.zeros((2, 3))))


def test_the_tiled_engine_meets_the_same_obstacles() -> None:
    start = fk.State([[-6.0, 0.5], [-7.0, -0.5]])
    scenario = fk.Scenario(fk.Law(fk.Proximity(0.1), [term()]), start, 1.0, frames=3)
    exact = fk.simulate(scenario, progress=False)
    tiles = fk.simulate(scenario, engine="tiles", step=0.0005, progress=False)
    assert np.abs(tiles.q - exact.q).max() < 5e-3 * max(1.0, np.abs(exact.q[-1] - exact.q[0]).max())
    assert np.abs(exact.q[-1] - exact.q[0]).max() > 0
