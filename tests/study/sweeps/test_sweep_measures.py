"""Measures of sweeps say no more than the run shows: rounding, errors of the run, and switches in doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import DOUBT_FIELDS
from flocking.model.space import OPEN
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable
from flocking.study.sweeps.measures import MEASURES

ROW = fk.Scenario(
    fk.Law(fk.Proximity(1.5), [fk.Consensus(1.0)]), fk.State([[float(k), 0.0] for k in range(4)]), t_end=10.0, frames=11
)
"""Four agents in a row, 1 apart, each linked to the next."""

BREAKS = (5.0, 2, 3, "break", 0, 0.1, False, 1e-9, 1e-9)
"""A switch after which the last of them is alone."""

DOUBTS = {
    "the break may not be": (4.9, 10.0, 5.0, 2, 3, "switch", 0, "break", 0.0, 1e-6),
    "another may break before": (1.9, 2.1, 2.0, 0, 1, "near miss", 0, "break", 1e-7, 1e-6),
}


def measured(e: Evidence, *names: str) -> list[object]:
    """Values by name, None where they are not known."""
    found: list[object] = []
    for name in names:
        try:
            found.append(MEASURES[name][1](e))
        except NotResolvable:
            found.append(None)
    return found


@pytest.fixture(scope="module")
def row() -> fk.Run:
    return fk.simulate(ROW, progress=False)


def doubted(run: fk.Run, *doubts: str, switches: tuple[tuple, ...] = (BREAKS,), until: float = np.inf) -> Evidence:
    """The run with recorded switches, and some of them in doubt."""
    assert run.accuracy is not None
    rows = np.array([DOUBTS[name] for name in doubts], dtype=DOUBT_FIELDS)
    accuracy = replace(run.accuracy, doubts=rows, known_until=until)
    return Evidence(replace(run, switches=np.array(list(switches), dtype=run.switches.dtype), accuracy=accuracy))


def test_switches_that_are_certain_are_measured(row: fk.Run) -> None:
    names = ("connected", "disconnected_at", "links_lost", "links_created", "last_switch")
    assert measured(doubted(row), *names) == [False, 5.0, 1, 0, 5.0]
    kept = measured(doubted(row, switches=()), *names)
    assert kept[0] is True
    assert np.isnan(kept[1])
    assert kept[2:] == [0, 0, 0.0]


def test_a_graph_whose_break_is_in_doubt_is_not_said_to_fall_apart(row: fk.Run) -> None:
    e = doubted(row, "the break may not be")
    names = ("connected", "disconnected_at", "links_lost", "links_created", "last_switch")
    assert measured(e, *names) == [None, None, None, 0, None]


def test_a_graph_that_nearly_falls_apart_is_not_said_to_stay_connected(row: fk.Run) -> None:
    e = doubted(row, "another may break before", switches=())
    assert measured(e, "connected", "disconnected_at", "links_lost") == [None, None, None]


def test_the_first_time_apart_is_open_where_there_may_be_one_before(row: fk.Run) -> None:
    e = doubted(row, "another may break before")
    assert measured(e, "connected", "disconnected_at", "links_lost") == [False, None, None]


def test_what_comes_after_the_end_of_knowledge_is_open_and_what_comes_before_is_not(row: fk.Run) -> None:
    names = ("connected", "disconnected_at", "links_lost")
    assert measured(doubted(row, until=3.0), *names) == [None, None, None]
    assert measured(doubted(row, until=7.0), *names) == [False, 5.0, None]


def test_a_graph_seen_at_frames_alone_may_fall_apart_between_them(row: fk.Run) -> None:
    unseen = Evidence(replace(row, fidelity=replace(row.fidelity, switches_located=False), accuracy=None))
    assert measured(unseen, "connected", "disconnected_at", "links_lost", "last_switch") == [None] * 4


@pytest.mark.parametrize("velocity", [[0.1, 0.7], [0.3, -0.9], [1 / 3, 1e3], [0.0, 0.0]])
def test_velocities_that_agree_to_rounding_agree_from_the_start(velocity: list[float]) -> None:
    """The mean of three equal numbers may differ from them by rounding, and falls to no share of that."""
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.3], [0.2, 1.1]], [velocity] * 3)
    e = Evidence(fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=11), progress=False))
    assert measured(e, "converged", "convergence_time") == [True, 0.0]


def test_differences_within_the_error_of_a_run_are_open(row: fk.Run) -> None:
    """The spread is 1e-10, by an error of 1e-9 of each velocity: neither agreement nor another motion is shown."""
    assert row.accuracy is not None
    p = np.zeros_like(row.p)
    p[:, 0, 0] = 1e-10 * np.linspace(0.0, 1.0, len(p))
    errors = np.full_like(row.accuracy.frames, 1e-9)
    small = replace(row, p=p, accuracy=replace(row.accuracy, frames=errors))
    assert measured(Evidence(small), "converged", "convergence_time") == [None, None]
    clear = replace(small, p=1e3 * p)
    assert measured(Evidence(clear), "converged") == [False]


@pytest.mark.parametrize(("later", "agreed"), [(-1e-6, False), (-1e-12, None), (1e-12, None), (1e-6, True)])
def test_a_hundredth_within_the_error_of_a_run_is_open(later: float, agreed: bool | None) -> None:
    """Velocities of two agents differ by 2 exp(-2 t), a hundredth of the first after log(100)/2, to 1e-9."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    end = np.log(100.0) / 2.0 * (1.0 + later)
    e = Evidence(fk.simulate(fk.Scenario(law, start, end, frames=11), progress=False))
    assert measured(e, "converged") == [agreed]
    if agreed:
        assert measured(e, "convergence_time") == [end]
    # A frame that may be the first one leaves the time open, and not what is so at the end.
    longer = fk.simulate(fk.Scenario(law, start, 2.0 * end, frames=21), progress=False)
    time = {-1e-6: longer.t[11], 1e-6: longer.t[10]}.get(later)
    assert measured(Evidence(longer), "converged", "convergence_time") == [True, time]


