"""Parts as plain data: what goes out comes back, shared parts stay shared, and nothing else gets in."""

from __future__ import annotations

import inspect
import json
import pkgutil
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import flocking as fk
import flocking.model
from flocking.errors import FlockingError, InvalidInput
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.smooth_cones import HeadingWeights, SmoothCone
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.graphs.views import Cone, FieldOfView
from flocking.model.graphs.weights import PairWeights
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle, Wall
from flocking.model.leaders_and_obstacles.polygons import ConvexPolygon
from flocking.model.parts.description import registered_names
from flocking.model.potentials.bumps import Bump
from flocking.model.serial import ForeignPart, from_data, to_data
from flocking.model.terms.avoidance import Avoid
from flocking.model.terms.pair_terms import Term
from flocking.model.terms.schedules import Schedule


def again(part: Any) -> Any:
    """Through JSON text and back."""
    return from_data(json.loads(json.dumps(to_data(part), allow_nan=False)))


PATH = fk.Path(["sin(w*t)", "1 + t"], [1.0, 2.0], 0.5, w=2.5)
PARTS: list[Any] = [
    fk.Agents(masses=[1.0, 0.1, 3.0], damping=0.1, headings=[0.0, 1.0, 2.0]),
    fk.Agents(order=1),
    Avoid(Ball([0.0, 1.0], 2.0), [1.0, 0.0], range=3.0, bump=Bump("mine", "1 - z*k0")),
    Ball(PATH, 0.1),
    fk.Compensate(),
    fk.Consensus([1.0, 0.1, 2.0], weights=np.array([[0.0, 1 / 3], [0.7, 0.0]]), weighted=True, functional=True),
    ConvexPolygon([[0.0, 0.0], [0.0, 1.0], [1.0, 0.3]], 0.2, PATH),
    fk.Energy("leader", PATH, 0.3, "J"),
    fk.Fixed(4, ((0, 1), (2, 1)), directed=True),
    fk.Complete(),
    Avoid(Ball([0.0, 1.0], 2.0), range=3.0, gamma_agents=False, sigma_norm=0.2, fading_damping=True),
    fk.Smooth(3.0, 0.5, sigma_norm=0.2),
    fk.CuckerSmale(0.5, 1 / 3, 2.0),
    fk.VelocityAverage([0.5, 1 / 3]),
    fk.SafetyFilter(1 / 3, 0.1, 0.02, distance=0.7, acceleration=[1 / 3, 2.0], form="continuous", gain=0.3),
    fk.Heading([0.1, 1 / 3], noise=0.2, noise_kind="vectorial", update="forward", seed=7),
    fk.Impulsive([0.1, 1 / 3], 0.2, force=3.0, update="forward"),
    fk.Impulsive(update="shuffled", seed=3),
    fk.VelocityUnit([0.1, 1 / 3], acceleration=6.0, speed=1 / 3, fixed=True, diffusion=0.2, substeps=7, seed=5),
    fk.Fixes(0.2, delay=1.0, range=100.0, diffusion=1 / 3, damping=0.1, stiffness=0.01, seed=2),
    fk.Separation(12.0, 5.0, -0.707, 1.5, "mean", 1 / 3, 7.0),
    fk.Alignment(8.0, 7.5, 0.7, 1.5, "sum", "velocities", False),
    fk.Cohesion(8.0, 9.0, -0.15, 1.5, "mean"),
    fk.TurnBack(50.0, 1 / 3),
    fk.SelfPropulsion(1 / 3),
    fk.LinearRepulsion(0.4, 25.6668, 6.19664),
    fk.BrakingAlignment(0.023802, 0.5, 1 / 3, 2.5, 0.4, 100.0),
    fk.ShillWalls(230.0, 1 / 3, 2.5, 0.4, 0.1),
    fk.ShillDisc([0.1, 1 / 3], 2.0, 6.5, 2.5, 0.4),
    fk.Gradient(fk.Potential("a/r + 1e-17*r", a=0.1), "force", fk.Proximity(1 / 3, closed=True)),
    fk.HashedWeights(0.1, 2, 7),
    fk.Hysteresis(4, 0.1),
    fk.MatrixWeights(np.random.default_rng(0).random((40, 40))),
    PATH,
    fk.Proximity(0.7),
    PerAgentRadii([1.0, 2.0, 0.1]),
    fk.Potential("where(r < R, 1/r + 1/(R - r), 0)", R=0.1 + 0.2),
    Schedule([1.0, 2.0], [[1.0, 2.0], [0.1, 0.3], [0.0, 0.0]]),
    fk.Sink([1.0, 1 / 3]),
    Smooth(1.3, 0.3, "quintic"),
    fk.State([[0.1, 0.2], [0.3, 0.4]], t=0.7, links=[[False, True], [False, False]]),
    fk.Track(PATH, Schedule([1.0], [0.0, 1.0]), [0.1, 0.0], 1.0, per_mass=True, shared=True, saturated=True),
    Cone([1.0, 2.0], 0.3, "wrapped"),
    SmoothCone(2.0, 0.5, 0.3, Bump("mine", "1 - z*k0"), "rotation"),
    HeadingWeights(0.3, 0.2, Bump("mine", "1 - z*k0"), "real"),
    FieldOfView(2.0, [0.1, 0.3]),
    fk.Velocity([1.0, 2.0], [3.0, 4.0], 5.0),
    Wall([0.1, 0.2], [1.0, 3.0], 7.0),
]


