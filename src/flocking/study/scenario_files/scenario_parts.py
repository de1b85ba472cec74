"""The parts a scenario file may name. A new part is one `Kind` in the table of its group."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from flocking.model import starts
from flocking.model.energy import FRAMES as ENERGY_FRAMES
from flocking.model.energy import Energy
from flocking.model.graphs.distance_graphs import Fixed, Hysteresis, Proximity
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.graphs.views import MEASURES, Cone, FieldOfView, SmoothCone
from flocking.model.graphs.weights import HashedWeights, MatrixWeights
from flocking.model.leaders_and_obstacles.leaders import Path, Sink, Velocity
from flocking.model.leaders_and_obstacles.obstacles import Ball, Wall
from flocking.model.leaders_and_obstacles.polygons import ConvexPolygon
from flocking.model.potentials.bumps import BUMPS, Bump
from flocking.model.potentials.potential import Potential
from flocking.model.state import Agents, State
from flocking.model.terms.avoidance import Avoid
from flocking.model.terms.body_terms import Compensate, Track
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.model.terms.schedules import Schedule
from flocking.study.scenario_files import scenario_values as values
from flocking.study.scenario_files.scenario_kinds import Context, Field, Group, Kind, Nested, Short, may, need
from flocking.study.scenario_files.scenario_values import RefusedError, Value

MOST_DENSE = 5000
"""Most agents for what needs a number for every pair."""
LARGEST_DIMENSION_SUM = 8
"""A start may have this many coordinates per agent at the largest number of agents."""


def _potential(given: dict[str, Any], _: Context) -> Potential:
    potential = Potential(given["formula"], **given.get("parameters", {}))
    # Deriving the slope here puts a formula that cannot be differentiated at its own place in the file.
    potential(0.0)
    return potential


def _formula_and_parameters(potential: Potential) -> dict[str, object]:
    return {"formula": potential.formula.text, "parameters": potential.parameters}


def _gradient(given: dict[str, Any], context: Context) -> Gradient:
    fields = {name: value for name, value in given.items() if name not in ("formula", "parameters")}
    return Gradient(_potential(given, context), **fields)


def _fixed(given: dict[str, Any], context: Context) -> Fixed:
    _check_dense(given["n"], "n", context)
    return Fixed(**given)


def _random_connected(given: dict[str, Any], context: Context) -> Fixed:
    _check_dense(given["n"], "n", context)
    return Fixed.random_connected(given["n"], given["probability"], given["seed"])


def _check_dense(n: int, at: str, context: Context) -> None:
    context.check_agents(n, at)
    if n > MOST_DENSE:
        raise RefusedError(f"must be at most {MOST_DENSE} agents here: every pair is looked at", at=(at,))


def _given_state(given: dict[str, Any], context: Context) -> State:
    n = len(given["q"])
    context.check_agents(n, "q")
    pairs = given.pop("links", None)
    state = State(**given)
    if pairs is None:
        return state
    _check_dense(n, "links", context)
    links = np.zeros((n, n), dtype=bool)
    for k, (i, j) in enumerate(pairs):
        if max(i, j) >= n or i == j:
            raise RefusedError(f"must join two different agents of 0..{n - 1}", at=("links", k))
        links[i, j] = True
    return replace(state, links=links)


def _drawn(draw: Callable[..., State]) -> Callable[[dict[str, Any], Context], State]:
    def build(given: dict[str, Any], context: Context) -> State:
        context.check_agents(given["n"], "n")
        side = given.get("side")
        axes = len(side) if isinstance(side, list) else given.get("dimension", 2)
        if given["n"] * axes > LARGEST_DIMENSION_SUM * context.most_agents:
            raise RefusedError(f"must be fewer axes for {given['n']} agents", at=("dimension",))
        t = given.pop("t", 0.0)
        if given.pop("connected", False):
            _check_dense(given["n"], "n", context)
            given["connected_under"] = context.law_graph
        return replace(draw(**given), t=t)

    return build


_CONNECTED = {"connected": may(values.TRUTH), "t": may(values.NUMBER)}
_VELOCITIES = may(values.choice("disc", "box"))
_GAIN = may(values.NUMBER_OR_NUMBERS)
_CHANGING = may(Nested("gain"))
_OVER = may(Nested("graph"))
_BUMP = may(Nested("bump"))
_MEASURE = may(values.choice(*MEASURES))

_LEADERS = (
    Kind("sink", Sink, {"point": need(values.NUMBERS)}),
    Kind("velocity", Velocity, {
        "value": need(values.NUMBERS), "start": may(values.NUMBERS), "start_time": may(values.NUMBER),
    }),
    Kind("path", Path, {
        "velocity": need(values.FORMULAS), "start": may(values.NUMBERS), "start_time": may(values.NUMBER),
        "parameters": may(values.NAMED_NUMBERS),
    }, build=lambda given, _: Path(given.pop("velocity"), **given.pop("parameters", {}), **given),
       take=lambda x: {"velocity": [f.text for f in x.formulas], "start": x.start,
                       "start_time": x.start_time, "parameters": x.values}),
)  # fmt: skip

GROUPS: dict[str, Group] = {
    "graph": Group(
        (
            Kind("fixed", Fixed, {
                "n": need(values.COUNT), "edges": need(values.PAIRS), "directed": may(values.TRUTH),
            }, build=_fixed),
            Kind("random_connected", Fixed.random_connected, {
                "n": need(values.COUNT), "probability": need(values.NUMBER), "seed": need(values.SEED),
            }, build=_random_connected),
            Kind("proximity", Proximity, {"radius": need(values.NUMBER), "closed": may(values.TRUTH)}),
            Kind("hysteresis", Hysteresis, {"radius": need(values.NUMBER), "gap": need(values.NUMBER)}),
            Kind("smooth", Smooth, {"radius": need(values.NUMBER), "onset": need(values.NUMBER), "bump": _BUMP}),
            Kind("per_agent_radii", PerAgentRadii, {"radii": need(values.NUMBERS), "closed": may(values.TRUTH)}),
            Kind("cone", Cone, {
                "radius": need(values.NUMBER_OR_NUMBERS), "opening": need(values.NUMBER_OR_NUMBERS),
                "measure": _MEASURE,
            }),
            Kind("smooth_cone", SmoothCone, {
                "radius": need(values.NUMBER), "onset": need(values.NUMBER), "opening": need(values.NUMBER),
                "bump": _BUMP, "measure": _MEASURE,
            }),
            Kind("field_of_view", FieldOfView, {
                "radius": need(values.NUMBER_OR_NUMBERS), "half_angle": need(values.NUMBER_OR_NUMBERS),
            }),
        ),
        names="graph",
    ),
    "leader": Group(_LEADERS, names="leader"),
    "place": Group(_LEADERS, names="leader", short=Short(values.NUMBERS, Sink, ())),
    "bump": Group(
        (
            Kind("bump", Bump, {"name": need(values.NAME), "formula": need(values.FORMULA)},
                 take=lambda x: {"name": x.name, "formula": x.formula.text}),
        ),
        default="bump",
        short=Short(values.choice(*BUMPS), str, (str,)),
    ),
    "gain": Group(
        (Kind("schedule", Schedule, {"times": need(values.NUMBERS), "values": need(values.VALUES)}),),
        default="schedule",
        short=Short(values.NUMBER_OR_NUMBERS, lambda gain: gain, (float, int, np.ndarray)),
    ),
    "potential": Group(
        (
            Kind("potential", Potential, {"formula": need(values.FORMULA), "parameters": may(values.NAMED_NUMBERS)},
                 build=_potential, take=_formula_and_parameters),
        ),
        key=None,
    ),
    "obstacle": Group(
        (
            Kind("ball", Ball, {"centre": need(Nested("place")), "radius": need(values.NUMBER)}),
            Kind("wall", Wall, {
                "point": need(Nested("place")), "normal": need(values.NUMBERS), "extent": may(values.NUMBER),
            }),
            Kind("polygon", ConvexPolygon, {
                "vertices": need(values.ROWS), "rounding": need(values.NUMBER), "motion": may(Nested("leader")),
            }),
        )
    ),
    "weights": Group(
        (
            Kind("hashed", HashedWeights, {
                "low": need(values.NUMBER), "high": need(values.NUMBER), "seed": need(values.SEED),
            }),
        ),
        default="hashed",
        short=Short(values.ROWS, MatrixWeights, (MatrixWeights,), lambda weights: weights.values),
    ),
    "term": Group(
        (
            Kind("gradient", Gradient, {
                "formula": need(values.FORMULA), "parameters": may(values.NAMED_NUMBERS),
                "weighting": may(values.choice("energy", "force")), "over": _OVER,
                "stored": may(values.choice("integral", "potential")),
            }, build=_gradient,
               take=lambda x: {**_formula_and_parameters(x.potential), "weighting": x.weighting, "over": x.over,
                               "stored": x.stored}),
            Kind("consensus", Consensus, {
                "gain": _GAIN, "weights": may(Nested("weights")), "weighted": may(values.TRUTH),
                "functional": may(values.TRUTH), "over": _OVER,
            }),
            Kind("track", Track, {
                "leader": need(Nested("leader")), "position_gain": _CHANGING, "velocity_gain": _CHANGING,
                "acceleration_gain": _CHANGING, "per_mass": may(values.TRUTH), "shared": may(values.TRUTH),
                "saturated": may(values.TRUTH),
            }),
            Kind("compensate", Compensate, {}),
            Kind("avoid", Avoid, {
                "obstacles": need(Nested("obstacle", many=True)), "leader": may(Nested("leader")),
                "range": need(values.NUMBER), "repulsion_gain": may(values.NUMBER),
                "damping_gain": may(values.NUMBER), "repulsion": may(Nested("potential")),
                "attraction": may(Nested("potential")), "offset": may(values.NUMBER), "onset": may(values.NUMBER),
                "bump": _BUMP, "gamma_agents": may(values.TRUTH),
            }),
        )
    ),
    "start": Group(
        (
            Kind("given", State, {
                "q": need(values.ROWS), "p": may(values.ROWS), "t": may(values.NUMBER), "links": may(values.PAIRS),
            }, build=_given_state,
               take=lambda x: {"t": x.t, "q": x.q, "p": x.p,
                               "links": None if x.links is None else np.argwhere(x.links)}),
            Kind("box", starts.box, {
                "n": need(values.COUNT), "side": need(values.NUMBER_OR_NUMBERS), "speed": may(values.NUMBER),
                "seed": need(values.SEED), "corner": may(values.NUMBERS), "dimension": may(values.DIMENSION),
                "velocities": _VELOCITIES, **_CONNECTED,
            }, build=_drawn(starts.box)),
            Kind("ball", starts.ball, {
                "n": need(values.COUNT), "radius": need(values.NUMBER), "speed": may(values.NUMBER),
                "seed": need(values.SEED), "dimension": may(values.DIMENSION), "velocities": _VELOCITIES,
                **_CONNECTED,
            }, build=_drawn(starts.ball)),
            Kind("hexagonal", starts.hexagonal, {
                "n": need(values.COUNT), "spacing": need(values.NUMBER), "noise": may(values.NUMBER),
                "speed": may(values.NUMBER), "seed": need(values.SEED), "t": may(values.NUMBER),
            }, build=_drawn(starts.hexagonal)),
        ),
        key="draw",
        default="given",
    ),
    "agents": Group(
        (
            Kind("agents", Agents, {
                "masses": _GAIN, "damping": _GAIN, "order": may(values.ORDER), "headings": may(values.HEADINGS),
            }),
        ),
        key=None,
    ),
    "energy": Group(
        (
            Kind("energy", Energy, {
                "frame": may(values.choice(*ENERGY_FRAMES)), "leader": may(Nested("leader")),
                "unlinked": may(values.NUMBER), "name": may(values.NAME),
            }),
        ),
        key=None,
    ),
}  # fmt: skip
"""Every group of parts by name."""

SCENARIO: dict[str, Field] = {
    "format": may(Value(lambda value: _format(value), {"const": 1})),
    "name": may(values.NAME),
    "seed": may(values.SEED),
    "t_end": need(values.NUMBER),
    "frames": may(values.FRAMES),
    "tolerance": may(values.NUMBER),
    "graph": need(Nested("graph")),
    "terms": need(Nested("term", many=True)),
    "start": need(Nested("start")),
    "agents": may(Nested("agents")),
    "energy": may(Nested("energy")),
}
"""Fields of a scenario file, besides the sections ``graphs`` and ``leaders`` of parts with names."""

SECTIONS = {"graphs": "graph", "leaders": "leader"}
"""Sections of parts with names, and their groups."""


def _format(value: object) -> int:
    if isinstance(value, bool) or value != 1:
        raise RefusedError("must be 1, the only format there is")
    return 1
