"""A session of delayed knowledge as plain numbers and named arrays, and back."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.adaptive_steps.integration_method import DEGREE
from flocking.engine.adaptive_steps.limit_crossings import HeldNumbers
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.state_vectors import place_of
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Form, Real, Table
from flocking.engine.archives.data_checks import Names as NamedForms
from flocking.engine.delayed.delays import Delays
from flocking.engine.delayed.history import History
from flocking.engine.delayed.met_obstacles import MetObstacles
from flocking.engine.delayed.state_jumps import StateJumps
from flocking.engine.imperfect.checkpoint_form import (
    LARGEST,
    NEAR,
    ROUNDED,
    check_closest,
    check_links,
    checked_numbers,
    must,
)
from flocking.engine.imperfect.graph_views import views_of
from flocking.engine.imperfect.margins_in_pieces import MarginsInPieces, Places
from flocking.engine.imperfect.memory import ImperfectMemory
from flocking.engine.protocol.session import Packed
from flocking.model.law import Scenario


@dataclass
class DelayedMemory:
    """What a session of delayed knowledge goes on from, but its scenario and its records.

    Parameters
    ----------
    truth
        True links, closest approaches, the ledger, and all that is one number.
    history, segment
        The past, and the last step.
    known_links
        Links by what agents know, shape (graphs, N, N).
    pending
        Known links that switch at the end of the last step, rows (i, j, graph).
    delays
        How late agents know each other, where steps must end, and replaced states that somebody does not know of yet.
    held
        Which limits of bodies act, and gusts.
    obstacles
        Which agents are within range of obstacles, in truth and by what they know of themselves.
    replaced_at
        When law or state were replaced, in the scenario's time.
    """

    truth: ImperfectMemory
    history: History
    segment: Segment
    known_links: Links
    pending: Indices
    delays: Delays
    held: HeldNumbers
    obstacles: MetObstacles
    replaced_at: list[float]


def packed_memory(memory: DelayedMemory) -> Packed:
    """The memory of a session as numbers and arrays.

    Parameters
    ----------
    memory
        What the session goes on from.
    """
    segments = memory.history.segments or [memory.segment]
    arrays: Arrays = {
        **memory.truth.arrays(),
        "times": np.array([segments[0].t0, *(segment.t1 for segment in segments)]),
        "coefficients": np.array([segment.coefficients for segment in segments]),
        "known_links": memory.known_links, "pending": memory.pending, **memory.delays.points.arrays(),
        **({"limits": memory.held.acting} if memory.held.limits else {}),
        **memory.obstacles.arrays(), **memory.delays.jumps.arrays(),
        **({"begun": memory.segment.coefficients[-1]} if _begins_anew(memory) else {}),
        **({"replaced_at": np.array(memory.replaced_at)} if memory.replaced_at else {}),
    }  # fmt: skip
    return dict(memory.truth.numbers), arrays


def _begins_anew(memory: DelayedMemory) -> bool:
    """Whether no step has been made since law or state were replaced: the state is not the end of one."""
    return bool(memory.replaced_at) and memory.segment.t1 == memory.segment.t0


def unpacked_memory(fresh: DelayedMemory, packed: Packed, scenario: Scenario) -> None:
    """Put what was packed in place of the memory of a session at its start.

    Parameters
    ----------
    fresh
        Memory of a session of the same scenario at its start.
    packed
        What `packed_memory` gave, read back.
    scenario
        The scenario.

    Raises
    ------
    MalformedError
        When the data are no session of this scenario.
    """
    data, arrays = packed
    fresh.truth.recall(arrays, _checked(data, arrays, scenario, fresh))
    times, tables = arrays["times"].tolist(), arrays["coefficients"]
    if times[-1] > 0.0:
        for t0, t1, table in zip(times[:-1], times[1:], tables, strict=True):
            fresh.segment = Segment(t0, t1, np.array(table))
            fresh.history.add(fresh.segment, times[0])
    if "begun" in arrays:
        fresh.segment = Segment.resting(times[-1], arrays["begun"])
    fresh.delays.jumps.recall(arrays, times[-1])
    fresh.replaced_at = arrays.get("replaced_at", np.zeros(0)).tolist()
    fresh.known_links, fresh.pending = arrays["known_links"], arrays["pending"]
    fresh.obstacles.recall(arrays)
    if fresh.held.limits:
        fresh.held.rows[fresh.held.limits] = arrays["limits"]


def _checked(data: object, arrays: Arrays, scenario: Scenario, fresh: DelayedMemory) -> dict[str, float]:
    """The numbers of a checkpoint, after checks of all it holds."""
    n, graphs, base = scenario.start.n, len(scenario.law.graphs), scenario.start.t
    least, largest = fresh.delays.least, fresh.delays.largest
    size = fresh.segment.coefficients.shape[1]
    more: dict[str, Form[object]] = {"step": Real(0.0), "short_steps": Real(0.0, 2.0**53)}
    numbers = checked_numbers(data, base, scenario.t_end, more)
    links = Table("?", (graphs, n, n))
    NamedForms({
        "times": Table("f8", (None,), least=0.0), **fresh.delays.points.forms(n),
        **fresh.obstacles.forms(n), **_replaced_forms(arrays, n, size),
        **({"limits": Table("f8", (len(fresh.held.limits), n), least=0.0, most=1.0)} if fresh.held.limits else {}),
        "coefficients": Table("f8", (None, DEGREE + 1, size), least=-LARGEST, most=LARGEST),
        "known_links": links, "links": links, "pending": Table("i8", (None, 3), least=0, most=max(n, graphs) - 1),
        "crossing_time": Table("f8", (None,), least=0.0),
        "crossing": Table("i8", (None, 3), least=0, most=max(n, graphs) - 1),
        "closest": Table("f8", (2, 4), finite=False), "sums": Table("f8", (4,), finite=False),
        "errors": Table("f8", (4,), least=0.0, finite=False),
    }, fresh.delays.points.later_forms()).check(arrays, "")  # fmt: skip
    now, accounted = numbers["time"] - base, numbers["accounted"]
    slack = ROUNDED * (abs(base) + abs(numbers["time"])) + ROUNDED * largest
    times, tables = arrays["times"], arrays["coefficients"]
    must(len(times) == len(tables) + 1 and len(tables) > 0, "times", "be one more than the steps")
    resting = len(tables) == 1 and times[0] == times[1] == 0.0
    must(resting or (np.diff(times) > 0.0).all(), "times", "be in order")
    must(resting or (np.diff(times) <= least + slack).all(), "times", "be no further apart than the least delay")
    must(times[0] <= max(times[-2] - largest, 0.0) + slack, "times", "reach back as far as the delay")
    must(times[-2] - slack <= now <= times[-1] + slack, "time", "lie in the last step")
    must(accounted <= times[-1], "accounted", "not lie after the last step")
    _check_gaps(arrays, scenario, fresh.segment.coefficients[0])
    must(resting or (np.abs(tables) <= LARGEST).all(), "coefficients", "be numbers that can be squared")
    pending = arrays["pending"]
    fits = (pending[:, :2] < n).all() and (pending[:, 2] < graphs).all() and (pending[:, 0] != pending[:, 1]).all()
    must(fits and all(scenario.law.graphs[k].moves for k in pending[:, 2].tolist()), "pending",
         "name links that switch")  # fmt: skip
    fresh.delays.points.recall(arrays)
    if fresh.held.limits:
        must(np.isin(arrays["limits"], (0.0, 1.0)).all(), "limits", "be 0 or 1")
    must(numbers["steps"] == int(numbers["steps"]), "steps", "be a whole number")
    must(numbers["steps"] >= (0 if resting else len(tables)), "steps", "be as many as are stored")
    must(numbers["short_steps"] == int(numbers["short_steps"]), "short_steps", "be a whole number")
    check_links(arrays, scenario.law.graphs, scenario.agents.headings, fresh.truth.links)
    check_closest(arrays["closest"], n, accounted)
    _check_crossings(arrays, fresh, (now, float(times[-1])), scenario)
    y = arrays.get("begun", tables[-1, -1])
    q = y[: scenario.start.q.size].reshape(scenario.start.q.shape)
    fresh.obstacles.check(arrays, base + float(times[-1]), q)
    return numbers


def _replaced_forms(arrays: Arrays, n: int, size: int) -> dict[str, Form[object]]:
    """Forms of what a checkpoint holds of replacements, where there are any."""
    more: dict[str, Form[object]] = {}
    if "replaced_at" in arrays:
        more["replaced_at"] = Table("f8", (None,))
    if "begun" in arrays:
        more["begun"] = Table("f8", (size,), least=-LARGEST, most=LARGEST)
    return more | StateJumps.forms(arrays, n)


def _check_gaps(arrays: Arrays, scenario: Scenario, start: Array) -> None:
    """Steps have no gaps between them, nor before the first one, but where states of agents were replaced.

    Parameters
    ----------
    arrays, scenario
        What was read, and the scenario.
    start
        State vector at the start.
    """
    times, tables, body = arrays["times"], arrays["coefficients"], scenario.agents
    n, m = scenario.start.q.shape
    widths = (*[m] * body.order, *body.widths(m).values())
    whose = np.concatenate([np.repeat(np.arange(n), width) for width in widths])
    replaced = dict(zip(arrays.get("replaced", np.zeros(0)).tolist(), arrays.get("replaced_agents", ()), strict=True))
    nobody = np.zeros(n, dtype=bool)
    ends, begins, at = list(tables[:-1, -1]), list(tables[1:, 0]), times[1:-1].tolist()
    if times[0] == 0.0:
        ends, begins, at = [start, *ends], [tables[0, 0], *begins], [0.0, *at]
    if "begun" in arrays:
        must(
            "replaced_at" in arrays and not len(arrays["crossing_time"]), "begun", "be where law or state were replaced"
        )
        ends, begins, at = [*ends, tables[-1, -1]], [*begins, arrays["begun"]], [*at, float(times[-1])]
    for end, begin, t in zip(ends, begins, at, strict=True):
        fits = ((end == begin) | replaced.get(t, nobody)[whose]).all()
        must(fits, "coefficients", "be those of steps without gaps" if t > 0.0 else "begin at the start")
    if "replaced_at" in arrays:
        must(len(arrays["replaced_at"]) > 0, "replaced_at", "have a time")


def _check_crossings(arrays: Arrays, fresh: DelayedMemory, span: tuple[float, float], scenario: Scenario) -> None:
    """Crossings are ahead, at their distances, and of links that switch."""
    time, rows = arrays["crossing_time"], arrays["crossing"]
    n, m = scenario.start.q.shape
    graphs = scenario.law.graphs
    must(len(time) == len(rows), "crossing", "have as many rows as crossing_time")
    must((rows[:, :2] < n).all() and (rows[:, 2] < len(graphs)).all(), "crossing", "name agents and graphs there are")
    order = list(zip(time.tolist(), *rows.T.tolist(), strict=True))
    must(order == sorted(set(order)), "crossing", "be in order")
    slack = NEAR * (span[1] - span[0]) + ROUNDED * max(span[1], 1.0)
    must(((time >= span[0] - slack) & (time <= span[1] + slack)).all(), "crossing_time", "lie in the last step")
    links = arrays["links"].copy()
    segment = Segment(float(arrays["times"][-2]), float(arrays["times"][-1]), arrays["coefficients"][-1])
    views = views_of(graphs, scenario.agents.headings, scenario.start.q)
    ends = np.full(n, segment.t1)
    margins = {
        k: MarginsInPieces(view, partial(_looks, segment, scenario), segment.t0, ends) for k, view in views.items()
    }
    for at, (i, j, k) in zip(time.tolist(), rows.tolist(), strict=True):
        graph = graphs[k]
        must(graph.moves and i != j and (graph.directed or i < j), "crossing", "name pairs whose links switch")
        q = segment.at(min(at, segment.t1))[: n * m].reshape(n, m)
        offset = scenario.space.displacement(q[j] - q[i])
        radius = graph.break_radius if links[k, i, j] else graph.appear_radius
        level = float(np.broadcast_to(np.asarray(radius, dtype=np.float64), n)[i])
        off = level - float(np.linalg.norm(offset))
        if k in views:
            inside, sure = margins[k].at(np.array([i]), np.array([j]), offset[None], np.array([at]))
            off = float(inside[0]) if sure[0] else 0.0
        must(abs(off) <= NEAR * (level + float(np.abs(q).max())), "crossing_time",
             "be when a pair is at its distance")  # fmt: skip
        links[k, i, j] = not links[k, i, j]
        if not graph.directed:
            links[k, j, i] = links[k, i, j]


def _looks(segment: Segment, scenario: Scenario, column: str) -> Places:
    """Along which vectors of a ``column`` agents look on a step."""
    n, m = scenario.start.q.shape
    first = place_of(column, scenario.agents.order, n, m, scenario.agents.widths(m))

    def at(agents: Indices, time: Array) -> Array:
        states = [segment.at(min(t, segment.t1))[first : first + n * m].reshape(n, m) for t in time.tolist()]
        return np.array([state[agent] for state, agent in zip(states, agents.tolist(), strict=True)])

    return at
