"""The summary of a run in words: which pairs it is about, and times of runs that begin late."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.apps.commands.run_summary import facts, summary
from flocking.engine.runs.run import OF_VELOCITIES


def passing(t: float, engine: str) -> dict[str, str]:
    """Facts of two agents without a link that pass at a distance of 1 after a second, beside a linked pair 3 apart."""
    law = fk.Law(fk.Fixed(4, [(2, 3)]), [fk.Gradient(fk.Potential("(r - 3)**2/2"))])
    q = [[0.0, 0.0], [2.0, 1.0], [50.0, 0.0], [53.0, 0.0]]
    start = fk.State(q, [[1.0, 0.0], [-1.0, 0.0], [0.0, 0.0], [0.0, 0.0]], t)
    run = fk.simulate(fk.Scenario(law, start, t_end=t + 4.0, frames=5), engine=engine, progress=False)
    return dict(facts(summary(run)))


@pytest.mark.parametrize("t", [0.0, 1.76e9])
def test_the_closest_pair_of_all_and_of_linked_pairs_alone_are_distinguished(t):
    found = passing(t, "exact")
    assert found["closest pair"].startswith("1, agents 0 and 1")
    assert "closest linked pair" not in found
    tiled = passing(t, "tiles")
    assert tiled["closest linked pair"].startswith("3, agents 2 and 3")
    assert "closest pair" not in tiled


def test_times_of_runs_that_begin_late_have_the_digits_that_differ():
    found = passing(1.76e9, "exact")
    assert found["time reached"] == "1760000004"
    assert found["closest pair"].endswith("t = 1760000001")


def test_the_closest_pair_states_how_much_closer_agents_may_have_come():
    """Two agents on straight lines, at most 2 apart in speed: between looks h apart they come closer by 2 h at most."""
    law = fk.Law(fk.Proximity(9.0), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [2.0, 1.0]], [[1.0, 0.0], [-1.0, 0.0]])
    scenario = fk.Scenario(law, start, t_end=2.0, frames=3)
    exact = dict(facts(summary(fk.simulate(scenario, progress=False))))
    assert exact["closest pair"] == "1, agents 0 and 1, t = 1"
    run = fk.simulate(scenario, engine="tiles", step=0.07, progress=False)
    found = dict(facts(summary(run)))["closest linked pair"]
    distance, closer = float(found.split(",")[0]), float(found.split("up to ")[1].split()[0])
    assert distance >= 1.0 - 1e-6 >= distance - closer
    assert closer < 4 * 0.07


def test_ranges_of_obstacles_are_no_switches_of_links():
    law = fk.Law(fk.Fixed(1, []), [fk.Avoid((fk.Ball([3.0, 0.0], 1.0),), range=1.0, gamma_agents=False)])
    start = fk.State([[0.0, 0.0]], [[1.0, 0.0]])
    found = dict(facts(summary(fk.simulate(fk.Scenario(law, start, t_end=1.1), progress=False))))
    assert found["link switches"] == "none"
    assert found["other switches"] == "1 obstacle"


def test_a_run_that_stopped_after_its_last_frame_says_where_it_was_and_of_when_its_state_is():
    """Two agents at rest, 1 apart, fall into each other under -1/r^2: r'' = -4/r^3, so that r^2 = 1 - 4 t^2."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("-1/r**2"))])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=10.0, frames=3)
    with pytest.raises(fk.SimulationError) as stopped:
        fk.simulate(scenario, progress=False)
    found = summary(stopped.value.run)
    assert (found["state_time"], found["frames"]) == (0.0, 1)
    assert found["time"] == pytest.approx(0.5, abs=1e-6)
    told = dict(facts(found))
    assert told["time reached"].startswith("0.5")
    assert told["velocity spread"] == "0.000e+00, at t = 0, of the last frame"
    assert "flocks at the end" not in told
    assert told["flocks in the last frame"] == "1, at t = 0, of the last frame"


@pytest.mark.parametrize("engine", ["exact", "tiles"])
def test_frames_that_end_before_the_run_are_not_its_end(engine):
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=2.0, frames=[0.0, 0.5]), engine=engine, progress=False)
    found = summary(run)
    assert (found["time"], found["state_time"]) == (2.0, 0.5)
    told = dict(facts(found))
    assert told["time reached"] == "2"
    assert told["velocity spread"].endswith(", at t = 0.5, of the last frame")
    assert "flocks at the end" not in told


def test_an_energy_that_is_known_for_a_part_of_the_run_is_not_that_at_the_end():
    """Under held forces two agents leave a barrier at a distance of 1, where the energy is infinite."""
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("-log(1 - r**2)"))])
    start = fk.State([[0.0, 0.0], [0.5, 0.0]], [[0.0, 0.0], [3.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=3.0, frames=4, control=fk.Held(0.1)), progress=False)
    found = summary(run)
    assert dict(facts(found))["energy"].endswith("at t = 0.1, where the ledger ends")
    assert found["energy"]["ledger_ends"] == run.trace["time"][-1] == 0.1
    assert dict(facts(found))["ledger residual"].endswith(" moved, until the ledger ends")


def test_a_ledger_that_ends_where_it_begins_has_no_residual(tmp_path, capsys):
    """The two are beyond the barrier before the first tick: rows of one time balance whatever moved."""
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("-log(1 - r**2)"))])
    start = fk.State([[0.0, 0.0], [0.5, 0.0]], [[0.0, 0.0], [9.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=4, control=fk.Held(0.1)), progress=False)
    assert run.trace["time"].max() == 0.0
    found = summary(run)
    assert found["ledger_residual"] is None
    assert dict(facts(found))["ledger residual"] == "not known, the ledger ends where it begins"
    fk.write_run(run, tmp_path / "run")
    assert main(["info", str(tmp_path / "run"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ledger_residual"] is None


@pytest.mark.parametrize(
    ("error", "said"), [(5e-7, ""), (2e-6, "; known to within 2e-06"), (1e-4, "; known to within 0.0001")]
)
def test_an_error_that_the_digits_show_is_told(error, said):
    """Distances are shown with six digits: a millionth of them is not seen."""
    law = fk.Law(fk.Proximity(9.0), [fk.Consensus(0.0)])
    run = fk.simulate(fk.Scenario(law, fk.State([[0.0], [1.0]]), 0.1, frames=2), progress=False)
    told = summary(run)
    assert told["closest"]["distance"] == 1.0
    told["closest"]["error"] = error
    assert dict(facts(told))["closest pair"] == f"1, agents 0 and 1, t = 0{said}"


def test_velocities_that_nobody_has_are_not_summed_up():
    """Earlier versions stored zeros where agents of order 1 have no velocities: an order of 0 would be a statement."""
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("(r - 1)**2/2"))])
    start = fk.State([[0.0, 0.0], [1.5, 0.0]])
    made = fk.Scenario(law, start, 0.1, frames=2, agents=fk.SingleIntegrator())
    run = fk.simulate(made, engine="tiles", step=0.01, observe=True, progress=False)
    older = run.observables.copy()
    for name in OF_VELOCITIES:
        older[name] = 0.0
    for each in (run, replace(run, observables=older)):
        told = summary(each)
        assert [told["observed"][name] for name in OF_VELOCITIES] == [None] * len(OF_VELOCITIES)
        assert told["observed"]["flocks"] == told["flocks"] == 1
        assert not {"order", "velocity_spread"} & set(told)