def test_a_leaders_velocity_is_followed_from_the_start_by_agents_that_have_it() -> None:
    leader = fk.Track(fk.Velocity([0.1, 0.7]), velocity_gain=2.0)
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0), leader])
    start = fk.State([[0.0, 0.0], [1.0, 0.3], [0.2, 1.1]], [[0.1, 0.7]] * 3)
    run = fk.simulate(fk.Scenario(law, start, t_end=1.0, frames=11), progress=False)
    assert measured(Evidence(run), "following", "following_time") == [True, 0.0]
    nearly = replace(run, p=np.nextafter(run.p, np.inf) + np.spacing(run.p), accuracy=None)
    assert measured(Evidence(nearly), "following", "following_time") == [True, 0.0]


def rows(scenario: fk.Scenario, *names: str, engine: str = "auto") -> tuple[dict, str]:
    """Values and message of the only run of a sweep."""
    options = {"workers": 1, "progress": False, "engine": engine}
    (row,) = fk.sweep(lambda seed: scenario, seeds=[0], measures=names, **options).rows.values()
    assert row["status"] == "ok"
    return row["values"], row["message"]


LEDGER = ("energy", "energy_most", "dissipated", "ledger_closes")


def test_the_energy_where_the_ledger_ends_is_not_that_at_the_end() -> None:
    """Two agents part at 3 under forces that are held for a period of 1/10 and leave the barrier at a distance of 1."""
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("-log(1 - r**2)"))])
    start = fk.State([[0.0, 0.0], [0.5, 0.0]], [[0.0, 0.0], [3.0, 0.0]])
    values, message = rows(fk.Scenario(law, start, t_end=3.0, frames=4, control=fk.Held(0.1)), *LEDGER, "energy_start")
    # At the start the kinetic energy about the centre of mass is 2 * 1.5**2/2, or 9/2 in the frame at rest.
    kinetic = values["energy_start"] + np.log(1 - 0.5**2)
    assert any(abs(kinetic - expected) < 1e-12 for expected in (2.25, 4.5))
    assert all(np.isnan(values[name]) for name in LEDGER)
    assert "energy: the ledger ends at t = 0.1, before the run" in message


@pytest.mark.parametrize(("begin", "end"), [(0.0, 0.3), (1e6, 1e6 + 0.3), (-0.1, 0.2), (1e-8, 4e-8)])
@pytest.mark.parametrize("engine", ["exact", "sampled", "tiles"])
def test_ledgers_that_reach_the_end_are_measured_whatever_the_time(begin: float, end: float, engine: str) -> None:
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [0.8, 0.0], [0.3, 0.9]], [[0.1, 0.0], [0.0, 0.2], [0.0, 0.0]], begin)
    world = {"control": fk.Held((end - begin) / 10)} if engine == "sampled" else {}
    values, _ = rows(fk.Scenario(law, start, t_end=end, frames=3, **world), "energy", "dissipated", engine=engine)
    assert np.isfinite([values["energy"], values["dissipated"]]).all()


