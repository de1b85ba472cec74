"""Which engine "auto" chooses, and whose words say why none runs a scenario."""

from __future__ import annotations

import re

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.registry import chosen_engine, engine_named
from flocking.engine.lammps.checks import check_supported
from flocking.errors import FlockingError, InvalidInput, UnsupportedLaw

LAW = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])


def scenario(n: int = 4, law: fk.Law = LAW, **parts: object) -> fk.Scenario:
    q = np.stack([3.0 * np.arange(n), np.zeros(n)], axis=1)
    return fk.Scenario(law, fk.State(q, np.zeros((n, 2))), t_end=1.0, **parts)


@pytest.mark.parametrize(
    ("made", "name"),
    [
        (scenario(), "exact"),
        (scenario(3000), "tiles"),
        (scenario(3000, fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0, functional=True)])), "exact"),
        (scenario(3000, fk.Law(fk.SmoothCone(2.0, 0.3, 2.0), [fk.Consensus(1.0)])), "tiles"),
        (scenario(3000, fk.Law(fk.FieldOfView(2.0, 2.0), [fk.Consensus(1.0)])), "tiles"),
        (scenario(control=fk.Held(0.1)), "sampled"),
        (scenario(control=fk.Held(0.1), information=fk.Messages(0.1)), "sampled"),
        (scenario(3000, control=fk.Held(0.1)), "tiles"),
        (scenario(information=fk.Delayed(0.1)), "delayed"),
        (scenario(information=fk.Messages(0.1)), "delayed"),
        (scenario(information=fk.Delayed(0.0)), "exact"),
        (scenario(control=fk.Held(0.1), agents=fk.Impulsive()), "discrete"),
        (scenario(3000, control=fk.Held(0.1), agents=fk.Impulsive()), "discrete"),
    ],
)
def test_the_world_and_the_size_of_a_scenario_choose(made: fk.Scenario, name: str) -> None:
    assert chosen_engine(made, "auto") == name


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (
            scenario(control=fk.Held(0.1), information=fk.Delayed(0.1)),
            r"engine='exact' does not run .* No engine runs Delayed under held control: give information=Messages",
        ),
        (
            scenario(3, fk.Law(fk.FieldOfView(2.0, 2.0), [fk.Consensus(1.0)]), information=fk.Messages(0.1)),
            "FieldOfView: headings must be given for each of the 3 agents",
        ),
        (
            scenario(3000, control=fk.Held(0.1), information=fk.Messages(0.1, loss=0.3)),
            "Messages: expires must be given",
        ),
        (scenario(3000, information=fk.Messages(0.1)), r"tiled engine .* continuous control; use control=Held"),
        (scenario(3000, information=fk.Delayed(0.1)), "'delayed' for 3000"),
        (
            scenario(control=fk.Held(0.1), agents=fk.Impulsive(), information=fk.Messages(0.1)),
            "engine='discrete' does not run information=Messages",
        ),
        (
            scenario(3001, fk.Law(fk.Complete(), [fk.Consensus(1.0)]), control=fk.Held(0.1), agents=fk.Impulsive()),
            "another one for more than 3000 agents of Complete",
        ),
        (
            scenario(20001, fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0, functional=True)])),
            "must be another one for more than 20000 agents.*'tiles' does not, and states what it cannot run",
        ),
        (
            scenario(20001, fk.Law(fk.FieldOfView(2.0, 2.0), [fk.Consensus(1.0)])),
            "FieldOfView: headings must be given for each of the 20001 agents",
        ),
    ],
)
def test_where_no_engine_runs_it_the_right_one_says_why(made: fk.Scenario, said: str) -> None:
    with pytest.raises(FlockingError, match=said):
        fk.start(made)


WORLDS = [
    {},
    {"control": fk.Held(0.1)},
    {"information": fk.Delayed(0.1)},
    {"information": fk.Messages(0.1)},
    {"control": fk.Held(0.1), "information": fk.Messages(0.1)},
    {"control": fk.Held(0.1), "information": fk.Delayed(0.1)},
]
BODIES = [
    fk.PointMass(),
    fk.Limited(fk.PointMass(), speed=1.0),
    fk.Lagged(fk.Limited(fk.PointMass(), force=1.0), 0.2),
    fk.Limited(fk.Lagged(fk.PointMass(), 0.2), rate=2.0),
    fk.Mixture((fk.PointMass(), fk.Unicycle(0.1)), [0, 0, 1, 1]),
]
LAWS = [
    LAW,
    fk.Law(fk.FieldOfView(2.0, 2.0), [fk.Consensus(1.0)]),
    fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0, functional=True)]),
]


def refused_by(engine: str, made: fk.Scenario) -> str:
    """Why an engine does not run a scenario; pair styles of LAMMPS have checks of their own."""
    if engine != "pair styles":
        return engine_named(engine).why_not(made)
    try:
        check_supported(made)
    except UnsupportedLaw as error:
        return str(error)
    return ""


@pytest.mark.parametrize("world", WORLDS, ids=lambda world: " ".join(type(x).__name__ for x in world.values()))
@pytest.mark.parametrize("engine", ["exact", "sampled", "tiles", "delayed", "lammps", "pair styles"])
def test_an_engine_that_a_refusal_names_as_the_way_out_runs_the_scenario(engine: str, world: dict) -> None:
    """What a refusal says after "use" is tried, as a reader would."""
    for bodies in BODIES:
        for law in LAWS:
            made = scenario(law=law, bodies=bodies, **world)
            said = refused_by(engine, made)
            others = [x for part in re.findall(r"[Uu]se engine=([^,.]+)", said) for x in re.findall(r"'(\w+)'", part)]
            assert all(not refused_by(other, made) for other in others if other != "auto"), said
            assert "another engine" not in said.lower(), said


@pytest.mark.parametrize(
    ("word", "option", "engines"),
    [
        ("stepp", "step", ["tiles", "lammps"]),
        ("thread", "threads", ["tiles", "discrete", "lammps"]),
        ("kepp_frames", "keep_frames", ["tiles", "lammps"]),
        ("keep_logs", "keep_log", ["lammps"]),
    ],
)
def test_the_nearest_of_an_unknown_option_is_searched_in_all_engines(
    word: str, option: str, engines: list[str]
) -> None:
    owners = " and ".join(f"engine='{name}'" for name in engines)
    for run in (fk.simulate, fk.start):
        with pytest.raises(InvalidInput) as caught:
            run(scenario(), **{word: 1})  # type: ignore[operator]
        said = str(caught.value)
        assert said.startswith(f"start: {word} is not known to engine='exact'; got 1. Did you mean {option}, ")
        assert said.endswith(f"an option of {owners}? Known: engine, fine, plant, progress, save.")
    with pytest.raises(
        InvalidInput, match=rf"to engine='{engines[0]}'; got 1\. Did you mean {option}\? Known: engine, "
    ):
        fk.simulate(scenario(), engine=engines[0], **{word: 1})  # type: ignore[arg-type]


def test_nothing_is_suggested_where_nothing_is_near() -> None:
    with pytest.raises(InvalidInput, match=r"got 1\. Did you mean progress\? Known: "):
        fk.simulate(scenario(), progres=1)
    with pytest.raises(InvalidInput, match=r"got 1\. Known: "):
        fk.simulate(scenario(), zzz=1)
