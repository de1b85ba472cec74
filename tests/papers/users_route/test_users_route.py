"""The standard laws by a user's route alone: a TOML file, or fifteen lines of Python, give the runs of the packages.

A program leaves its scenario in the name ``scenario``.
"""

from __future__ import annotations

import ast
import runpy
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import flocking as fk

FOLDER = Path(__file__).parent
LINES = 15
"""Lines of a program that are neither empty nor comments."""


def olfati_saber(number: int) -> fk.Scenario:
    system = fk.papers.olfati_saber_2006.system
    goal, obstacle = fk.Velocity([5.0, 0.0]), fk.Ball([8.0, 4.0], 2.0)
    algorithm = {
        1: system.Algorithm(1), 2: system.Algorithm(2, (1.0, 1.0, 0.05), goal=goal),
        3: system.Algorithm(3, obstacles=(obstacle,), goal=goal),
    }[number]  # fmt: skip
    start = fk.start.box(12, side=20.0, speed=1.0, seed=3)
    return fk.Scenario(system.law(algorithm), start, t_end=2.0, frames=5)


def cucker_smale(**world: object) -> fk.Scenario:
    law = fk.papers.cucker_smale_2007.system.law(0.3, 0.4)
    return fk.Scenario(law, fk.start.ball(9, radius=3.0, speed=3.0, seed=4), t_end=2.0, frames=5, **world)


def vicsek(noise: float, **settings: object) -> fk.Scenario:
    return fk.papers.vicsek_1995.system.group(100, 5.0, noise, seed=5, duration=20, **settings)


def vasarhelyi(*circles: tuple[float, float, float]) -> fk.Scenario:
    return fk.papers.vasarhelyi_2018.system.flock(seed=4, duration=4.0, circles=circles)


PACKAGED: dict[str, Callable[[], fk.Scenario]] = {
    "algorithm_1": lambda: olfati_saber(1),
    "algorithm_2": lambda: olfati_saber(2),
    "algorithm_3": lambda: olfati_saber(3),
    "alignment": cucker_smale,
    "alignment_delayed": lambda: cucker_smale(information=fk.Delayed(0.4)),
    "alignment_discrete": lambda: cucker_smale(agents=fk.Impulsive(), control=fk.Held(0.1)),
    "headings": lambda: vicsek(2.0),
    "headings_vectorial": lambda: vicsek(0.4, speed=0.5, noise_kind="vectorial", update="forward"),
    "boids": lambda: fk.papers.reynolds_1987.system.boids(seed=3, duration=2.0).with_(frames=3),
    "birds": lambda: fk.papers.reynolds_1987.system.birds(30, 20.0, 5.0, seed=4, updates=10),
    "drones": vasarhelyi,
    "drones_obstacle": lambda: vasarhelyi((10.0, -20.0, 30.0)),
}
"""Scenarios of the packages, by the name of the file and of the program."""

ROUNDED = {"algorithm_1", "algorithm_2", "algorithm_3", "drones", "drones_obstacle"}
"""Laws whose formulas or numbers round otherwise than those of the package, such as 35.6668 beside 25.6668 + 10."""


def program(name: str) -> fk.Scenario:
    return runpy.run_path(str(FOLDER / "programs" / f"{name}.py"))["scenario"]


def file(name: str) -> fk.Scenario:
    return fk.read_scenario(FOLDER / "files" / f"{name}.toml")


@cache
def packaged_run(name: str) -> fk.Run:
    return fk.simulate(PACKAGED[name](), progress=False)


def test_every_law_has_both_forms():
    for form in ("programs/*.py", "files/*.toml"):
        assert {path.stem for path in FOLDER.glob(form)} == set(PACKAGED)


@pytest.mark.parametrize("form", [program, file])
@pytest.mark.parametrize("name", PACKAGED)
def test_a_users_run_is_that_of_the_package(name, form):
    run, packaged = fk.simulate(form(name), progress=False), packaged_run(name)
    if name not in ROUNDED:
        assert fk.first_difference(run, packaged) is None
        return
    assert_allclose(run.q, packaged.q, atol=1e-7)
    assert_allclose(run.p, packaged.p, atol=1e-7)
    start = run.scenario.start
    assert_allclose(
        fk.control(run.scenario.law, start), fk.control(packaged.scenario.law, start), rtol=1e-9, atol=1e-10
    )


@pytest.mark.parametrize("name", PACKAGED)
def test_a_program_is_short_and_uses_public_names_alone(name):
    text = (FOLDER / "programs" / f"{name}.py").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    assert len(lines) <= LINES
    tree = ast.parse(text)
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    assert [ast.unparse(node) for node in imports] == ["import flocking as fk"]
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            assert not node.attr.startswith("_")
            if isinstance(node.value, ast.Name) and node.value.id == "fk":
                assert node.attr in fk.__all__
                assert node.attr != "papers"


def test_the_obstacle_of_the_third_algorithm_and_that_of_the_drones_act():
    for name in ("algorithm_3", "drones_obstacle"):
        law, start = program(name).law, program(name).start
        without = fk.Law(law.graph, law.terms[:-1])
        assert np.abs(fk.control(law, start) - fk.control(without, start)).max() > 0.1, name


def test_what_follows_from_the_parts_is_there_too():
    assert fk.audit(fk.simulate(file("algorithm_2"), progress=False))["ledger"].verdict == "holds"
    found = file("alignment")
    q, p = found.start.q, found.start.p
    offset = q[None] - q[:, None]
    weights = 0.3 / (1 + (offset**2).sum(axis=-1)) ** 0.4
    expected = np.einsum("ij,ijk->ik", weights, p[None] - p[:, None])
    assert_allclose(fk.control(found.law, found.start), expected, rtol=1e-12, atol=1e-13)
    assert fk.certify(found)["alignment_rate"].granted
