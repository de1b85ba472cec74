"""Words a shell may hand to the command line: an exit code and a sentence, never a traceback."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st

from flocking.apps.cli import command_line, main
from flocking.engine.storage.stored_runs import write_run
from tests.engine.storage.stored_runs import finished
from tests.fuzz.formulas import FORMULAS
from tests.fuzz.guard import files_below, fuzz, guarded

QUICK = """
t_end = 0.2
frames = 3
graph = {kind = "hysteresis", radius = 4, gap = 0.1}
terms = [{kind = "gradient", formula = "1/r + 1/(R - r)", parameters = {R = 4}}, {kind = "consensus"}]
start = {q = [[0, 0], [1, 0]]}
"""
SWEEP = """
scenario = "zhou-2015"
seeds = 2
measures = ["connected"]
[options]
duration = 0.1
"""
COMMANDS = [
    "run",
    "resume",
    "info",
    "diff",
    "export",
    "export-c",
    "plot",
    "animate",
    "audit",
    "certify",
    "cache",
    "check",
    "equations",
    "list",
    "schema",
    "showcase",
    "sweep",
]
WORDS = st.sampled_from(
    [
        "quick.toml",
        "saved",
        "saved/position",
        "bad.toml",
        "sweep.toml",
        "swept",
        "absent",
        ".",
        "/dev/null",
        "",
        "-",
        "--",
        "zhou",
        "-1",
        "nan",
        "inf",
        "1e400",
        "999999999999999999999",
        "\ud800",
        "a\nb",
        "$(x)",
        "*",
        "../saved",
        "shi-2009-",
        "--help",
        "-h",
        "--version",
    ]
)
OPTIONS = st.sampled_from(
    [
        "--out",
        "--seed",
        "--engine",
        "--json",
        "--kind",
        "--time",
        "--to",
        "--tolerance",
        "-p",
        "--radius",
        "--definition",
        "--fps",
        "--seconds",
        "--theme",
        "--most-agents",
        "--most-runs",
        "--level",
        "--sweep",
        "--nonsense",
        "--seed=",
        "--follow",
    ]
)
VALUES = st.sampled_from(
    [
        "out",
        "out.gif",
        "out.png",
        "0",
        "-1",
        "3",
        "nan",
        "tiles",
        "exact",
        "energy",
        "net",
        "csv",
        "gsd",
        "R=4",
        "R=nan",
        "=",
        "light",
        "1e9",
        "x",
    ]
)


@fuzz("commands")
def test_commands(data: Any, folder: Path) -> None:
    room = folder / "room"
    if not room.exists():
        room.mkdir()
        write_run(finished(), room / "saved")
        (room / "quick.toml").write_text(QUICK)
        (room / "bad.toml").write_text("t_end = [[[")
        (room / "sweep.toml").write_text(SWEEP)
    words = [data.draw(st.sampled_from([*COMMANDS, *COMMANDS, *COMMANDS, "", "ru", "reproduce"]))]
    words += data.draw(st.lists(WORDS | WORDS | FORMULAS, max_size=2))
    for _ in range(data.draw(st.integers(0, 2))):
        words += [data.draw(OPTIONS), *([data.draw(VALUES)] if data.draw(st.booleans()) else [])]
    if words[0] in ("reproduce", "equations"):  # these compute for minutes when all is well
        words.append("no-such-paper")
    if words[0] == "sweep":  # processes of its own take a second to start
        words += ["--workers", "1"]
    before = files_below(folder)
    with pytest.MonkeyPatch.context() as patch, guarded("commands"):
        patch.chdir(room)
        try:
            code = main(words)
        except SystemExit as end:
            code = end.code
        assert code in (0, 1, 2, None)
    new = files_below(folder) - before
    allowed = ("room/out", "room/quick", "room/saved", "room/bad", "room/x", "room/0", "room/3", "room/-1")
    assert all(name.startswith(allowed) or name.split("/")[1] in words for name in new), (words, new)


def test_every_command_is_fuzzed() -> None:
    names = {name for name in command_line() if not name.startswith("-")}
    # These compute for minutes when all is well, or start processes; tests of their own give them wrong input.
    apart = {"reproduce", "lab", "dashboard", "margins", "nodes"}
    assert set(COMMANDS) <= names
    assert names - set(COMMANDS) <= apart
