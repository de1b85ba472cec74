"""What a hostile or unlucky user meets: every refusal in words, every stop loud, nothing endless or silent."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import (
    FlockingError,
    InvalidInput,
    LinkLost,
    NotFinite,
    OutOfPrecision,
    StepTooLarge,
    TooCrowded,
    UnsupportedLaw,
)
from flocking.model.graphs.distance_graphs import Graph, pair_distances
from flocking.model.graphs.weights import PairWeights
from tests.engine.tiles.laws import saber, structural, zhou

LATTICE = fk.start.hexagonal(1000, spacing=0.9, noise=0.05, speed=0.5, seed=1)


def short(state: fk.State, law: fk.Law | None = None, **options: Any) -> Any:
    scenario = fk.Scenario(law or saber(), state, t_end=0.1, frames=3)
    return fk.simulate(scenario, engine="tiles", progress=False, **{"step": 0.01, **options})


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("threads", 1.5, "integer"), ("threads", 0, "at least 1"), ("threads", 10**6, "at most 1024"),
        ("ledger", 3, "True or False"), ("observe", "yes", "True or False"), ("keep_frames", 0, "True or False"),
        ("step", np.inf, "finite"), ("step", "0.1", "number"), ("skin", np.nan, "finite"), ("step", 1e-320, "1e\\+12"),
        ("memory_limit", np.inf, "finite"),
    ],
)  # fmt: skip
def test_options_that_make_no_sense(option: str, value: Any, said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        short(LATTICE, **{option: value})


def test_a_step_longer_than_the_run_is_one_step() -> None:
    run = short(LATTICE, step=1e10, ledger=False)
    assert (run.provenance["steps"], len(run.t), run.t[-1]) == (2, 3, 0.1)


def test_no_time_at_all() -> None:
    run = fk.simulate(fk.Scenario(saber(), LATTICE, t_end=0.0, frames=1), engine="tiles", progress=False)
    assert (run.finished, len(run.t)) == (True, 1)


@pytest.mark.parametrize(("far", "precision"), [(1e7, "float32"), (1e15, "float64")])
def test_a_place_where_numbers_are_too_coarse(far: float, precision: str) -> None:
    with pytest.raises(OutOfPrecision, match="near the origin"):
        short(fk.State(LATTICE.q + far, LATTICE.p), precision=precision)
    assert short(fk.State(LATTICE.q + far / 1e4, LATTICE.p), precision=precision).finished


def test_a_flock_that_flies_out_of_precision_is_stopped() -> None:
    away = fk.State(LATTICE.q, LATTICE.p + [1e8, 0.0])
    with pytest.raises(OutOfPrecision) as caught:
        short(away, precision="float32", ledger=False)
    assert 0 < len(caught.value.run.t) < 3
    assert short(away, ledger=False).finished


def test_one_agent_far_away_does_not_stop_the_rest() -> None:
    alone = np.array(LATTICE.q)
    alone[17] += 1.2e6
    for precision in ("float64", "float32"):
        run = short(fk.State(alone, LATTICE.p), precision=precision)
        others = np.delete(np.arange(1000), 17)
        here = short(LATTICE, precision=precision)
        near = np.linalg.norm(LATTICE.q - LATTICE.q[17], axis=1) > 2.0
        both = others[near[others]]
        assert np.abs(run.q[-1, both] - here.q[-1, both]).max() < 1e-3


def test_speeds_whose_squares_overflow() -> None:
    with pytest.raises(InvalidInput, match="Squares of the velocities overflow in float64"):
        short(fk.State(LATTICE.q, LATTICE.p * 1e200))


def test_an_explosion_is_stopped_and_says_who() -> None:
    law = fk.Law(fk.Proximity(50.0), [fk.Gradient(fk.Potential("-1e25*r**2"))])
    with pytest.raises((NotFinite, StepTooLarge)) as caught:
        short(LATTICE, law, ledger=False, step=0.05, precision="float32")
    assert caught.value.agents
    assert np.isfinite(caught.value.run.q).all()


@pytest.mark.parametrize("scheme", ["verlet", "damped", "rk4"])
@pytest.mark.parametrize("speed", [1.0, 30.0, 3e5])
def test_no_step_lets_a_kept_link_break_unseen(scheme: str, speed: float) -> None:
    start = fk.State([[0.0, 0.0], [3.9, 0.0], [0.0, 2.0]], [[-speed, 0.0], [speed, 0.0], [0.0, 0.0]])
    scenario = fk.Scenario(zhou(), start, t_end=1.0)
    if speed > 1.0:
        with pytest.raises((LinkLost, StepTooLarge), match="step") as caught:
            fk.simulate(scenario, engine="tiles", step=0.05, scheme=scheme, ledger=False, progress=False)
        assert set(caught.value.agents) == {0, 1}
        return
    session = TilesSession(scenario, TilesOptions(step=0.002, scheme=scheme))
    session.advance(1.0)
    assert session.state.links[0, 1]


@pytest.mark.parametrize("scheme", ["verlet", "rk4"])
@pytest.mark.parametrize("speed", [4.0, 20.0, 2000.0])
def test_no_step_jumps_through_another_agent(scheme: str, speed: float) -> None:
    start = fk.State([[0.0, 0.0], [2.0, 0.0]], [[speed, 0.0], [-speed, 0.0]])
    scenario = fk.Scenario(zhou(), start, t_end=0.3, frames=3)
    with pytest.raises(StepTooLarge, match="would do") as caught:
        fk.simulate(scenario, engine="tiles", step=0.05, scheme=scheme, ledger=False, progress=False)
    assert caught.value.agents == (0, 1)
    assert 0 < caught.value.would_do < 0.05


MEMORY = """
import resource, sys
import numpy as np
import flocking as fk
n, how = int(sys.argv[1]), sys.argv[2]
rng = np.random.default_rng(0)
q = rng.random((n, 2)) * np.sqrt(n)
if how == "straggler": q[n // 2] += 1.2e6
if how == "spot": q *= 1e-6
law = fk.Law(fk.Proximity(1.2), [fk.Consensus(1.0)])
scenario = fk.Scenario(law, fk.State(q, rng.normal(size=(n, 2))), t_end=0.05, frames=1)
try:
    fk.simulate(scenario, engine="tiles", step=0.01, progress=False, memory_limit=1e8)
    print("finished", end=" ")
except fk.SimulationError as error:
    print(type(error).__name__, end=" ")
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def test_memory_stays_bounded_whatever_the_shape_of_the_crowd() -> None:
    """A straggler at 10^6 radii and everybody in one spot against a plain crowd of 50,000; peak memory in MiB."""
    found = {}
    for how in ("plain", "straggler", "spot"):
        done = subprocess.run([sys.executable, "-c", MEMORY, "50000", how], capture_output=True, text=True, check=True)
        status, peak = done.stdout.split()
        found[how] = (status, float(peak))
    assert found["plain"][0] == found["straggler"][0] == "finished"
    assert found["spot"][0] == TooCrowded.__name__
    assert found["straggler"][1] < found["plain"][1] + 30
    assert found["spot"][1] < found["plain"][1] + 150


@pytest.mark.parametrize("law", ["proximity", "hysteresis"])
def test_trajectories_with_switching_links_converge_to_the_exact_engine(law: str) -> None:
    """Switches fall on steps: order 1, in space as in the plane."""
    laws = {
        "proximity": fk.Law(fk.Proximity(1.5), [fk.Gradient(structural()), fk.Consensus(0.5)]),
        "hysteresis": fk.Law(fk.Hysteresis(radius=1.5, gap=0.2), [fk.Gradient(structural()), fk.Consensus(0.5)]),
    }
    start = fk.start.box(30, side=3, dimension=3, speed=2.0, seed=3)
    scenario = fk.Scenario(laws[law], start, t_end=0.6, frames=2, tolerance=1e-11)
    exact = fk.simulate(scenario, engine="exact", progress=False)
    assert len(exact.switches) > 5
    errors = []
    for step in (0.004, 0.002, 0.001, 0.0005):
        run = fk.simulate(scenario, engine="tiles", step=step, progress=False)
        errors.append(np.abs(run.q[-1] - exact.q[-1]).max())
    assert np.log2(errors[0] / errors[-1]) / 3 == pytest.approx(1.0, abs=0.35)
    assert errors[-1] < 2e-3


@dataclass(frozen=True)
class Ring(Graph):
    """Everybody senses the next one and the one before, at all distances: a graph that no list of pairs states."""

    moves = False
    appear_radius = 0.0  # type: ignore[assignment]
    break_radius = np.inf  # type: ignore[assignment]

    def initial(self, q: np.ndarray) -> np.ndarray:
        n = len(q)
        away = (np.arange(n)[None] - np.arange(n)[:, None]) % n
        return np.asarray((away == 1) | (away == n - 1))


class Loose(fk.Fixed):
    """Pairs that are all but the first: its links are not those of its list."""

    def initial(self, q: np.ndarray) -> np.ndarray:
        return fk.Fixed(self.n, self.edges[1:]).initial(q)


@dataclass(frozen=True, eq=False)
class Gaps(Graph):
    """Links that appear and break at distances that differ between agents."""

    leave: Any
    enter: Any
    directed = True
    follows_radii = True

    @property
    def appear_radius(self) -> Any:
        return self.enter

    @property
    def break_radius(self) -> Any:
        return self.leave

    def initial(self, q: np.ndarray) -> np.ndarray:
        return np.asarray(pair_distances(q) < np.asarray(self.leave)[..., None])


EACH = np.linspace(1.2, 1.6, 6)


@pytest.mark.parametrize("control", [{}, {"control": fk.Held(0.05)}])
@pytest.mark.parametrize(
    ("graph", "why"),
    [
        (Ring(), "Ring, whose links never change"), (Loose(6, [(0, 1), (2, 3)]), "Loose, whose links never change"),
        (Gaps(2.0, EACH), "Gaps, whose links appear and break at different distances"),
        (Gaps(EACH, 1.0), "Gaps, whose links"), (Gaps(EACH + 0.5, EACH), "Gaps, whose links"),
    ],
)  # fmt: skip
def test_graphs_whose_links_the_kernels_would_not_have_are_refused(
    graph: Graph, why: str, control: dict[str, Any]
) -> None:
    start = fk.State(np.random.default_rng(0).uniform(0, 3, (6, 2)), np.zeros((6, 2)))
    law = fk.Law(graph, [fk.Gradient(fk.Potential("(r - 1)**2"))])
    with pytest.raises(UnsupportedLaw, match=why):
        fk.simulate(fk.Scenario(law, start, t_end=0.1, frames=2, **control), engine="tiles", step=0.01, progress=False)


def test_a_graph_of_ones_own_whose_distances_are_one_runs() -> None:
    """Radii of each agent, without a gap: as `PerAgentRadii`, and as the reference states."""
    start = fk.State(np.random.default_rng(0).uniform(0, 3, (6, 2)), np.zeros((6, 2)))
    law = fk.Law(Gaps(EACH, EACH.copy()), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    session = TilesSession(fk.Scenario(law, start, t_end=0.1, frames=2), TilesOptions(step=0.01))
    assert session.accelerations() == pytest.approx(fk.evaluate(law, start).u, rel=1e-12, abs=1e-13)


class Halves(PairWeights):
    """Weights of somebody else."""

    symmetric = True

    def matrix(self, n: int) -> np.ndarray:
        return np.full((n, n), 0.5)


def line(m: int, **parts: Any) -> fk.Scenario:
    """Three agents on a line in space of m axes."""
    weights = parts.pop("weights", None)
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0, weights=weights)])
    return fk.Scenario(law, fk.State(np.arange(3.0)[:, None] * np.ones(m), np.zeros((3, m))), 1.0, frames=2, **parts)


HELD = {"control": fk.Held(0.1)}


@pytest.mark.parametrize(
    ("scenario", "options", "said"),
    [
        (line(1), {}, "cannot run 1 dimensions, only 2 or 3"), (line(4), {}, "cannot run 4 dimensions, only 2 or 3"),
        (line(1, **HELD), {}, "cannot run 1 dimensions, only 2 or 3"),
        (line(2, weights=Halves()), {}, "cannot run the pair weights Halves of"),
        (line(2), {"scheme": "euler"}, "scheme must be one of verlet, damped, rk4 for agents of order 2"),
        (line(2, agents=fk.SingleIntegrator()), {"scheme": "verlet"}, "one of rk4, euler for agents of order 1"),
        (line(2), {"step": 1e-13}, r"step must reach the end in 1e\+12 steps"),
    ],
)  # fmt: skip
def test_what_kernels_and_steps_do_not_do_is_refused(scenario: fk.Scenario, options: dict[str, Any], said: str) -> None:
    with pytest.raises(FlockingError, match=said):
        fk.simulate(scenario, engine="tiles", progress=False, **options)
