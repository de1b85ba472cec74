"""SIGTERM and SIGINT at drawn moments of commands that read a run or a formula: a file is whole or not there."""

from __future__ import annotations

import hashlib
import subprocess
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

from flocking.show.animate import ffmpeg
from tests.machines.starting import Machines
from tests.machines.striking import LongCommand, moments

Words = Callable[[Path], tuple[object, ...]]
FORMATS = ("gsd", "xyz", "npz", "csv")
PICTURES = 6


def digest(folder: Path) -> dict[str, str]:
    """What is in a folder."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture(scope="module")
def readers(machines: Machines, whole: Path, file: Path, samples: Path, logged: Path) -> dict[str, LongCommand]:
    """Commands that write nothing."""
    words: dict[str, Words] = {
        "info": lambda _: ("info", whole, "--json"),
        "diff": lambda _: ("diff", whole, whole, "--json"),
        "audit": lambda _: ("audit", whole, "--json"),
        "check": lambda _: ("check", "1/r + 1/(R - r)", "-p", "R=4", "--json"),
        "equations": lambda _: ("equations", "tanner-2003-fixed", "--json"),
        "certify": lambda _: ("certify", file, "--json"),
        "audit of samples": lambda _: ("audit", samples, "--law", file, "--json"),
        "audit --replay": lambda _: ("audit", logged, "--replay", "--json"),
    }
    return {name: LongCommand(machines, 40 + k, of, (0, 1), named=name) for k, (name, of) in enumerate(words.items())}


READERS = ["info", "diff", "audit", "check", "equations", "certify", "audit of samples", "audit --replay"]


@pytest.mark.parametrize("name", READERS)
@moments(default=0)
def test_what_is_read_stays_as_it_is(
    readers: dict[str, LongCommand], whole: Path, samples: Path, logged: Path, memory: Path, name: str, moment: int
) -> None:
    before = digest(whole), digest(logged), samples.read_bytes()
    readers[name].struck(memory, moment)
    assert (digest(whole), digest(logged), samples.read_bytes()) == before
    assert list((memory / "struck").iterdir()) == []


@pytest.fixture(scope="module")
def laws_in_c(machines: Machines, file: Path) -> LongCommand:
    """The export of a law as C."""
    return LongCommand(machines, 70, lambda at: ("export-c", file, "--out", at / "law"))


@pytest.fixture(scope="module")
def law_in_c(machines: Machines, laws_in_c: LongCommand, tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What nobody interrupts."""
    place = tmp_path_factory.mktemp("whole")
    machines.call(*laws_in_c.words(place)).check(0)
    return digest(place / "law")


@moments()
def test_a_law_in_c_is_whole_or_not_there(
    laws_in_c: LongCommand, law_in_c: dict[str, str], memory: Path, moment: int
) -> None:
    early = laws_in_c.struck(memory, moment).early
    found = digest(memory / "struck" / "law") if (memory / "struck" / "law").exists() else {}
    assert found == law_in_c or (early and found == {})


@pytest.fixture(scope="module")
def exports(machines: Machines, whole: Path) -> dict[str, LongCommand]:
    """Exports to every format."""
    return {
        to: LongCommand(
            machines, 50 + k, lambda at, to=to: ("export", whole, "--to", to, "--out", at / f"run.{to}")
        )
        for k, to in enumerate(FORMATS)
    }  # fmt: skip


@pytest.fixture(scope="module")
def exported(machines: Machines, exports: dict[str, LongCommand], place: Path) -> Path:
    """What nobody interrupts."""
    for command in exports.values():
        machines.call(*command.words(place)).check(0)
    return place


