"""Processes of agents on odd machines: closed streams, an old locale, a narrow terminal, no room to write."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import pytest

import flocking as fk
from tests.counting import count
from tests.engine.nodes.worlds import scenario
from tests.machines.conftest import machines, place
from tests.machines.starting import Machines
from tests.machines.test_strangers import HOMELESS, NARROW, OLD, judge

__all__ = ["machines", "place"]

pytestmark = pytest.mark.nodes


@pytest.fixture(scope="module")
def words(place: Path) -> tuple[object, ...]:
    """Two agents for a moment."""
    return "nodes", fk.write_scenario(scenario(2, 0.2), place / "two.toml")


def test_an_old_locale_and_a_narrow_terminal(machines: Machines, words: tuple[object, ...]) -> None:
    ended = machines.call(*words, environment=OLD, encoding="ascii")
    judge(ended, words, "commands in the locale C", encoding="ascii")
    assert ended.code == 0, ended.err
    ended = machines.call(*words, environment=NARROW, columns=40)
    judge(ended, words, "commands on a dumb terminal of 40 columns")
    assert ended.code == 0, ended.out
    assert "\x1b" not in ended.out
    assert ended.out.strip()


@pytest.mark.parametrize("closed", [(0, 1, 2), (0,), (1,), (2,), (1, 2)])
def test_closed_streams(machines: Machines, words: tuple[object, ...], closed: tuple[int, ...], tmp_path: Path) -> None:
    ended = machines.call(*words, "--out", tmp_path / "run", closed=closed)
    judge(ended, words, "commands with closed streams")
    assert ended.code == 0, ended.err
    assert (tmp_path / "run" / "zarr.json").exists()


def test_without_a_home_and_where_nothing_can_be_written(
    machines: Machines, words: tuple[object, ...], place: Path
) -> None:
    ended = machines.call(*words, environment=HOMELESS)
    judge(ended, words, "commands of a user without a home")
    assert ended.code == 0, ended.err
    with ExitStack() as opened:
        try:
            opened.enter_context(machines.namespace())
        except OSError:
            count("odd machines: places that allow no namespaces, left out")
            return
        machines.ask("only_writable", path=str(place))
        ended = machines.call(*words, environment=HOMELESS | {"TMPDIR": "/nonexistent"})
        judge(ended, words, "commands where nothing can be written")
