"""Hints on the command line name keys of files and flags, not Python; values that were given stay as they are."""

import re

import pytest

import flocking as fk
from flocking.apps.hint_words import in_files
from flocking.errors import UnsupportedLaw
from tests.apps.test_cli import call


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Use engine='exact'.", "Use --engine exact."),
        ("engine='sampled' needs control=Held(...): it", '--engine sampled needs control = {kind = "held"}: it'),
        ("use Limited(Lagged(...), rate=...).", 'use {kind = "limited", rate = ...}.'),
        ("Give it one: Potential(..., k=1.0). The", "Give it one: parameters = {k = 1.0}. The"),
        ("velocity, or gamma_agents=False.", "velocity, or gamma_agents = false."),
        ("Draw them with velocities='sphere', or", 'Draw them with velocities = "sphere", or'),
        ("information=Delayed(tau) with", 'information = {kind = "delayed", tau = ...} with'),
        ("a graph of its own, with over=.", "a graph of its own, with over."),
        ("answer: control=Held(period=0.05, latency=0.02).",
         'answer: control = {kind = "held", period = 0.05, latency = 0.02}.'),
        ("Give agents=Agents(headings=...).", 'Give agents = {kind = "agents", headings = ...}.'),
        ("give keep_frames=False (--no-frames) and observe=True (--observe).", "give --no-frames and --observe."),
        ("Save it with save=folder (--out FOLDER), or", "Save it with --out FOLDER, or"),
        ("closed must be True or False; got None.", "closed must be true or false; got None."),
        ("mean must be None where no mean is taken", "mean must be absent where no mean is taken"),
        # What was given is quoted as it is.
        ("k must hold; got Limited(k=1). Use engine='exact'.", "k must hold; got Limited(k=1). Use --engine exact."),
        ("nothing of Python (as here) = stays", "nothing of Python (as here) = stays"),
    ],
)  # fmt: skip
def test_python_becomes_keys_and_flags(text, said):
    assert in_files(text) == said


def test_a_potential_that_is_checked_by_itself_names_the_flag(capsys):
    code, _, said = call(capsys, "check", "1/r + 1/(R - r)")
    assert code == 2
    assert "-p R=1.0" in said
    assert "parameters" not in said


def test_a_file_with_a_parameter_without_value_is_answered_in_its_own_words(tmp_path, capsys):
    file = tmp_path / "a.toml"
    fk.write_scenario(
        fk.Scenario(
            fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("k*r**2", k=1.0))]), fk.start.box(3, side=1, seed=0),
            t_end=1.0,
        ),
        file,
    )  # fmt: skip
    file.write_text(re.sub(r"(?m)^(k = 1\.0|parameters = .*)$", "", file.read_text()).replace("[terms.parameters]", ""))
    code, _, said = call(capsys, "run", file)
    assert code == 2
    assert "Potential(" not in said
    assert "k = 1.0" in said


def test_an_engine_that_cannot_run_a_world_names_the_flag():
    scenario = fk.Scenario(
        fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)]), fk.start.box(3, side=1, seed=0), t_end=1.0,
        control=fk.Held(0.1),
    )  # fmt: skip
    with pytest.raises(UnsupportedLaw) as refused:
        fk.simulate(scenario, engine="exact", progress=False)
    message = in_files(str(refused.value))
    assert "--engine" in message
    assert not re.search(r"\w+=['A-Z]", message)
