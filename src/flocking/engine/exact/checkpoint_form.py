"""The form of a checkpoint of the exact engine for a given scenario."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import NotRequired, TypedDict, cast

import numpy as np

from flocking.arrays import AnyArray
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import (
    And,
    Flag,
    Form,
    Integer,
    MalformedError,
    Many,
    Names,
    Real,
    Row,
    Table,
    Text,
    Value,
    squarable,
)
from flocking.engine.exact.companion import NODES
from flocking.engine.exact.crossings.obstacle_centres import CentresMemory
from flocking.engine.exact.crossings.switching import LinkState
from flocking.engine.exact.dynamics import LEDGER
from flocking.engine.exact.extremes import NAMES
from flocking.engine.exact.origin import OriginData
from flocking.engine.exact.uncertain_switches import DoubtMemory
from flocking.engine.kernels.expressions import motion_formulas
from flocking.engine.kernels.layout import Layout
from flocking.engine.runs.columns import KINDS
from flocking.engine.runs.run import DOUBT_FIELDS, DoubtRow
from flocking.model.law import Law, Scenario

ANY = Real(finite=False)
POSITIVE = Real(least=0.0, finite=False)
LARGEST = squarable("f8")
"""Bound on the numbers of accepted steps."""
Extreme = tuple[float, float, tuple[int, ...], float]
"""A value, its time, the agents and its error."""

LATE = 1e-9
"""Largest relative difference of two representations of one time."""


class ExactNumbers(TypedDict):
    """The numbers of a checkpoint of the exact engine, by the names and with the meanings of its snapshot."""

    time: float
    energy: float
    jumped: float
    steps: int
    stepper: tuple[float, float]
    segment: tuple[float, float]
    pending: tuple[int, ...]
    graphs: int
    watches: int
    origin: OriginData
    momentum: tuple[float, ...]
    sliding: tuple[tuple[int, int, int, float, float, int], ...]
    doubts: tuple[DoubtRow, ...]
    closest: tuple[Extreme, Extreme]
    largest: dict[str, Extreme]
    error: NotRequired[tuple[float, float, DoubtMemory]]
    centres: NotRequired[CentresMemory]


def check_exact(numbers: Mapping[str, object], arrays: Arrays, scenario: Scenario, plant: Law | None) -> ExactNumbers:
    """The numbers of a checkpoint of a session of this scenario, after all checks.

    Parameters
    ----------
    numbers, arrays
        What was read.
    plant
        The law the agents really obey, if it is another.

    Raises
    ------
    MalformedError
        When something is wrong; the message names it.
    """
    acting = plant or scenario.law
    acting.check_count(*scenario.start.q.shape)
    origin = _ORIGIN(scenario.start.dimension).check(numbers.get("origin"), "origin")
    base = float(Real().check(origin[0], "origin[0]"))
    start = replace(scenario.start, t=0.0, links=None)
    links = LinkState(acting, start, scenario.agents, base, scenario.space)
    _numbers(scenario, links).check(numbers, "")
    # Every entry has been looked at.
    checked = cast(ExactNumbers, _tuples(numbers))
    _arrays(scenario, plant, links, checked).check(arrays, "")
    _check_times(checked, scenario, base)
    stepper, segment = checked["stepper"], checked["segment"]
    if stepper[0] == segment[1] and (arrays["y"] != arrays["coefficients"][-1]).any():
        raise MalformedError("y must be where the last step ended")
    for k, (graph, matrix) in enumerate(zip(links.graphs, (arrays[f"links{k}"] for k in range(len(links.links))),
                                            strict=True)):  # fmt: skip
        allowed = graph.allowed(scenario.agents.headings)
        if matrix.diagonal().any() or not (graph.directed or (matrix == matrix.T).all()):
            raise MalformedError(f"links{k} must be links of a {type(graph).__name__} graph")
        if allowed is not None and (matrix & ~allowed).any():
            raise MalformedError(f"links{k} must be links that a {type(graph).__name__} graph allows")
    return checked


def _tuples(value: object) -> object:
    """Plain data with tuples in place of lists, so that each entry has a type of its own."""
    if isinstance(value, list | tuple):
        return tuple(_tuples(x) for x in value)
    return {name: _tuples(x) for name, x in value.items()} if isinstance(value, dict) else value


def _ORIGIN(m: int) -> Row[object]:  # noqa: N802
    place = Row([Real()] * m)
    return Row([Real(), place, place, Real()])


def _agent(n: int) -> Integer:
    return Integer(0, n - 1)


def _numbers(scenario: Scenario, links: LinkState) -> Names:
    n, m = scenario.start.q.shape
    agent, other = _agent(n), Integer(0, max(n, *(x.shape[1] for x in links.near), 1) - 1)
    watch = Integer(0, len(links.watches) - 1)
    pair = Row([watch, agent, other])
    nobody = Row([Integer(-1, -1), Integer(-1, -1)])
    closest = _Either(Row([ANY, ANY, nobody, ANY]), Row([ANY, ANY, Row([agent, agent]), ANY]))
    kind, what = Text(("near miss", "switch")), Text(KINDS)
    groups = links.contacts.groups
    met, owners = Integer(0, max(n, *(max(g.numbers) + 1 for g in groups), 1) - 1), max(len(links.graphs), len(groups))
    doubt = {"kind": kind, "what": what, "i": agent, "j": met, "graph": Integer(0, owners - 1)}
    extreme = Row([ANY, ANY, Many(agent), ANY])
    near: Row[object] = Row([pair, Row([ANY, ANY, ANY, ANY])])
    fresh: Row[object] = Row([pair, Row([ANY, ANY, ANY, Flag(), what, ANY, Flag()])])
    extremes = dict.fromkeys(NAMES, extreme)
    return Names(
        {
            "time": Real(), "energy": Real(), "jumped": Real(), "steps": Integer(),
            "stepper": Row([Real(), POSITIVE]), "segment": Row([Real(), Real()]), "pending": Many(watch),
            "graphs": Integer(len(links.graphs), len(links.graphs)),
            "watches": Integer(len(links.watches), len(links.watches)), "origin": _ORIGIN(m),
            "momentum": Row([Real()] * m),
            "sliding": Many(Row([watch, agent, other, Real(), ANY, Integer()])),
            "doubts": Many(Row([doubt.get(name, ANY) for name in DOUBT_FIELDS.names or ()])),
            "closest": Row([closest, closest]), "largest": Names({}, extremes),
        },
        {
            "error": Row([POSITIVE, ANY, Row([Many(near), Many(fresh)])]),
            "centres": Row([Integer(), Real(), Many(Row([agent, Integer()]))]),
        },
    )  # fmt: skip


class _Either(Form[Value]):
    """One of two forms."""

    def __init__(self, one: Form[Value], two: Form[Value]) -> None:
        self.one, self.two = one, two

    def check(self, value: object, name: str) -> Value:
        """Refuse a value that has neither form."""
        try:
            return self.one.check(value, name)
        except MalformedError:
            return self.two.check(value, name)


def _arrays(scenario: Scenario, plant: Law | None, links: LinkState, numbers: ExactNumbers) -> Names:
    n, m = scenario.start.q.shape
    laws = [plant or scenario.law] + ([] if plant is None else [scenario.law])
    places = sum(len(Layout(law, scenario.energy).places) for law in laws)
    further = sum(scenario.agents.widths(m).values())
    body = scenario.agents
    departs = motion_formulas(Layout(scenario.law, scenario.energy, body, scenario.space), m).departs
    size = n * (body.order * m + further) + departs + LEDGER + places
    limits = len(body.held(m)) - len(body.drawn(0.0, n, m))
    crossing = {f"pending{k}": _pairs_within(*links.near[watch].shape) for k, watch in enumerate(numbers["pending"])}
    matrices: dict[str, Form[object]] = {f"links{k}": Table("?", x.shape) for k, x in enumerate(links.links)}
    matrices |= {f"near{k}": Table("?", x.shape) for k, x in enumerate(links.near)}
    state = Table("f8", (size,), -LARGEST, LARGEST)
    error = numbers.get("error")
    # Once nothing is known of the error, it may be anything.
    lost = error is not None and error[1] < np.inf
    difference = Table("f8", (NODES, size), finite=False) if lost else Table("f8", (NODES, size), -LARGEST, LARGEST)
    return Names(
        {
            "y": state,
            "slope": state,
            "coefficients": Table("f8", (DEGREE + 1, size), -LARGEST, LARGEST),
            **matrices,
            **crossing,
            **({"limits": Table("f8", (limits, n), 0.0, 1.0)} if limits else {}),
        },
        {
            "tolerance": Table("f8", (size,), least=float(np.finfo(float).tiny)),
            "difference": difference,
        },
    )


def _pairs_within(rows: int, columns: int) -> Form[AnyArray]:
    return And(
        Table("i8", (None, 2), least=0), "name agents and obstacles that there are",
        lambda pairs: bool((pairs < (rows, columns)).all()),
    )  # fmt: skip


def _check_times(numbers: ExactNumbers, scenario: Scenario, base: float) -> None:
    time, (t0, t1), (t, _) = numbers["time"], numbers["segment"], numbers["stepper"]
    slack = LATE * max(1.0, abs(time), abs(base))
    begin, end = scenario.start.t, scenario.t_end
    if not (begin - slack <= time <= end + slack and t0 <= t1 and t0 <= t + slack):
        raise MalformedError(f"the time must lie in the run, {begin:g} to {end:g}, and on its last step, not {time:g}")
    if not (t0 + base - slack <= time <= t1 + base + slack):
        raise MalformedError(f"the time {time:g} must lie on the last step, {t0 + base:g} to {t1 + base:g}")
