"""States of one scenario are evaluated together as they are one by one, and the law is taken apart once."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.kernels.layout import Layout
from flocking.engine.reference import control
from flocking.study.trajectory import run_from_samples

GAINS = {"always the same": 0.5, "changed amid the run": fk.Schedule([0.25, 0.45], [0.5, 2.0, 0.1])}


def scenario(gain: float | fk.Schedule = 0.5) -> fk.Scenario:
    law = fk.Law(
        fk.Proximity(2.0),
        [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(0.5), fk.Track(fk.Velocity([1.0, 0.5]), gain)],
    )
    return fk.Scenario(law, fk.start.box(5, side=2.0, speed=1.0, seed=3), t_end=0.6, frames=7)


@pytest.mark.parametrize("gain", GAINS)
def test_together_they_have_the_bits_of_one_by_one(gain: str) -> None:
    made = scenario(GAINS[gain])
    run = fk.simulate(made, progress=False)
    states = [fk.State(q, p, float(t)) for q, p, t in zip(run.q, run.p, run.t, strict=True)]
    # Links that are given, as those of a graph with memory, are not looked for again.
    states += [fk.State(run.q[0], run.p[0], 0.0, np.zeros((5, 5), dtype=bool))]
    assert control.evaluate(made.law, states[0]).storage > control.evaluate(made.law, states[-1]).storage == 0.0
    for state, found in zip(states, control.evaluate_each(made, states), strict=True):
        alone = control.evaluate(made.law, state)
        assert found.u.tobytes() == alone.u.tobytes()
        assert (found.storage, found.kinetic, found.dissipation) == (alone.storage, alone.kinetic, alone.dissipation)


def test_a_run_from_samples_takes_its_law_apart_once(monkeypatch: pytest.MonkeyPatch) -> None:
    made, count = scenario(), [0]
    run = fk.simulate(made, progress=False)

    def counted(*parts: object, **more: object) -> Layout:
        count[0] += 1
        return Layout(*parts, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(control, "Layout", counted)
    found = run_from_samples(made, run.t, run.q, run.p)
    assert count == [1]
    assert np.isfinite(found.trace["energy"]).all()
