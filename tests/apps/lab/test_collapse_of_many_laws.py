"""Laws that collapse, of two to three hundred agents: the lab's page says so, and Pause and Reset are obeyed."""

from __future__ import annotations

import time
from pathlib import Path

import pytest

import flocking as fk
from tests.apps.lab.tabs import wait

pytestmark = pytest.mark.server

SOON = 5.0
"""Seconds of processor time that pass at most until an order is obeyed; on a free machine a twentieth of one."""

ENOUGH = 5.0
"""Seconds of processor time, or simulated time, after which a run whose steps have not shrunk yet is paused, too."""

FORMULAS = {
    "a pole at a distance": ("-(1/r + 1/(4 - r))", fk.Hysteresis(4.0, 0.1), True),
    "a steep power": ("-r**40", fk.Proximity(4.0), False),
    "a pole at no distance": ("-50/r**2", None, False),
    "a logarithm": ("200*log(r)", None, False),
    "an exponential": ("-exp(3*r)", None, False),
}
"""Potentials whose forces pull without end, the graph where it is not complete, and whether velocities agree."""


def scenario(name: str, n: int) -> fk.Scenario:
    formula, graph, consensus = FORMULAS[name]
    terms = [fk.Gradient(fk.Potential(formula)), *([fk.Consensus(1.0)] if consensus else [])]
    law = fk.Law(graph or fk.Fixed.complete(n), terms)
    return fk.Scenario(law, fk.start.box(n, side=2.0 * n**0.5, speed=1, seed=1), t_end=40.0, name="collapse", seed=1)


@pytest.mark.parametrize("n", [2, *(pytest.param(n, marks=pytest.mark.slow) for n in (3, 10, 40)), 300])
@pytest.mark.parametrize("name", FORMULAS)
def test_pause_and_reset_are_obeyed_while_steps_shrink(name: str, n: int, tmp_path: Path) -> None:
    from flocking.apps.lab.page import Page
    from flocking.apps.lab.server import opened

    page = Page(opened(None), scenario(name, n), folder=tmp_path)
    try:
        page.clock.play()
        begin = time.process_time()
        wait(
            lambda begin=begin: (
                page.clock.frame.shrunk
                or page.clock.frame.failure
                # Where nothing collapses a frame takes little of a processor, and time runs.
                or max(time.process_time() - begin, page.clock.frame.time) > ENOUGH
            ),
            "steps shrink, or are slow",
        )
        begin = time.process_time()
        page.clock.pause()
        page.clock.do(lambda: None)
        assert time.process_time() - begin < SOON
        assert not page.clock.running
        before, begin = page.experiment, time.process_time()
        page.load(page.name, page.seed)
        assert time.process_time() - begin < SOON
        assert page.experiment is not before
        assert page.experiment.time == 0.0
        wait(lambda: page.clock.frame.time == 0.0 and not page.clock.frame.shrunk, "it stands at the start")
        page.clock.play()
        wait(lambda: page.clock.frame.time > 0.0 or page.clock.frame.failure, "it begins anew")
    finally:
        page.close()
