"""Faults that random cases brought to light, one line each."""

from __future__ import annotations

import json
import shutil
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.engine.storage import record
from flocking.engine.storage.stored_runs import read_run, write_run
from flocking.errors import FormulaError, InvalidInput, StorageError
from flocking.formula.grammar import Formula
from flocking.model.graphs import connectivity
from tests.engine.storage.stored_runs import finished

PSI = fk.Potential("1/r")
LAW = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
SEVERAL = np.ones((2, 2))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: fk.Gradient(PSI, SEVERAL), "Gradient: weighting"),
        (lambda: fk.Velocity(np.array([1j, 2])), "Velocity: value must be an array of numbers"),
        (lambda: fk.read_start(3), "read_start: path"),
        (lambda: fk.start.box(3, side=1, seed=0, most_agents=[None]), "start.box: most_agents"),
        (lambda: fk.State([[0.0], [1.0]], links=[[1, 2], [3]]), "State: links"),
        (lambda: fk.Path(3), "Path: velocity"),  # type: ignore[arg-type]
        (lambda: fk.Path(["t"], start_time=10**400), "fits 64 bits"),
        (lambda: fk.PerAgentRadii(10**400), "PerAgentRadii: radii"),
        (lambda: fk.FieldOfView(1.0, [[1, 2], [3]]), "FieldOfView: half_angle"),
        (lambda: fk.Fixed(3, 1.0), "Fixed: edges"),
        (lambda: fk.Fixed(3, [[0, 1]], SEVERAL), "Fixed: directed"),
        (lambda: fk.Smooth(1.0, 0.5, [1, 2]), "Smooth: bump"),
        (lambda: fk.Schedule([1.0], 3.0), "Schedule: values"),
        (lambda: fk.Agents(order=SEVERAL), "Agents: order"),
        (lambda: fk.Cone(1.0, 1.0, SEVERAL), "Cone: measure"),
        (lambda: fk.Energy(SEVERAL), "Energy: frame"),
        (lambda: fk.Avoid(3.0, range=1.0), "Avoid: obstacles"),
        (lambda: fk.Consensus(1.0, weighted=SEVERAL), "Consensus: weighted"),
        (lambda: fk.ConvexPolygon([[0, 0], [1, 0], [0, 1]], 0.1, "x"), "ConvexPolygon: motion"),
        (lambda: fk.start.box(3, side=1, seed=0, velocities=SEVERAL), "start.box: velocities"),
        (lambda: fk.start.box(3, side=1, seed=0, connected_under=1.0), "start.box: connected_under"),
        (lambda: fk.start.box(10**12, side=1, seed=0), "Pass most_agents"),
        (lambda: fk.start.hexagonal(11, spacing=1, seed=0, most_agents=10), "must be at most 10"),
        (lambda: fk.start.ball(3, radius=1, seed=0, dimension=10**12), "start.ball: dimension must be at most 1000"),
        (lambda: fk.Scenario(LAW, finished().state(0), t_end=9, frames=10**12), "Scenario: frames"),
        (lambda: fk.control(3, finished().state(0)), "control: law"),
        (lambda: fk.evaluate(LAW, finished().state(0), agents=3), "control: agents"),
        (lambda: fk.control_of(3, fk.Agent([0.0], [0.0]), []), "control_of: law"),
        (lambda: fk.control_of(LAW, fk.Agent([0.0], [0.0]), [fk.Agent([0, 0], [0, 0])]), "control_of: neighbours"),
        (lambda: fk.audit(3), "audit: run"),
        (lambda: fk.audit(finished(), 3), "audit: claims"),
        (lambda: fk.simulate(finished().scenario, engine=SEVERAL), "start: engine"),
        (lambda: fk.read_run(3), "read_run: folder"),
        (lambda: fk.resume(3), "resume: folder"),
        (lambda: fk.read_scenario(3), "read_scenario: path"),
        (lambda: fk.write_scenario(3, "x.toml"), "write_scenario: scenario"),
    ],
)
def test_wrong_types_are_told(make: Any, words: str) -> None:
    with pytest.raises(InvalidInput, match=words):
        make()


@pytest.mark.parametrize("text", ["exp(43*log(64))^exp(43*log(64))", "exp(20*log(exp(20*log(r))))", "r^exp(2*log(r))"])
def test_powers_written_with_exp_and_log_have_the_limits_of_powers(text: str) -> None:
    begin = time.process_time()
    with pytest.raises(FormulaError, match="power"):
        Formula(text)
    assert time.process_time() - begin < 1.0


def test_powers_written_with_exp_and_log_are_admitted_within_the_limits() -> None:
    assert fk.Potential("exp(-12*log(r))")(2.0) == pytest.approx(2.0**-12)


@pytest.mark.parametrize(
    ("text", "value"), [("tan((64)**(26))*r", 1.0), ("sqrt(a)*r", -2.0), ("a**(-37)*r", 0.0), ("((a**8)**8)**4*r", 1e9)]
)
def test_numbers_out_of_range_give_no_traceback(text: str, value: float) -> None:
    names = Formula(text).names - {"r"}
    assert np.shape(fk.Potential(text, **dict.fromkeys(names, value)).slope([1.0, 2.0])) == (2,)


@pytest.mark.filterwarnings("ignore::flocking.errors.SuspectInput")
def test_a_sine_of_a_number_without_digits_has_no_zero_to_search() -> None:
    """An array's powers differ in the last bit from those of one number, after which such a sine has another sign."""
    psi = fk.Potential("abs(r) + (tan(sinh(r**-2))*(84.5 - sinh(3 + r*r)))**3")
    law = [fk.Gradient(psi)]
    with pytest.raises(InvalidInput, match="falls without bound to its pole"):
        fk.Scenario(fk.Law(fk.Proximity(4.0), law), fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=1.0)


def test_exact_numbers_have_a_limit() -> None:
    with pytest.raises(FormulaError, match="below 1e100"):
        fk.Potential("(64**60)*r")(1.0)


def test_a_leader_without_real_velocity_is_nowhere() -> None:
    for part in fk.Path(["log(t)**2", "sqrt(t)"]).at(-1.0):
        assert np.isnan(part).any()


def test_a_connected_draw_gives_up_by_pairs_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connectivity, "MOST_PAIRS", 90_000)
    with pytest.raises(InvalidInput, match="no connected graph of 30 agents in 100 draws"):
        fk.start.box(30, side=1e6, seed=0, connected_under=fk.Proximity(1.0))
    with pytest.raises(InvalidInput, match="must be at most 10000 where the start must be connected"):
        fk.start.box(10**6, side=1.0, seed=0, connected_under=fk.Proximity(1.0))


def test_a_record_that_contradicts_itself_is_told(tmp_path: Path) -> None:
    folder = write_run(finished(), tmp_path / "run")
    root = json.loads((folder / "zarr.json").read_bytes())
    root["consolidated_metadata"]["metadata"]["velocity"]["shape"] = 1
    del root["attributes"]["flocking"]["seal"]
    root["attributes"]["flocking"]["seal"] = record._seal(root)
    (folder / "zarr.json").write_text(json.dumps(root))
    with pytest.raises(StorageError, match="not a run that this version can read: velocity: shape must be a list of 3"):
        read_run(folder)
    shutil.rmtree(folder)


def test_powers_of_numbers_beyond_all_bounds_are_refused_at_once() -> None:
    with pytest.raises(InvalidInput, match="not a real finite number"):
        fk.Potential("where(sin(r) > 2, 1e9, sin(2))^cosh(1e9)").kinks()