@pytest.mark.parametrize("part", PARTS, ids=lambda part: type(part).__name__)
def test_a_part_comes_back(part: Any) -> None:
    back = again(part)
    assert type(back) is type(part)
    assert to_data(back) == to_data(part), "every number to its last bit"
    if hasattr(part, "structure"):
        assert back.structure == part.structure
    assert fields_of(back) == fields_of(part)


def fields_of(value: Any) -> Any:
    """All that an object holds, arrays as bytes, seen without `to_data`."""
    if isinstance(value, np.ndarray):
        return (value.dtype.str, value.shape, value.tobytes())
    if isinstance(value, list | tuple):
        return [fields_of(x) for x in value]
    if type(value).__module__.startswith("flocking.model"):
        return [type(value).__name__, *((k, fields_of(v)) for k, v in sorted(vars(value).items()))]
    return str(value) if isinstance(value, float) else value


def _concrete(base: type) -> list[type]:
    for module in pkgutil.walk_packages(flocking.model.__path__, "flocking.model."):
        import_module(module.name)
    found, todo = [], [base]
    while todo:
        kind = todo.pop()
        todo += kind.__subclasses__()
        if not inspect.isabstract(kind) and kind.__module__.startswith("flocking.model."):
            found.append(kind)
    return found


@pytest.mark.parametrize("base", [Graph, Term, Leader, Obstacle, PairWeights], ids=lambda base: base.__name__)
def test_every_part_of_the_library_can_be_written(base: type) -> None:
    kinds = [k for k in _concrete(base) if hasattr(k, "__dataclass_fields__") or k.__name__ == "Path"]
    assert kinds
    for kind in kinds:
        assert registered_names()[kind.__name__].builds is kind, f"register {kind.__name__}"
        assert any(type(part) is kind for part in PARTS), f"add a {kind.__name__} to PARTS of this test"


def test_shared_parts_stay_shared() -> None:
    leader, other = fk.Velocity([1.0, 0.0]), fk.Proximity(2.0)
    ball = Ball(leader, 1.0)
    law = fk.Law(
        fk.Proximity(2.0),
        [fk.Consensus(1.0, over=other), fk.Consensus(0.5, over=other), fk.Track(leader), Avoid(ball, leader, range=2)],
    )
    scenario = fk.Scenario(law, fk.State(np.eye(2)), 1.0, energy=fk.Energy("leader", leader), frames=[0.1, 0.3])
    back = again(scenario)
    first, second, track, avoid = back.law.terms
    assert first.over is second.over
    assert back.law.graph is not first.over
    assert track.leader is avoid.leader is avoid.obstacles[0].centre is back.energy.leader
    assert len(back.law.graphs) == 2
    assert back.frames == scenario.frames
    both = again([scenario, law])
    assert both[0].law.terms[2].leader is both[1].terms[2].leader


