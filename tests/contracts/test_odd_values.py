"""Constructors take a value or refuse it in words: no kind of value ends in an error of Python."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.errors import FlockingError, InvalidInput

LAW = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
START = fk.State([[0.0, 0.0], [1.0, 0.0]])
POINT = fk.PointMass()
LEADER = fk.Velocity([1.0, 0.0])

MADE: dict[str, dict[str, Any]] = {
    "Avoid": {"obstacles": [fk.Ball([3.0, 0.0], 1.0)], "leader": LEADER, "range": 2.0},
    "Ball": {"centre": [0.0, 0.0], "radius": 1.0},
    "Bernoulli": {"probability": 0.1},
    "Consensus": {"gain": 1.0},
    "CuckerSmale": {"gain": 1.0, "exponent": 0.5},
    "Cone": {"radius": 1.0, "opening": 1.0},
    "Delayed": {"tau": 0.1},
    "Disturbed": {"body": POINT, "sigma": 1.0, "period": 0.1},
    "DistanceLoss": {"range": 1.0},
    "Energy": {},
    "FieldOfView": {"radius": 1.0, "half_angle": 1.0},
    "Fixed": {"n": 3, "edges": [(0, 1)]},
    "Fixes": {"period": 0.1},
    "GilbertElliott": {"to_bad": 0.1, "to_good": 0.2},
    "Gradient": {"potential": fk.Potential("r")},
    "HashedWeights": {"low": 0.0, "high": 1.0, "seed": 1},
    "Heading": {"speed": 1.0},
    "Held": {"period": 0.1},
    "Hysteresis": {"radius": 1.0, "gap": 0.1},
    "Lagged": {"body": POINT, "time_constant": 0.1},
    "Limited": {"body": POINT, "force": 1.0, "speed": 1.0},
    "Law": {"graph": LAW.graph, "terms": LAW.terms},
    "Messages": {"period": 0.1},
    "Mixture": {"bodies": [POINT, fk.Unicycle(0.1)], "kinds": [0, 1]},
    "Path": {"velocity": ["t", "0"]},
    "PerAgentRadii": {"radii": [1.0, 1.0]},
    "Periodic": {"lengths": [1.0, 1.0]},
    "PointMass": {},
    "Potential": {"formula": "r"},
    "Proximity": {"radius": 1.0},
    "Quadrotor": {},
    "SafetyFilter": {"period": 0.1, "distance": 1.0, "acceleration": 1.0},
    "Schedule": {"times": [1.0], "values": [1.0, 2.0]},
    "Sample": {"method": "random", "count": 3, "ranges": {"a": (0.0, 1.0)}, "log": (), "seed": 1},
    "Scenario": {"law": LAW, "start": START, "t_end": 1.0},
    "SingleIntegrator": {},
    "Sink": {"point": [0.0, 0.0]},
    "Smooth": {"radius": 2.0, "onset": 0.5},
    "State": {"q": [[0.0, 0.0]]},
    "Track": {"leader": LEADER},
    "Unicycle": {"offset": 0.1},
    "Velocity": {"value": [1.0, 0.0]},
    "VelocityUnit": {"time_constant": 1.0},
    "Wall": {"point": [0.0, 0.0], "normal": [1.0, 0.0]},
    "WhiteNoise": {},
    "start.box": {"n": 3, "side": 1.0, "seed": 1},
}
"""Arguments of parts; each of them, and each field of the part, gets every odd value."""

ODD = [
    None,
    True,
    "x",
    [],
    (),
    {},
    [[]],
    ["a"],
    float("nan"),
    float("inf"),
    np.timedelta64(1, "s"),
    1 + 2j,
    10**400,
    object(),
    b"x",
    np.array(1.0),
    np.array(None),
    np.array(["a"]),
    Fraction(1, 3),
    np.ma.masked,
    np.datetime64("2026-01-01"),
    POINT,
]


def fields_of(made: Any) -> list[str]:
    return [name for name, field in getattr(made, "__dataclass_fields__", {}).items() if field.init and name[0] != "_"]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", MADE)
def test_an_odd_value_is_taken_or_refused_in_words(name):
    made: Any = fk.start.box if name == "start.box" else getattr(fk, name)
    made(**MADE[name])
    for parameter in dict.fromkeys([*MADE[name], *fields_of(made)]):
        for value in ODD:
            try:
                summary = getattr(made(**{**MADE[name], parameter: value}), "summary", "")
            except FlockingError:
                continue
            assert isinstance(summary, str | type(None)), (parameter, value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: fk.Lagged(POINT, []),
        lambda: fk.Limited(POINT, force=[]),
        lambda: fk.Consensus([]),
        lambda: fk.PointMass([]),
        lambda: fk.Messages(0.1, seed=np.timedelta64(1, "s")),
        lambda: fk.start.box(np.timedelta64(3, "s"), side=1.0, seed=0),
    ],
)
def test_no_numbers_and_durations_are_refused(make):
    with pytest.raises(InvalidInput, match=r"must be (a number, or one for each agent|an integer)"):
        make()


@pytest.mark.parametrize(
    "make",
    [
        lambda: fk.Potential("formula*r", formula=2.0),
        lambda: fk.Path(["velocity*t"], velocity=2.0),
        lambda: fk.Potential("k*r", k=1.0).with_parameters(formula=1.0),
        lambda: fk.Held(0.1, period=0.2),
    ],
)
def test_what_is_given_twice_is_refused(make):
    with pytest.raises(InvalidInput, match="must be given once"):
        make()
