"""Held control with messages beside continuous control: ten agents for 20 units of time, one process, processor time.

    python benchmarks/held_control.py

Two worlds: the law of Zhou et al., whose barrier late knowledge cannot keep, so that the ledger soon ends; and springs
with consensus, where the ledger is integrated all along. Runs of the two engines take turns; each time is the least of
five.
"""

from __future__ import annotations

import time

import flocking as fk
from flocking.papers.zhou_2015 import system

PERIODS = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Periods of control and of the messages."""

REPEATS = 5
"""Runs of each."""


def worlds() -> dict[str, fk.Scenario]:
    """The two scenarios under continuous control."""
    zhou = system.scenario(seed=0, duration=20.0).with_(frames=21)
    terms = (fk.Gradient(fk.Potential("k*(r - 2)**2/2", k=0.5)), fk.Consensus(0.5))
    return {"barrier": zhou, "springs": zhou.with_(law=fk.Law(fk.Proximity(4.0), terms), energy=fk.Energy())}


def seconds(scenario: fk.Scenario) -> float:
    """Processor time of one run."""
    begin = time.process_time()
    fk.simulate(scenario, progress=False)
    return time.process_time() - begin


def main() -> None:
    """Print a row for each world and period."""
    for name, ideal in worlds().items():
        for period in PERIODS:
            held = ideal.with_(control=fk.Held(period), information=fk.Messages(period))
            seconds(ideal), seconds(held)
            pairs = [(seconds(ideal), seconds(held)) for _ in range(REPEATS)]
            exact, sampled = (min(each) for each in zip(*pairs, strict=True))
            print(
                f"{name} period {period:g}: exact {exact * 1e3:.2f} ms, sampled {sampled * 1e3:.2f} ms, "
                f"ratio {exact / sampled:.2f}"
            )


if __name__ == "__main__":
    main()