@given(st.floats(allow_nan=False, allow_infinity=False, min_value=-1e300, max_value=1e300))
def test_numbers_keep_every_bit(x: float) -> None:
    assert np.float64(again(fk.Sink([x])).point[0]).tobytes() == np.float64(x).tobytes()
    assert again(fk.Velocity([0.0], start_time=x)).start_time == x


def test_large_arrays_keep_every_bit() -> None:
    state = fk.State(np.random.default_rng(1).normal(size=(700, 2)))
    assert "npy" in to_data(state)["q"]
    assert again(state).q.tobytes() == state.q.tobytes()


class Mine(fk.Hysteresis):
    """A part from outside."""


class Law(fk.Law):
    """A part from outside that takes a name of the library."""


@pytest.mark.parametrize("part", [Mine(2.0, 0.1), Law(fk.Proximity(2.0), [fk.Compensate()]), object(), print, 1j])
def test_foreign_parts_are_refused(part: Any) -> None:
    with pytest.raises(ForeignPart, match="part of this library or a registered one"):
        to_data([part])


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"part": "os.system", "command": "true"}, "must be one of"),
        ({"part": "Formula", "text": "r"}, "must be one of"),
        ({"part": ["Law"]}, "must be one of"),
        ({"part": "Hysteresis", "radius": 4.0}, "gap must be given"),
        ({"part": "Hysteresis", "radius": 4.0, "gap": 0.1, "__class__": 1}, "is not a field of Hysteresis"),
        ({"part": "Hysteresis", "radius": "4", "gap": 0.1}, "must be of type float"),
        ({"part": "Hysteresis", "radius": True, "gap": 0.1}, "must be of type float"),
        ({"part": "Hysteresis", "radius": 4.0, "gap": 5.0}, "must be smaller than the radius"),
        ({"part": "Proximity", "radius": 4.0, "closed": "no"}, "must be of type bool"),
        ({"part": "Potential", "formula": "__import__('os')", "parameters": {"values": {}}}, "Potential"),
        ({"part": "Potential", "formula": "a*r", "parameters": {"values": {"formula": 1.0}}}, "which has no value"),
        ({"part": "Potential", "formula": "a*r", "parameters": 3}, "must be named numbers"),
        ({"part": "Potential", "shape": "a*r"}, "is not a field of Potential"),
        ({"part": "Consensus", "gain": 1.0, "surprise": 1}, "is not a field of Consensus"),
        ({"part": "Law", "graph": 3, "terms": []}, "must be a graph"),
        ({"part": "Away", "from": "my_parts", "x": 1}, "Import my_parts first"),
        ({"part": "Sink", "point": {"npy": "gA=="}}, "must be a NumPy array"),
        ({"part": "Sink", "point": {"npy": 3}}, "must be a NumPy array"),
        ({"part": "Sink", "point": {"float": "1e5"}}, "must be a number, text"),
        ({"same": 0}, "must be the id of a part"),
        ({"same": [0]}, "must be the id of a part"),
        ({"part": "Compensate", "id": [1]}, "must be an integer"),
        ({"free": 1}, "must be a number, text"),
        ((1, 2), "must be plain data"),
    ],
)
def test_data_that_make_no_part(data: Any, said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        from_data(data)


def test_pickles_in_arrays_are_refused() -> None:
    import base64
    import io

    file = io.BytesIO()
    np.save(file, np.array([print], dtype=object), allow_pickle=True)
    with pytest.raises(InvalidInput, match="must be a NumPy array"):
        from_data({"npy": base64.b64encode(file.getvalue()).decode()})


def test_deep_data_are_refused() -> None:
    data: Any = 1.0
    for _ in range(10_000):
        data = [data]
    with pytest.raises(InvalidInput, match="nested deeper"):
        from_data(data)


_plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(["part", "same", "npy", "float", "values", "id", "q", "graph"]), inner)
    ),
    max_leaves=12,
)


@given(_plain, st.sampled_from(sorted(registered_names())))
def test_junk_never_breaks_the_reader(junk: Any, name: str) -> None:
    data = {**junk, "part": name} if isinstance(junk, dict) else {"part": name, "graph": junk, "q": junk, "point": junk}
    try:
        from_data(data)
    except FlockingError:
        return
    assert to_data(from_data(data)) is not None
