"""The end of a long run of the tests names the dearest files; a run that takes more than its tier may says so."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests import counting

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def _no_time_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the process of these tests has taken so far does not count."""
    monkeypatch.setattr(counting, "processor_seconds", lambda: 0.0)


class Terminal:
    """What pytest hands to its summary, as far as it is read."""

    def __init__(self, seconds: dict[str, float]) -> None:
        self.lines: list[str] = []
        reports = [report for name, each in seconds.items() for report in _reports(name, each)]
        self.stats = {"passed": reports[::2], "": reports[1::2], "warnings": [SimpleNamespace(nodeid="no report")]}
        self.config = Config("not slow")

    def section(self, name: str) -> None:
        self.lines.append(name)

    def write_line(self, line: str, **_: bool) -> None:
        self.lines.append(line)


class Config:
    """What pytest knows of the selection of a run."""

    def __init__(self, chosen: str) -> None:
        self.option = SimpleNamespace(markexpr=chosen)

    def getini(self, _: str) -> list[str]:
        return ["-q", "-m", "not slow"]


def _reports(name: str, seconds: float) -> Iterator[SimpleNamespace]:
    """Setup, call and teardown of one test of a file."""
    for when, part in (("setup", 0.25), ("call", 0.5), ("teardown", 0.25)):
        # The processor time of a test is with its teardown.
        properties = [(counting.PROCESSOR, 0.5 * seconds)] if when == "teardown" else []
        yield SimpleNamespace(nodeid=f"{name}::test", when=when, duration=part * seconds, user_properties=properties)


def test_a_long_run_names_its_dearest_files_in_order() -> None:
    terminal = Terminal({f"tests/test_{k}.py": float(k) for k in range(40)})
    counting.pytest_terminal_summary(terminal)
    found = [line.split() for line in terminal.lines[1 : 2 + counting.FILES_SHOWN]]
    assert [line[2] for line in found[:-1]] == [f"tests/test_{k}.py" for k in range(39, 39 - counting.FILES_SHOWN, -1)]
    assert found[0][:2] == ["19.5", "39.0"]
    assert found[-1][:4] == ["390.0", "780.0", "all", "40"]


@pytest.mark.parametrize("seconds", [0.0, 1.0])
def test_a_short_run_names_none(seconds: float) -> None:
    terminal = Terminal({"tests/test_one.py": seconds})
    counting.pytest_terminal_summary(terminal)
    assert terminal.lines == []


@pytest.mark.parametrize(("minutes", "over"), [(15.9, False), (16.1, True)])
def test_a_run_that_takes_more_than_its_tier_may_says_so(
    minutes: float, over: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The processor time of workers counts where there are some, else that of this process."""
    monkeypatch.setattr(counting, "_workers", [])
    for share in (0.25, 0.75):
        counting.pytest_testnodedown(SimpleNamespace(workeroutput={counting.PROCESSOR: share * 60.0 * minutes}))
    terminal = Terminal({"tests/test_one.py": 1.0})
    counting.pytest_terminal_summary(terminal)
    assert [f"{minutes:.1f} minutes of processor time are more than the 16" in x for x in terminal.lines[-1:]] == (
        [True] if over else []
    )


@pytest.mark.parametrize(
    ("chosen", "tier"),
    [("not slow", "default"), ("slow and not repeated and not mpi", "validate"), ("mpi", None), ("", None)],
)
def test_the_tier_of_a_run_is_found_by_its_selection(chosen: str, tier: str | None) -> None:
    assert counting.tier_of(Config(chosen)) == tier


def test_the_processor_time_of_a_test_is_measured(tmp_path: Path) -> None:
    """Also that of a process that a test starts."""
    busy = "import time\nbegin = time.process_time()\nwhile time.process_time() < begin + 0.3: pass\n"
    text = f"import subprocess, sys\n\ndef test_own():\n    exec({busy!r})\n\n"
    text += f"def test_started():\n    subprocess.run([sys.executable, '-c', {busy!r}], check=True)\n\n"
    text += "def test_idle():\n    import time\n    time.sleep(0.3)\n"
    (tmp_path / "test_three.py").write_text(text)
    (tmp_path / "conftest.py").write_text(
        "import json, pathlib\n"
        "from tests.counting import pytest_runtest_makereport, pytest_runtest_protocol\n\n"
        "def pytest_runtest_logreport(report):\n"
        "    if report.when == 'teardown':\n"
        "        name = report.nodeid.partition('::')[2]\n"
        "        pathlib.Path(__file__).with_name(name).write_text(json.dumps(dict(report.user_properties)))\n"
    )
    places = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider", "-c", "/dev/null"]
    subprocess.run([*command, str(tmp_path)], check=True, cwd=ROOT, env=os.environ | {"PYTHONPATH": places})
    own, started, idle = (
        json.loads((tmp_path / f"test_{name}").read_text())[counting.PROCESSOR] for name in ("own", "started", "idle")
    )
    assert own >= 0.3
    assert started >= 0.3
    assert idle < 0.2
