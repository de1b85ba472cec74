"""Small families of scenarios for the tests of sweeps: a run takes about a hundredth of a second."""

import os
import signal
import time
from pathlib import Path

import flocking as fk

ALIGN = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])


def make(speed=1.0, n=3, seed=0, t_end=0.2):
    """A few agents that align, for a moment."""
    start = fk.start.box(int(n), side=2.0, speed=speed, seed=seed)
    return fk.Scenario(ALIGN, start, t_end=t_end, frames=2, seed=seed)


def make_or_fail(speed, seed):
    """Fails for one speed."""
    if speed == 2.0:
        raise ValueError("no such speed")
    return make(speed, seed=seed)


def noting(folder):
    """A family that notes every run it makes in a folder, one file for each time."""
    place = str(folder)

    def made(speed, seed):
        Path(place, f"{speed}-{seed}-{os.getpid()}-{time.monotonic_ns()}").touch()
        return make(speed, seed=seed)

    return made


def harmful(folder):
    """A family one run of which kills its own worker each time, and one needs more memory than is available."""
    place = str(folder)

    def made(speed, seed):
        if (speed, seed) == (2.0, 1):
            with Path(place, "deaths").open("a") as file:
                file.write("x")
            os.kill(os.getpid(), signal.SIGKILL)
        if (speed, seed) == (1.0, 3):
            chunks = []
            while True:
                chunks.append(bytearray(2**26))
        return make(speed, seed=seed)

    return made


def slow(folder, seconds=0.1):
    """A family that says which process made a run, slowly."""
    place = str(folder)

    def made(speed, seed):
        Path(place, str(os.getpid())).touch()
        time.sleep(seconds)
        return make(speed, seed=seed)

    return made


def waiting(folder):
    """A family one run of which waits without end; it says in which process."""
    place = str(folder)

    def made(speed, seed):
        if seed == 1:
            half = Path(place, "half")
            half.write_text(str(os.getpid()))
            half.rename(Path(place, "waits"))
            time.sleep(86400)
        return make(speed, seed=seed)

    return made