def test_a_closest_approach_that_is_not_known_says_why() -> None:
    law = fk.Law(fk.Proximity(0.1), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [10.0, 1.0]], [[1.0, 0.0], [-1.0, 0.0]])
    scenario = fk.Scenario(law, start, t_end=10.0, frames=3)
    values, message = rows(scenario, "closest", "closest_linked", engine="exact")
    assert values["closest"] == pytest.approx(1.0)
    assert "closest_linked: no two agents were ever linked" in message
    values, message = rows(scenario, "closest", engine="tiles")
    assert np.isnan(values["closest"])
    assert "closest: no two agents were linked, and the engine records linked ones only" in message
    alone = fk.Scenario(law, fk.State([[0.0, 0.0]]), t_end=0.1, frames=2)
    assert "closest: there is one agent" in rows(alone, "closest")[1]


def test_an_approach_that_was_looked_for_at_times_is_not_the_closest(row: fk.Run) -> None:
    """LAMMPS sees distances when lists of neighbours are made anew; in between agents may come closer."""
    approaches = replace(row.fidelity.approaches, looked="when lists of neighbours were made")
    seen = Evidence(replace(row, fidelity=replace(row.fidelity, approaches=approaches)))
    for name in ("closest", "closest_linked"):
        with pytest.raises(NotMeasurable, match="recorded only when lists of neighbours were made"):
            MEASURES[name][1](seen)


def test_agents_without_velocities_have_no_order_and_no_speeds() -> None:
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("(r - 1)**2/2"))])
    start = fk.State([[0.0, 0.0], [0.5, 0.0], [0.3, 0.9]])
    names = ("order", "speed_spread", "speed", "velocity_spread")
    values, message = rows(fk.Scenario(law, start, t_end=0.2, frames=3, agents=fk.SingleIntegrator()), *names)
    assert all(np.isnan(values[name]) for name in names)
    assert "order: frames of agents of order 1 hold no velocities" in message


def test_order_and_speeds_of_agents_that_have_some() -> None:
    law = fk.Law(fk.Fixed.complete(3), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [0.5, 0.0], [0.3, 0.9]], [[3.0, 0.0], [0.0, 4.0], [0.0, 0.0]])
    values, _ = rows(fk.Scenario(law, start, t_end=0.2, frames=3), "order", "speed_spread")
    assert values["order"] == pytest.approx(np.sqrt(0.5))
    assert values["speed_spread"] == pytest.approx(4.0)


def test_the_spread_is_about_the_velocity_of_the_centre_of_mass() -> None:
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 0.0]])
    values, _ = rows(fk.Scenario(law, start, t_end=0.2, frames=3, agents=fk.Agents([3.0, 1.0])), "velocity_spread")
    assert values["velocity_spread"] == pytest.approx(0.75)
    assert "centre of mass" in MEASURES["velocity_spread"][0]


def test_the_diameter_in_space_that_repeats_is_to_the_nearest_images() -> None:
    """Agents at 0.1 and 4.9 in a box of 5 by 5 are 0.2 apart, and no two can be further than half a diagonal."""
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)])
    start = fk.State([[0.1, 0.1], [4.9, 0.1]], [[1.0, 0.0], [1.0, 0.0]])
    scenario = fk.Scenario(law, start, t_end=20.0, frames=3, space=fk.Periodic([5.0, 5.0]))
    values, _ = rows(scenario, "diameter", "closest")
    assert values["diameter"] == pytest.approx(0.2) == values["closest"]
    values, _ = rows(scenario.with_(space=OPEN), "diameter")
    assert values["diameter"] == pytest.approx(4.8)


@pytest.mark.parametrize("engine", ["exact", "tiles"])
def test_what_was_at_the_last_frame_is_not_at_the_end_of_a_run_that_goes_on(engine: str) -> None:
    """Two agents on straight lines that part at t = 2 of 4; the last frame is at t = 1."""
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    early, entire = (
        Evidence(fk.simulate(fk.Scenario(law, start, t_end=4.0, frames=times), engine=engine, progress=False))
        for times in ([0.0, 0.5, 1.0], [0.0, 2.0, 4.0])
    )
    names = ("velocity_spread", "speed_spread", "order", "speed", "diameter", "convergence_time", "converged")
    assert measured(early, *names) == [None] * len(names)
    assert measured(early, "flocks", "connected_at_end") == ([2, False] if engine == "exact" else [None, None])
    assert measured(entire, "speed", "diameter", "flocks") == [1.0, pytest.approx(5.0), 2]