@moments(default=0)
def test_an_export_is_whole_or_not_there(
    exports: dict[str, LongCommand], exported: Path, memory: Path, moment: int
) -> None:
    name = FORMATS[moment // 5 % 4]
    early = exports[name].struck(memory, moment).early
    made, expected = memory / "struck" / f"run.{name}", exported / f"run.{name}"
    assert early or made.exists()
    if made.exists():
        if name == "npz":
            with np.load(made) as found, np.load(expected) as others:
                assert all(found[key].tobytes() == others[key].tobytes() for key in others)
        else:
            assert made.read_bytes() == expected.read_bytes()


@pytest.fixture(scope="module")
def plots(machines: Machines, whole: Path, file: Path) -> list[LongCommand]:
    """Two pictures, each of two formats, of a run and of its scenario."""
    return [
        LongCommand(
            machines, 60 + k,
            lambda at, of=of: ("plot", of, "-k", "net", "-k", "energy", "--out", at / "picture"),
        )
        for k, of in enumerate((whole, file))
    ]  # fmt: skip


@pytest.fixture(scope="module")
def plotted(machines: Machines, plots: list[LongCommand], place: Path) -> dict[str, str]:
    """What nobody interrupts."""
    folder = place / "plotted"
    folder.mkdir()
    machines.call(*plots[0].words(folder)).check(0)
    return digest(folder)


@moments(default=0)
def test_a_picture_is_whole_or_not_there(
    plots: list[LongCommand], plotted: dict[str, str], memory: Path, moment: int
) -> None:
    early = plots[moment % 2].struck(memory, moment).early
    found = digest(memory / "struck")
    assert found.items() <= plotted.items()
    assert early or found == plotted


@pytest.fixture(scope="module")
def animate(machines: Machines, whole: Path) -> LongCommand:
    """A film of few pictures."""
    seconds = PICTURES / 20
    return LongCommand(
        machines, 24, lambda at: ("animate", whole, "--out", at / "film.gif", "--seconds", seconds)
    )  # fmt: skip


@moments()
def test_a_film_is_whole_or_not_there(animate: LongCommand, memory: Path, moment: int) -> None:
    early = animate.struck(memory, moment).early
    film = memory / "struck" / "film.gif"
    assert early or film.exists()
    if film.exists():
        check_picture(film, PICTURES)


def check_picture(path: Path, *frames: int) -> None:
    """Every frame of a picture can be decoded, and there are so many, or so many."""
    with Image.open(path) as image:
        assert len([frame.load() for frame in ImageSequence.Iterator(image)]) in frames


REPRODUCE = ("reproduce", "tanner-2003-fixed", "--json")
FILM_SECONDS = 0.4
"""Four pictures; fifty where the command begins with Python itself."""


@pytest.fixture(scope="module")
def reproductions(machines: Machines) -> list[LongCommand]:
    """A reproduction with pictures, in one process; two without, in one process and by two workers.

    What the first one draws was computed before, where it does not begin with Python itself: the other ones compute.
    """
    alone, more = (*REPRODUCE, "--seeds", 1, "--workers", 1), (*REPRODUCE, "--seeds", 8, "--workers", 2)
    machines.ask("remember", words=[str(word) for word in alone])
    return [
        LongCommand(
            machines, 25, lambda at: (*alone, "--out", at / "out"), (0, 1), how={"film_seconds": FILM_SECONDS}
        ),
        LongCommand(machines, 27, lambda _: more, (0, 1)),
        LongCommand(machines, 29, lambda _: alone, (0, 1)),
    ]  # fmt: skip


@moments(default=0)
def test_a_reproduction_leaves_whole_files(
    machines: Machines, reproductions: list[LongCommand], memory: Path, moment: int
) -> None:
    # Of those that begin with Python itself few draw: they have no short film.
    kinds = {**dict.fromkeys((7, 17, 27, 37), 1), **dict.fromkeys((9, 14, 19, 24, 29, 34, 39), 2)}
    command = reproductions[kinds.get(moment % 40, 0)]
    struck = command.struck(memory, moment)
    out = memory / "struck" / "out"
    if command is reproductions[0]:
        check_files(out)
        assert struck.early or (out / "report.html").exists()
    if moment % 40 == 0:
        machines.call(*command.words(memory / "struck"), **command.how).check(0, 1)
        check_files(out)


def check_files(out: Path) -> None:
    """Every file that is there is whole, and the report comes last."""
    for path in out.rglob("*.*"):
        if path.suffix == ".json":
            assert path.read_bytes().endswith((b"}\n", b"]\n")), path
        elif path.suffix == ".html":
            assert path.read_text().rstrip().endswith("</html>"), path
            assert (out / "claims.json").exists()
        elif path.suffix == ".svg":
            ElementTree.parse(path)
        elif path.suffix == ".mp4":
            program = ffmpeg()
            assert program is not None
            found = subprocess.run(
                [program, "-v", "error", "-i", path, "-f", "null", "-"], capture_output=True, text=True
            )
            assert (found.returncode, found.stderr) == (0, ""), path
        else:
            check_picture(path, *((4, 50) if path.suffix == ".gif" else (1,)))
