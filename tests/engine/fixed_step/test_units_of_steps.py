"""Steps and times of engines with a fixed step do not depend on what is called 1."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import flocking as fk
from flocking.arrays import Array
from flocking.engine.fixed_step.step_counts import time_slack
from flocking.engine.kernels.pieces import limits
from flocking.engine.lammps.records import LammpsRecorder
from flocking.engine.tiles.session import TilesOptions, TilesSession


@dataclass(frozen=True, eq=False)
class Draggy(fk.Body):
    """dp/dt = u - c |p|^2 p: the drag grows with the square of the speed."""

    masses: float | Array = 1.0
    damping: float | Array = 0.0
    drag: float = 1.0
    order = 2
    parameters = property(lambda self: {"drag": self.drag})

    def __post_init__(self):
        self.check_fields()

    def rates(self, x):
        square = sum(v**2 for v in x.p)
        return {"p": [u - x.parameter("drag") * square * v for u, v in zip(x.u, x.p, strict=True)]}


def scenario(length: float = 1.0, time: float = 1.0, bodies: fk.Body | None = None) -> fk.Scenario:
    law = fk.Law(fk.Proximity(3.0 * length), [fk.Consensus(1.0 / time)])
    speed = length / time
    start = fk.State(np.array([[0.0, 0.0], [1.0, 0.0]]) * length, np.array([[1.0, 0.0], [0.0, 1.0]]) * speed)
    return fk.Scenario(law, start, t_end=time, frames=11, bodies=bodies or fk.PointMass())


@pytest.mark.parametrize("length", [2.0**-30, 2.0**30])
def test_the_step_that_a_body_needs_is_the_same_in_all_units_of_length(length):
    """At a drag of 40 the rate of change is 3 * 40."""
    steps = []
    for unit in (1.0, length):
        made = scenario(unit, bodies=Draggy(drag=40.0 / unit**2))
        steps.append(TilesSession(made, TilesOptions()).step)
    assert steps[0] < 0.01
    assert steps[1] == pytest.approx(steps[0], rel=1e-6)


@pytest.mark.parametrize("time", [1e-15, 1e-9, 1.0, 1e9])
def test_frames_are_due_at_their_times_in_all_units(time):
    made = scenario(time=time)
    recorder = LammpsRecorder(made, [0.0])
    for k in range(3):
        recorder.frame(0.1 * k * time, made.start.q, made.start.p, None)
    assert recorder.due(0.3 * time)
    assert not recorder.due(0.2999 * time)


@pytest.mark.parametrize("time", [1e-15, 1e-9, 1.0, 1e9])
def test_stored_times_lie_within_a_run_in_all_units(time):
    assert 1e-12 * time < time_slack(scenario(time=time)) < 1e-6 * time


@pytest.mark.parametrize("unit", [1e-12, 1e-6, 1.0, 1e6])
def test_a_formula_goes_on_beyond_the_edge_of_its_piece_in_all_units(unit):
    """sqrt(1 - (r/2)^2) has values until 2, twice as far as the piece that ends at 1."""

    def shape(distance, side, reach):
        return [float(np.sqrt(1.0 - (reach / (2.0 * unit)) ** 2))]

    assert limits([0.0, unit], shape)[1].tolist()[3] == np.inf
