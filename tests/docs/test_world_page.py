"""What the page of the world says of the engines is what the engines say."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.registry import engine_named
from flocking.errors import InvalidInput
from flocking.model.parts.description import GROUPS

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "world.md").read_text()
ENGINES = ("exact", "sampled", "delayed", "discrete", "tiles", "lammps")
PSI = fk.Potential("(r - 2)**2")
LAW = fk.Law(fk.Proximity(2.0), [fk.Gradient(PSI), fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [1.5, 0.0], [0.0, 1.5]], [[0.0, 0.1], [0.1, 0.0], [0.1, 0.0]])
FLIGHT = fk.State(*(np.pad(x, ((0, 0), (0, 1))) for x in (START.q, START.p)))
ROWS = re.findall(r"^\| `(.+)` " + r"\| (yes|no) " * len(ENGINES) + r"\|$", PAGE, re.MULTILINE)


def scenario(part, engine):
    """A scenario with one part of the page, in a world that the engine needs."""
    names = {"fk": fk, "psi": PSI}
    if part.startswith("fk.Law"):
        law, world = eval(part, names), {}
    else:
        world = eval(f"dict({part})", names)
        law = world.pop("law", LAW)
    discrete = isinstance(world.get("bodies"), fk.DiscreteBody)
    told = isinstance(world.get("information"), fk.Messages)
    if engine in ("sampled", "discrete") or discrete or (engine in ("tiles", "lammps") and told):
        world = {"control": fk.Held(0.1)} | world
    if engine == "discrete" and "bodies" not in world:
        world = {"bodies": fk.Impulsive()} | world
    if engine == "delayed":
        world = {"information": fk.Delayed(0.1)} | world
    start = FLIGHT if "Quadrotor" in part else START
    return fk.Scenario(law, start, t_end=1.0, **world)


def test_rows_are_found():
    lines = [line for line in PAGE.splitlines() if re.match(r"\| `(fk\.Law|\w+=)", line)]
    assert len(ROWS) == len(lines) > 30


@pytest.mark.parametrize("row", ROWS, ids=[part for part, *_ in ROWS])
def test_a_row_says_what_the_engines_say(row):
    part, *said = row
    for engine, word in zip(ENGINES, said, strict=True):
        try:
            why = engine_named(engine).why_not(scenario(part, engine))
        except InvalidInput as error:
            why = str(error)
        assert (word == "yes") == (why == ""), (engine, why)


@pytest.mark.parametrize("group", ["control", "information", "loss", "noise"])
def test_every_part_has_a_row(group):
    shown = " ".join(part for part, *_ in ROWS).replace("loss=0.2", "fk.Bernoulli(0.2)")
    for kind in GROUPS[group].kinds:
        assert f"fk.{kind.builds.__name__}(" in shown


def test_messages_under_continuous_control_run_in_one_engine_and_delays_under_held_control_in_none():
    late = fk.Scenario(LAW, START, t_end=1.0, information=fk.Messages(0.1))
    assert [engine for engine in ENGINES if not engine_named(engine).why_not(late)] == ["delayed"]
    none = late.with_(information=fk.Delayed(0.1), control=fk.Held(0.1))
    reasons = [engine_named(engine).why_not(none) for engine in ENGINES if engine != "discrete"]
    assert all("No engine runs Delayed under held control" in why for why in reasons)
    assert "continuous time" in engine_named("discrete").why_not(none)


def test_late_samples_brake_a_flock_unless_they_are_moved_on(capsys):
    block = PAGE[PAGE.index("law = fk.Law(fk.Fixed.complete(2)") :].split("```")[0]
    exec(block, {"fk": fk})
    held, moved = map(float, capsys.readouterr().out.split())
    # Both agents move alike, each sees the other as it was five periods ago, or at the start.
    x, v, h = [0.0], [5.0], 0.02
    for k in range(500):
        old = max(k - 5, 0)
        u = (x[old] - x[k]) + (v[old] - v[k])
        x.append(x[k] + h * v[k] + h * h * u / 2)
        v.append(v[k] + h * u)
    assert held == round(v[-1], 2)
    assert abs(v[-1] / 5.0 - math.exp(-10.0 * 0.1 / 1.1)) < 0.005
    assert moved == 5.0


def test_late_neighbours_brake_a_flock_in_continuous_time(capsys):
    """The slowest mode of the page's equation carries the velocity; the others have gone within a delay or two."""
    first = PAGE[PAGE.index("law = fk.Law(fk.Fixed.complete(2)") :].split("for predict")[0]
    block = PAGE[PAGE.index("for late in (False, True)") :].split("```")[0]
    exec(first + block, {"fk": fk})
    braked, kept = map(float, capsys.readouterr().out.split())
    s = -0.0912872
    assert abs(s * s + (1 + s) * (1 - math.exp(-0.1 * s))) < 1e-7
    assert abs(braked / 5.0 - math.exp(10.0 * s)) < 0.005
    assert kept == 5.0
