"""Places and times that floating-point numbers do not resolve are refused in all units, others in none."""

from __future__ import annotations

import pytest

import flocking as fk
from flocking.errors import OutOfPrecision

UNITS = [(1.0, 1.0), (2.0**-30, 1.0), (2.0**30, 1.0), (1.0, 2.0**-30), (1.0, 2.0**30), (2.0**-30, 2.0**-30)]
"""Lengths and times that are called 1."""


def led(length: float, time: float, begin: float, place: float = 0.0) -> fk.Run:
    """Two agents that follow a leader on a line, from the time ``begin`` and at a ``place``, in given units."""
    leader = fk.Path(
        ["v*cos(w*t)", "0"], start=[place * length, 0.0], start_time=begin * time, v=length / time, w=1 / time
    )
    terms = [fk.Consensus(0.5 / time), fk.Track(leader, 1.0 / time**2, 1.0 / time)]
    q = [[place * length, 0.0], [(place + 1.0) * length, 0.5 * length]]
    start = fk.State(q, [[length / time, 0.0], [0.0, length / time]], begin * time)
    law = fk.Law(fk.Proximity(4.0 * length), terms)
    scenario = fk.Scenario(law, start, t_end=(begin + 2.0) * time, frames=3)
    return fk.simulate(scenario, engine="exact", progress=False)


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_times_that_are_resolved_are_in_all_units(length, time):
    assert led(length, time, 1e6).p.shape == (3, 2, 2)


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_times_that_are_not_resolved_are_in_no_unit(length, time):
    """At a time of 2e9 they are resolved to 4e-7, and at a speed of 1 and a tolerance of 1e-9 places need 1e-8."""
    with pytest.raises(OutOfPrecision, match="Times are resolved only to"):
        led(length, time, 2e9)


@pytest.mark.parametrize(("length", "time"), UNITS)
def test_places_that_are_not_resolved_are_in_no_unit(length, time):
    with pytest.raises(OutOfPrecision, match=r"Positions (near .* )?are resolved only to"):
        led(length, time, 0.0, 1e9)
