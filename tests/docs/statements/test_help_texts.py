"""What the command line says of itself: every parameter has words, and statements about all commands are so."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest

import flocking as fk
from flocking.apps.cli import command_line
from flocking.engine.driver.registry import BUILT_IN

APP = command_line()
COMMANDS = sorted(name for name in APP if not name.startswith("-"))
README = (Path(__file__).resolve().parents[3] / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_parameter_of_a_command_has_words(command):
    for argument in APP[command].assemble_argument_collection(parse_docstring=True):
        assert argument.parameter.help, (command, argument.names)


def test_the_commands_without_json_are_those_that_the_readme_names():
    without = {
        command
        for command in COMMANDS
        if "--json" not in {name for each in APP[command].assemble_argument_collection() for name in each.names}
    }
    (sentence,) = re.findall(r"All commands but ((?:`[a-z-]+`(?:, | and )?)+) have `--json`", README.replace("\n", " "))
    assert set(re.findall(r"`([a-z-]+)`", sentence)) == without


@pytest.mark.parametrize("function", [fk.simulate, type(fk.start).__call__, "run"])
def test_the_engines_to_choose_from_are_named_where_one_is_chosen(function):
    if function == "run":
        (said,) = [a.parameter.help for a in APP["run"].assemble_argument_collection(parse_docstring=True)
                   if a.names[0] == "--engine"]  # fmt: skip
    else:
        from flocking.engine.driver import simulate

        said = inspect.getdoc(simulate.start if function is not fk.simulate else function)
    for name in BUILT_IN:
        assert re.search(rf"\b{name}\b", said), name
