"""A step whose polynomial alone meets a singularity is tried again, shorter: its error states nothing about that."""

from __future__ import annotations

import numpy as np
import pytest

from flocking.engine.adaptive_steps.integration_method import STAGES, tableau
from flocking.engine.adaptive_steps.stepper import Stepper, StepperMemory
from flocking.errors import StepTooSmall

LENGTH = 0.1


def stepper(singular):
    """A stepper of y' = -y, whose slope is no number where ``singular(t)`` holds, about to try a step of `LENGTH`."""

    def slope(t, y):
        return np.full_like(y, np.nan) if singular(t) else -y

    def stages(begin, end, last, t, y, h, K, nodes, weights):
        new = y
        for s in range(begin, end):
            state = y + h * weights[s, :s] @ K[:s]
            K[s] = slope(t + nodes[s] * h, state)
            new = state if s == last else new
        return new

    start = np.array([1.0, 2.0])
    return Stepper(slope, stages, np.full(2, 1e-3), StepperMemory(0.0, start, slope(0.0, start), LENGTH))


@pytest.mark.parametrize("stage", range(STAGES + 1, 16))
def test_a_stage_of_the_polynomial_that_is_no_number_makes_the_step_shorter(stage):
    at = tableau().nodes[stage] * LENGTH
    found = stepper(lambda t: abs(t - at) < 1e-12)
    segment = found.step(10.0)
    assert segment.t1 < LENGTH
    assert found.memory.t == segment.t1
    assert np.isfinite(segment.coefficients).all()
    for t in np.linspace(0.0, segment.t1, 9):
        assert np.abs(segment.at(t) - np.exp(-t) * np.array([1.0, 2.0])).max() < 1e-6
    # It goes on: the next step has other stages.
    following = found.step(10.0)
    assert following.t0 == segment.t1
    assert np.isfinite(following.coefficients).all()


def test_without_one_the_step_is_as_long_as_proposed():
    assert stepper(lambda t: False).step(10.0).t1 == LENGTH


def test_a_singularity_that_stays_ends_the_run():
    """All times after the start are singular for the stages of the polynomial, however short the step is."""
    found = stepper(lambda t: False)
    whole = found._stages

    def stages(begin, end, last, t, y, h, K, nodes, weights):
        new = whole(begin, end, last, t, y, h, K, nodes, weights)
        if begin > STAGES:
            K[end - 1] = np.nan
        return new

    found._stages = stages
    with pytest.raises(StepTooSmall, match="singularity"):
        found.step(10.0)
