"""Strange places: a user without a home, nothing writable, old locales and terminals, closed streams."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import pytest

import flocking as fk
from flocking.formula.cache import cache_folder
from tests.counting import count
from tests.engine.storage.stored_runs import scenario
from tests.machines.starting import Ended, Machines

NOBODY = 65534
UNSET = dict.fromkeys(("FLOCKING_CACHE", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "MPLCONFIGDIR", "PYTHONPYCACHEPREFIX"))
HOMELESS: dict[str, str | None] = {**UNSET, "HOME": "/nonexistent"}
OLD: dict[str, str | None] = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONIOENCODING": None, "PYTHONCOERCECLOCALE": "0"}
NARROW: dict[str, str | None] = {"COLUMNS": "40", "TERM": "dumb", "NO_COLOR": "1"}

MARGINS = (
    "--vary", "loss", "--levels", "loss=0,0.5", "--width", "0.99", "--period", "0.1", "--t-end", "0.2", "--seeds", "1",
    "--workers", "1",
)  # fmt: skip

HOW = pytest.mark.parametrize("fresh", [False, pytest.param(True, marks=pytest.mark.repeated)])


@pytest.fixture(scope="module")
def commons(whole: Path, samples: Path, logged: Path) -> Iterator[Path]:
    """A folder that everybody may read, with a scenario, runs and a folder they may write."""
    with tempfile.TemporaryDirectory(prefix="flocking-commons-") as made:
        place = Path(made)
        fk.write_scenario(scenario(0.2), place / "ten.toml")
        shutil.copytree(whole, place / "whole")
        shutil.copytree(logged, place / "logged")
        shutil.copyfile(samples, place / "samples.csv")
        (place / "mine").mkdir()
        place.chmod(0o755)
        if os.getuid() == 0:
            os.chown(place / "mine", NOBODY, NOBODY)
        yield place


@pytest.fixture(scope="module")
def filled(commons: Path) -> Path:
    """A cache of theirs in the folder, with all generated code: for runs that find it by its name alone."""
    cache = commons / "cache"
    shutil.copytree(cache_folder(), cache, ignore=lambda _, names: [n for n in names if ".tmp" in n])
    if os.getuid() == 0:
        for path in (cache, *cache.rglob("*")):
            os.chown(path, NOBODY, NOBODY)
    return cache


def short(place: Path, writable: Path | None, *, every: bool) -> Iterator[tuple[object, ...]]:
    """Short commands.

    Parameters
    ----------
    writable
        Where they may write.
    every
        All of them, those that compute for some seconds too.
    """
    yield ("list",)
    yield ("info", place / "whole")
    yield ("check", "1/r + 1/(R - r)", "-p", "R=4")
    yield ("cache",)
    yield ("audit", place / "whole")
    out = () if writable is None else ("--out", writable / "run")
    yield ("run", place / "ten.toml", *out)
    yield ("plot", place / "whole", "--out", (writable or place) / "net.svg")
    yield ("certify", place / "ten.toml")
    yield ("export", place / "whole", "--to", "npz", "--out", (writable or place) / "run.npz")
    yield ("audit", place / "samples.csv", "--law", place / "ten.toml")
    yield ("audit", place / "logged", "--replay")
    if every:
        yield ("margins", place / "ten.toml", *MARGINS, *(() if writable is None else ("--out", writable / "margins")))
        yield ("list", "--json")
        yield ("equations", "tanner-2003-fixed")
        yield ("certify", place / "ten.toml", "--hypotheses")
        for to in ("gsd", "xyz", "csv", "parquet"):
            yield ("export", place / "whole", "--to", to, "--out", (writable or place) / f"run.{to}")
        yield ("export-c", place / "ten.toml", "--out", (writable or place) / "law")
        yield ("cache", "--json")
        yield (
            "reproduce",
            "tanner-2003-fixed",
            "--seeds",
            "1",
            *(() if writable is None else ("--out", writable / "out")),
        )


def judge(ended: Ended, words: tuple[object, ...], kind: str, *, encoding: str = "utf-8") -> None:
    """Nothing but an exit code that is promised; where it is bad input, a sentence; every line readable."""
    count(f"odd machines: {kind}")
    ended.check(0, 2, *((1,) if words[0] in ("reproduce", "audit") else ()))
    if ended.code == 2:
        ended.sentence()
    said = ended.out + ended.err
    said.encode(encoding)
    assert "\ufffd" not in said
    assert "??" not in said
    assert not re.search(r"\\u[0-9a-f]{4}|\\x[0-9a-f]{2}", said), said


@HOW
def test_a_user_without_a_home(machines: Machines, commons: Path, fresh: bool, request: pytest.FixtureRequest) -> None:
    # Thousands of files: copied where they are read.
    found = {"FLOCKING_CACHE": str(request.getfixturevalue("filled"))} if fresh else {}
    with ExitStack() as opened:
        stranger: dict[str, Any] = {}
        if os.getuid() == 0:
            with suppress(OSError):
                opened.enter_context(machines.namespace())
                machines.ask("open_to_all")
                stranger = {"user": NOBODY}
        who = "nobody" if stranger else "a user"
        for words in short(commons, commons / "mine", every=fresh):
            if words[0] == "run" and not fresh:
                continue  # machine code has its place from the process that forks
            environment = {**HOMELESS, **found} if words[0] == "run" else HOMELESS
            ended = machines.call(*words, environment=environment, fresh=fresh, folder=str(commons), **stranger)
            judge(ended, words, f"commands of {who} without a home")
            assert ended.code != 2, ended.err
    for path in (commons / "mine").iterdir():
        shutil.rmtree(path) if path.is_dir() else path.unlink()


@HOW
def test_nothing_can_be_written(machines: Machines, commons: Path, place: Path, fresh: bool) -> None:
    with ExitStack() as opened:
        try:
            opened.enter_context(machines.namespace())
        except OSError:
            count("odd machines: places that allow no namespaces, left out")
            return
        machines.ask("only_writable", path=str(place))
        for words in short(commons, None, every=fresh):
            environment = HOMELESS | {"TMPDIR": str(commons)}
            ended = machines.call(*words, fresh=fresh, environment=environment, folder=str(commons))
            judge(ended, words, "commands where nothing can be written")
            if words[0] in ("list", "info", "audit", "check", "certify"):
                # A motion may break a claim, which is what is audited.
                assert ended.code in ((0, 1) if words[0] == "audit" else (0,)), ended.err
            if words[0] in ("plot", "export", "export-c"):
                assert str(Path(str(words[-1])).with_suffix("")) in ended.check(2).sentence("Read-only")


@HOW
def test_an_old_locale(machines: Machines, commons: Path, tmp_path: Path, fresh: bool) -> None:
    for words in islice(short(commons, tmp_path, every=fresh), 0, None, 1 if fresh else 2):
        ended = machines.call(*words, environment=OLD, encoding="ascii", fresh=fresh)
        judge(ended, words, "commands in the locale C", encoding="ascii")
        assert ended.code != 2, ended.err


@HOW
def test_a_narrow_terminal(machines: Machines, commons: Path, tmp_path: Path, fresh: bool) -> None:
    for words in islice(short(commons, tmp_path, every=fresh), 0 if fresh else 1, None, 1 if fresh else 2):
        ended = machines.call(*words, environment=NARROW, columns=40, fresh=fresh)
        judge(ended, words, "commands on a dumb terminal of 40 columns")
        assert ended.code != 2, ended.out
        assert "\x1b" not in ended.out, ended.out
        assert ended.out.strip()


@pytest.mark.parametrize(
    "closed", [(0, 1, 2), *(pytest.param(x, marks=pytest.mark.repeated) for x in ((0,), (1,), (2,), (1, 2)))]
)
@HOW
def test_closed_streams(
    machines: Machines, commons: Path, tmp_path: Path, closed: tuple[int, ...], fresh: bool
) -> None:
    for words in short(commons, tmp_path, every=False):
        ended = machines.call(*words, closed=closed, fresh=fresh)
        judge(ended, words, "commands with closed streams")
        assert ended.code != 2, ended.err
        assert 1 not in closed or ended.out == ""
    assert (tmp_path / "run" / "zarr.json").exists()


@pytest.mark.parametrize("stream", [1, 2])
def test_a_stream_to_a_full_disk(commons: Path, stream: int) -> None:
    words = [sys.executable, "-m", "flocking", *(["cache"] if stream == 1 else ["info", str(commons / "nowhere")])]
    with open("/dev/full", "w") as full:
        streams = {
            "stdout": full if stream == 1 else subprocess.PIPE,
            "stderr": full if stream == 2 else subprocess.PIPE,
        }
        found = subprocess.run(words, text=True, check=False, **streams)
    count("odd machines: commands that speak to a full disk")
    assert found.returncode == 2
    if stream == 1:
        Ended(found.returncode, "", found.stderr).sentence("standard output: No space left")
    else:
        assert found.stdout == ""
