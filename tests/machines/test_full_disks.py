"""Disks of a few blocks: a command that finds no room says where, and what was committed before is there and whole."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import flocking as fk
from flocking.engine.storage.stored_runs import read_run
from tests.counting import count
from tests.engine.storage.stored_runs import assert_same, finished
from tests.machines.starting import BLOCK, Ended, Machines

LARGE = 2**26


def sizes(*few: int) -> pytest.MarkDecorator:
    """From 1 to 64 blocks, a few of them in the default tests."""
    rest = [pytest.param(k, marks=pytest.mark.repeated) for k in range(1, 65) if k not in few]
    return pytest.mark.parametrize("blocks", [*few, *rest])


@dataclass(frozen=True)
class Disk:
    """A disk with little room, or the next best thing.

    Parameters
    ----------
    machines
        Who starts commands on it.
    path
        Where it is.
    blocks
        Its free blocks.
    limited
        Whether it is a folder of an ordinary disk on which files of that size alone can be written: where the system
        allows nobody to mount anything.
    """

    machines: Machines
    path: Path
    blocks: int
    limited: bool

    def call(self, *words: object, **how: Any) -> Ended:
        """Run a command while the disk has little room."""
        count(f"odd machines: commands on {'files of limited size' if self.limited else 'full disks'}")
        limit = {"file_size": self.blocks * BLOCK} if self.limited else {}
        return self.machines.call(*words, **limit, **how)

    def prepare(self, source: Path) -> Path:
        """A copy of a folder on it, beside which it has its free blocks."""
        place = self.path / source.name
        if not self.limited:
            self.machines.ask("room", path=str(self.path), size=LARGE)
        self.machines.ask("copy", source=str(source), target=str(place))
        self.particles()
        return place

    def particles(self) -> None:
        """Leave it its free blocks."""
        if not self.limited:
            self.machines.ask("room", path=str(self.path), size=self.blocks * BLOCK)

    def clear(self) -> None:
        """Make room."""
        if not self.limited:
            self.machines.ask("room", path=str(self.path), size=LARGE)

    def tree(self) -> list[str]:
        """Everything on it."""
        return list(self.machines.ask("tree", path=str(self.path)))

    def keep(self, name: str, place: Path) -> Path:
        """A copy of a folder of it, where the tests can read it."""
        self.machines.ask("copy", source=str(self.path / name), target=str(place))
        return place


@contextmanager
def disk(machines: Machines, path: Path, blocks: int) -> Iterator[Disk]:
    """A disk of so many blocks."""
    path.mkdir(exist_ok=True)
    with ExitStack() as opened:
        limited = False
        try:
            opened.enter_context(machines.namespace())
            machines.ask("disk", path=str(path), size=blocks * BLOCK)
        except OSError:
            limited = True
        yield Disk(machines, path, blocks, limited)


@sizes(7, 30, 64)
def test_a_run(machines: Machines, file: Path, tmp_path: Path, blocks: int) -> None:
    with disk(machines, tmp_path / "disk", blocks) as full:
        folder = full.path / "run"
        ended = full.call("run", file, "--out", folder, "--json", commit=0.02).check(2, 0)
        names = full.tree()
        full.clear()
        if "run" not in names:
            said = ended.check(2).sentence(str(folder), "no space left", "Nothing was written")
            assert "resume" not in said, "there is nothing to go on with"
            assert names == []
            return
        if ended.code:
            ended.sentence(str(folder), "no space left", "flocking resume")
        assert_begins_and_goes_on(full, "run", tmp_path)


@sizes(1)
def test_going_on(machines: Machines, begun: Path, tmp_path: Path, blocks: int) -> None:
    with disk(machines, tmp_path / "disk", blocks) as full:
        folder = full.prepare(begun)
        ended = full.call("resume", folder, "--json", commit=0.02).check(2, 0)
        if ended.code:
            said = ended.sentence(str(folder), "no space left")
            assert "flocking resume" in said
        full.clear()
        assert_begins_and_goes_on(full, begun.name, tmp_path)


def assert_begins_and_goes_on(full: Disk, name: str, place: Path) -> None:
    """What is stored is the beginning of the whole run, and what is made of it is the whole."""
    stored, expected = read_run(full.keep(name, place / "stored")), finished()
    for table in ("t", "q", "p", "links", "switches", "trace"):
        part, all_of_it = getattr(stored, table), getattr(expected, table)
        assert part.tobytes() == all_of_it[: len(part)].tobytes(), table
    count("odd machines: stored runs that opened after a full disk and went on")
    assert_same(fk.resume(place / "stored", progress=False), expected)


@sizes(7)
def test_a_sweep(machines: Machines, sweep: Path, tmp_path: Path, blocks: int) -> None:
    with disk(machines, tmp_path / "disk", blocks) as full:
        words = ("sweep", sweep, "--workers", "1", "--out", full.path / "sweep", "--json")
        ended = full.call(*words).check(2, 0)
        if ended.code:
            said = ended.sentence(str(full.path / "sweep"), "no space left")
            assert "flocking resume" not in said, "a sweep is gone on with by the same command"
        full.clear()
        machines.call(*words).check(0)
        found = fk.read_sweep(full.keep("sweep", tmp_path / "stored") / "results")
        assert found.complete
        assert found.failures == []
        assert not [name for name in full.tree() if "partial" in name]


@sizes(1)
def test_a_picture(machines: Machines, whole: Path, tmp_path: Path, blocks: int) -> None:
    with disk(machines, tmp_path / "disk", blocks) as full:
        ended = full.call("plot", whole, "--out", full.path / "net.svg").check(2, 0)
        if ended.code:
            ended.sentence(str(full.path / "net"), "No space left" if not full.limited else "large")
            assert full.tree() == [], "no part of a picture stays"
        else:
            assert full.tree() == ["net.svg"]


PAPER = "tanner-2003-fixed"


@pytest.fixture(scope="module")
def reproduced(machines: Machines) -> tuple[str, ...]:
    """Words that reproduce a paper, whose runs are kept."""
    words = ("reproduce", PAPER, "--seeds", "1", "--workers", "1")
    assert machines.ask("remember", words=list(words)) == 1
    return words


@pytest.mark.repeated
@pytest.mark.parametrize("blocks", range(1, 65))
def test_a_reproduction(machines: Machines, reproduced: tuple[str, ...], tmp_path: Path, blocks: int) -> None:
    with disk(machines, tmp_path / "disk", blocks) as full:
        ended = full.call(*reproduced, "--out", full.path / "out").check(2, 1)
        if ended.code == 2:
            assert str(full.path / "out") in ended.sentence("No space left" if not full.limited else "large")
        for name in full.tree():
            assert "partial" not in name
        if ended.code == 2:
            assert "out/report.html" not in full.tree(), "no report of figures that are not there"
