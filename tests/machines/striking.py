"""Commands that meet a signal at a drawn moment of their life, and what holds of every one of them.

A moment is so much processor time of the command and the processes that it started: it falls into the same part of the
work however busy the machine is. Most commands are forked from a process that has imported the library; every fifth
begins with Python itself.
"""

from __future__ import annotations

import json
import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.counting import count
from tests.machines.starting import Ended, Machines, Running

SOON = 2.0
"""Seconds of processor time that a command may go on after a signal."""

AT_THE_END = {False: 0.1, True: 0.5}
"""The same once its work is done and its exit code is settled; by whether it began with Python itself."""

GONE = 60.0
"""Seconds after which a process that a command left behind counts as one that stays, on a busy machine."""

PAST_THE_END = 1.05
"""Moments are drawn up to so many lives of a command that nobody interrupts: some come while it ends, or too late."""

PAST_THE_OPENING = 1.5
"""The same where a command never ends by itself: a third of the moments come while it waits."""

WAITING = 0.1
"""Up to so many seconds pass until the signal, where a command waits for it."""

GLANCE = 0.001

PROGRESS = re.compile(r"^.* \d+ s so far\n", re.MULTILINE)
"""What a command says after two seconds, on a busy machine: how far it is."""

KINDS = tuple((number, send) for number in (signal.SIGTERM, signal.SIGINT) for send in (os.kill, os.killpg))
"""What is sent, and how: to the command alone, or to its workers too, as a terminal and a batch system do."""

Seen = Callable[[], Any]


def moments(number: int = 200, default: int = 1) -> pytest.MarkDecorator:
    """So many drawn moments, a few of them in the default tests; each is a test of its own."""
    rest = [pytest.param(k, marks=pytest.mark.repeated) for k in range(default, number)]
    return pytest.mark.parametrize("moment", [*range(default), *rest])


@dataclass(frozen=True)
class LongCommand:
    """A command that is signalled.

    Parameters
    ----------
    machines
        What starts it.
    number
        The first number of the seed of its moments.
    words
        The words of the command line, for a folder that it may write in.
    ends
        Exit codes where nobody interrupts it.
    how
        How it is started, see `tests.machines.forks.begin`.
    named
        What it is counted as; the first word when absent.
    ready
        Puts into a folder what the command starts from.
    """

    machines: Machines
    number: int
    words: Callable[[Path], tuple[object, ...]]
    ends: tuple[int, ...] = (0,)
    how: dict[str, Any] = field(default_factory=dict)
    named: str = ""
    ready: Callable[[Path], object] = lambda _: None
    waits: str = ""
    """What it says before it waits for a signal and does nothing else; empty where it comes to an end by itself."""
    _lives: dict[bool, float] = field(default_factory=dict)

    def life(self, folder: Path, fresh: bool) -> float:
        """Seconds of processor time that it takes in an empty ``folder``, where nobody interrupts it.

        Parameters
        ----------
        fresh
            Whether it begins with Python itself.
        """
        if fresh not in self._lives:
            place = folder / "life"
            place.mkdir()
            self.ready(place)
            with self._started(place, fresh) as running:
                while self.waits and not self._waits(running):
                    assert not running.ended
                    time.sleep(GLANCE)
                if self.waits:
                    os.kill(running.process, signal.SIGTERM)
                self._lives[fresh] = running.end().check(*self.ends).seconds
        return self._lives[fresh]

    def struck(self, folder: Path, moment: int, seen: Seen = lambda: None) -> Struck:
        """Signal it at a drawn moment.

        Parameters
        ----------
        folder
            An empty folder.
        moment
            Number of the moment.
        seen
            Called just before the signal.
        """
        rng = np.random.default_rng((self.number, moment))
        fresh = moment % 5 == 4
        at = rng.uniform(0.0, (PAST_THE_OPENING if self.waits else PAST_THE_END) * self.life(folder, fresh))
        number, send = KINDS[int(rng.integers(len(KINDS)))]
        place = folder / "struck"
        place.mkdir()
        self.ready(place)
        with self._started(place, fresh) as running:
            while not running.ended and (running.processor_time() < at or not running.hears()):
                if self._waits(running):
                    time.sleep(rng.uniform(0.0, WAITING))
                    break
                time.sleep(GLANCE)
            before, used, met = seen(), running.processor_time(), not running.ended
            if met:
                send(running.process, number)
            ended = running.end()
        words = self.words(place)
        said = f"{words} {number.name} by {send.__name__} at {at:.4f} s, fresh: {fresh}: {ended}"
        ended.check(*((130, *self.ends) if met else self.ends))
        assert ended.code != 130 or ended.seconds - used < SOON, said
        early = "interrupted" in ended.err
        assert not early or ended.code == 130, said
        if not early:  # its work was done, and it has said so
            assert not met or self.waits or ended.seconds - used < AT_THE_END[fresh], f"it did not hear: {said}"
            self._lives[fresh] = min(ended.seconds, self._lives[fresh])
            assert PROGRESS.sub("", ended.err) == "", said
            assert "--json" not in words or json.loads(ended.out), said
        name = self.named or words[0]
        count(f"odd machines: signals to {name}, " + ("ended early" if early else "at its end"))
        return Struck(ended, early, before)

    def _waits(self, running: Running) -> bool:
        return bool(self.waits) and self.waits in running.said()

    @contextmanager
    def _started(self, folder: Path, fresh: bool) -> Iterator[Running]:
        """The command running; once it has ended, nothing of it may be left but what it was asked for."""
        scratch = folder.with_name(f"{folder.name}-scratch")
        scratch.mkdir()
        how = {"environment": {"TMPDIR": str(scratch)}, **self.how, "fresh": fresh}
        # What others left there may bear the same number: systems use the numbers of processes again.
        there = set(os.listdir("/dev/shm"))
        running = self.machines.begin(*self.words(folder), **how)
        try:
            yield running
        except BaseException:
            with suppress(ProcessLookupError):
                os.killpg(running.process, signal.SIGKILL)
            raise
        begin = time.monotonic()
        while left := running.left():
            assert time.monotonic() - begin < GONE, f"{self.words(folder)} left processes: {left}"
            time.sleep(GLANCE)
        assert list(scratch.iterdir()) == [], "it left temporary files"
        new = set(os.listdir("/dev/shm")) - there
        shared = [name for name in new if f"-{running.process}-" in name.replace("_", "-")]
        assert shared == [], f"it left shared memory: {shared}"
        half = [path for path in folder.rglob("*") if "partial" in path.name]
        assert half == [], f"{self.words(folder)} left half-written files: {running.err.read_text()}"


@dataclass(frozen=True)
class Struck:
    """What came of a signal.

    Parameters
    ----------
    ended
        How the command ended.
    early
        Whether the signal ended it.
    before
        What there was just before the signal.
    """

    ended: Ended
    early: bool
    before: Any
