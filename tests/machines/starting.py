"""Commands of the library started on odd machines, and what every one of them must keep to."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
BLOCK = 4096
TICKS = os.sysconf("SC_CLK_TCK")

LONGEST = 600.0
"""Seconds after which a command counts as one that never ends, on a busy machine."""

DOCUMENTED = (0, 1, 2, 130)
"""Exit codes that the command line promises."""

FAULTS = (
    "Traceback",
    "Exception ignored",
    "Error in atexit",
    "leaked",
    "Segmentation",
    "Fatal Python error",
    "Terminating",
    "LLVM ERROR",
)
"""What no command says, whatever the machine does to it."""


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    Parameters
    ----------
    code
        Exit code; negative for a signal.
    out, err
        What it said.
    seconds
        Processor time it took.
    """

    code: int
    out: str
    err: str
    seconds: float = 0.0

    def check(self, *codes: int) -> Ended:
        """One of the codes, and no word that only somebody who writes the library can read."""
        for fault in FAULTS:
            assert fault not in self.out + self.err, self.err[-3000:]
        assert self.code in (codes or DOCUMENTED), (self.code, self.out[-1000:], self.err[-1000:])
        return self

    def sentence(self, *parts: str) -> str:
        """The one sentence it ended with, which holds the parts."""
        lines = [line for line in self.err.splitlines() if line.startswith("flocking: ")]
        # Where machine code is kept is said before.
        lines = lines[lines[0].startswith("flocking: your cache folder cannot be used") :]
        assert len(lines) == 1, self.err
        assert re.search(r"[.?!]$", lines[0]), self.err
        for part in parts:
            assert part in lines[0], (part, self.err)
        assert "file: " not in lines[0].removeprefix("flocking: ")[:6], "it names no path"
        return lines[0]


class Machines:
    """The process that forks commands, see `tests.machines.forks`.

    Parameters
    ----------
    place
        Folder for what commands say.
    """

    def __init__(self, place: Path) -> None:
        self.place = place
        self._number = 0
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.machines.forks"], cwd=ROOT, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        self._answer()

    def close(self) -> None:
        """End it."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def ask(self, order: str, **arguments: Any) -> Any:
        """Give an order and wait for the answer."""
        self._send(order, arguments)
        return self._answer()

    def _send(self, order: str, arguments: Mapping[str, Any]) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps([order, dict(arguments)]) + "\n")
        self._process.stdin.flush()

    def _answer(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line, "the process that starts commands has died"
        found = json.loads(line)
        if found["error"]:
            raise OSError(found["error"])
        return found["value"]

    @contextmanager
    def namespace(self) -> Iterator[None]:
        """Within it nobody else sees what is mounted.

        Raises
        ------
        OSError
            When the system allows no namespaces.
        """
        self._send("enter", {})
        try:
            self._answer()
        except OSError:
            self._answer()
            raise
        try:
            yield
        finally:
            self._send("leave", {})
            self._answer()

    def begin(self, *words: object, **how: Any) -> Running:
        """Start a command; ``how`` may have all that `tests.machines.forks.begin` takes."""
        self._number += 1
        out, err = (self.place / f"{self._number}.{name}" for name in ("out", "err"))
        process = self.ask(
            "begin", words=[str(word) for word in words], out=str(out), err=str(err),
            **{"folder": str(self.place), "environment": {}, **how},
        )  # fmt: skip
        return Running(self, process, out, err)

    def call(self, *words: object, **how: Any) -> Ended:
        """Run a command to its end."""
        return self.begin(*words, **how).end()


@dataclass(frozen=True)
class Running:
    """A command that runs.

    Parameters
    ----------
    machines
        Who started it.
    process
        Its id, also that of its group.
    out, err
        Files that hold what it says.
    """

    machines: Machines
    process: int
    out: Path
    err: Path

    @property
    def ended(self) -> bool:
        """Whether it has ended."""
        return _about(self.process)[0] == "Z"

    def said(self) -> str:
        """What it has said so far."""
        return _text(self.out)

    def hears(self) -> bool:
        """Whether it has come so far that it catches SIGTERM."""
        caught = re.search(r"^SigCgt:\s*(\w+)", Path(f"/proc/{self.process}/status").read_text(), re.MULTILINE)
        return caught is not None and bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)

    def processor_time(self) -> float:
        """Seconds of processor time that it has taken so far, and all processes that it started."""
        waited_for = sum(map(int, _about(self.process)[13:15])) / TICKS
        return waited_for + math.fsum(map(processor_time_of, self.left()))

    def left(self) -> list[int]:
        """Its own process and those that it started, where they have not ended."""
        found = []
        for name in os.listdir("/proc"):
            if name.isdigit() and int(name) >= self.process:
                with suppress(OSError):  # it has ended
                    about = _about(int(name))
                    if int(about[3]) == self.process and about[0] != "Z":
                        found.append(int(name))
        return found

    def end(self) -> Ended:
        """Wait for its end."""
        begin = time.monotonic()
        while not self.ended:
            if time.monotonic() - begin > LONGEST:
                os.killpg(self.process, signal.SIGKILL)
                self.machines.ask("end", process=self.process)
                raise AssertionError(f"it did not end: {_text(self.out)}{_text(self.err)}")
            time.sleep(0.005)
        code, seconds = self.machines.ask("end", process=self.process)
        return Ended(code, _text(self.out), _text(self.err), seconds)


def processor_time_of(process: int) -> float:
    """Seconds of processor time of one process; 0 where it has ended."""
    try:
        return time.clock_gettime(~process << 3 | 2)  # Linux' number of the clock of a process
    except OSError:
        return 0.0


def _about(process: int) -> list[str]:
    """Fields of the line of a process in /proc, from its state on."""
    return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()


def _text(path: Path) -> str:
    return path.read_bytes().decode() if path.exists() else ""
