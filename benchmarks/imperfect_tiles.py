"""Cost of the imperfect world in tiles: each option's time per step over that of the ideal step, in one process.

Both take the same steps of the same group; ideal and imperfect sessions take turns, and the smallest processor time of
each, of all threads together, counts, so that the load of the machine and its clock cancel as far as they can. Least
times leave out rebuilds of the lists where a turn has none; the ratio of the means over all turns has them.

    python benchmarks/imperfect_tiles.py [--agents 100000 1000000] [--rounds 3]
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import flocking as fk
from flocking.engine.protocol.session import Session
from flocking.engine.tiles.engine import ENGINE
from flocking.engine.tiles.options import TilesOptions

STEP = 0.01
"""Length of the steps: that of the speed measurements."""

SPACING = 7.0
"""Distance of neighbours at the start and at rest."""

BOTH = "ledger on both sides"
"""End of the name of a row whose ideal steps have a ledger as well."""

SPAN = 20
"""Steps of one turn: two periods of ten steps."""


def start_of(n: int) -> fk.State:
    """The hexagonal start of the speed measurements."""
    return fk.start.hexagonal(n, spacing=SPACING, noise=0.5, speed=1.0, seed=0)


def law() -> fk.Law:
    """The law (34) of Olfati-Saber (2006) as in the speed measurements."""
    formula = "(a + b)/2*(sqrt(1 + (r - d + c)**2) - sqrt(1 + c**2)) + (a - b)/2*(r - d)"
    psi = fk.Potential(formula, a=1, b=5, c=4 / np.sqrt(20), d=SPACING)
    return fk.Law(fk.Proximity(1.2 * SPACING), [fk.Gradient(psi), fk.Consensus(1.0)])


def messages(period: float, **more: object) -> fk.Messages:
    """Messages whose samples are used for three periods."""
    return fk.Messages(period, expires=3 * period, **more)


def worlds(period: float) -> dict[str, dict[str, object]]:
    """Options by name, with controls every ``period``."""
    held = {"control": fk.Held(period)}
    noise = fk.WhiteNoise(0.01, 0.01)
    return {
        "held": held,
        "limits": held | {"bodies": fk.Limited(fk.PointMass(), force=1.0)},
        "lag": held | {"bodies": fk.Lagged(fk.PointMass(), 0.2)},
        "gusts": held | {"bodies": fk.Disturbed(fk.PointMass(), 0.1, period)},
        "unicycles": held | {"bodies": fk.Unicycle(1.0)},
        "delay": held | {"information": fk.Messages(period, delay=0.5 * period)},
        "jitter": held | {"information": messages(period, jitter=0.5 * period)},
        "loss": held | {"information": messages(period, loss=0.2)},
        "bursts": held | {"information": messages(period, loss=fk.GilbertElliott(0.1, 0.4))},
        "distance loss": held | {"information": messages(period, loss=fk.DistanceLoss(3.0 * SPACING))},
        "noise": held | {"information": fk.Messages(period, noise=noise)},
        "correlated noise": held | {"information": fk.Messages(period, noise=fk.OrnsteinUhlenbeck(0.01, 0.01, 1.0))},
        "resolution": held | {"information": fk.Messages(period, resolution=0.01, velocity_resolution=0.01)},
        "all": held | {"bodies": fk.Limited(fk.PointMass(), force=1.0), "information": messages(
            period, delay=0.5 * period, jitter=0.5 * period, loss=0.2, noise=noise,
                                               resolution=0.01, velocity_resolution=0.01)},
    }  # fmt: skip


def per_step(session: Session) -> float:
    """Seconds of processor time a step, over one turn."""
    begin, steps = time.process_time(), session.steps
    session.advance(session.time + SPAN * STEP)
    return (time.process_time() - begin) / (session.steps - steps)


def ratio(
    n: int, world: dict[str, object], rounds: int, *, ledger_at: str | None, both: bool = False
) -> tuple[float, float, float]:
    """Time per step over that of the ideal step, least and mean over the turns, and the least ideal one.

    Parameters
    ----------
    n
        Number of agents.
    world
        Parts of the world.
    rounds
        Turns of each.
    ledger_at
        When the ledger is computed; None for no ledger on either side.
    both
        Whether the ideal steps have a ledger too.
    """
    start = start_of(n)
    ideal = ENGINE.open(
        fk.Scenario(law(), start, t_end=1e3, frames=2), TilesOptions(step=STEP, ledger=both, keep_frames=False)
    )
    options = TilesOptions(step=STEP, ledger=ledger_at is not None, ledger_at=ledger_at or "steps", keep_frames=False)
    other = ENGINE.open(fk.Scenario(law(), start, t_end=1e3, frames=2, **world), options)
    times = np.array([[per_step(ideal), per_step(other)] for _ in range(rounds + 1)])[1:]
    least = times.min(axis=0)
    mean = times.mean(axis=0)
    return float(least[1] / least[0]), float(mean[1] / mean[0]), float(least[0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", type=int, nargs="+", default=[100_000, 1_000_000])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="+", default=None)
    given = parser.parse_args()
    for n in given.agents:
        space = {"space": fk.Periodic([2.0 * SPACING * n**0.5, 2.0 * SPACING * n**0.5])}
        rows = [("periodic space", space, None, 1.5)]
        rows += [(name, world, None, 1.5) for name, world in worlds(10 * STEP).items() if name != "all"]
        rows += [("all, ledger at ticks", worlds(10 * STEP)["all"] | space, "ticks", 2.5)]
        each = "all, period of one step"
        rows += [(f"{each}, ledger at ticks", worlds(STEP)["all"] | space, "ticks", 6.0)]
        rows += [(f"{each}, no ledger", worlds(STEP)["all"] | space, None, 6.0)]
        rows += [(f"{each}, {BOTH}", worlds(STEP)["all"] | space, "ticks", 6.0)]
        for name, world, ledger_at, asked in rows:
            if given.only is None or name in given.only:
                both = name.endswith(BOTH)
                found, mean, ideal = ratio(n, world, given.rounds, ledger_at=ledger_at, both=both)
                more = f"asked: {asked}; means {mean:.2f}; ideal step {1e3 * ideal:.1f} ms"
                print(f"{n:>8} {name:<42} {found:6.2f}  ({more})", flush=True)


if __name__ == "__main__":
    main()
