"""Interventions in a running experiment as plain data, and their log."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from flocking.apps.lab.experiment.selection import selected, state_of
from flocking.arrays import Array, Indices
from flocking.engine.archives.data_checks import squarable
from flocking.engine.storage.atomic_files import write_through
from flocking.errors import InvalidInput
from flocking.model.checks import NO_LESS, array, integer, number
from flocking.model.graphs.distance_graphs import Fixed
from flocking.model.graphs.seen_headings import links_at_state
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.leaders_and_obstacles.obstacles import Ball, Obstacle
from flocking.model.parts.structure import Step, changed, substituted, value_at, with_children
from flocking.model.serial import from_data, to_data
from flocking.model.state import State
from flocking.model.terms.avoidance import Avoid, ObstacleTerm
from flocking.model.world.losses import Bernoulli
from flocking.model.world.noises import Noise

FORMAT = 1
"""Version of the format of the log; another one is refused."""
LARGEST_LOG = 64 * 2**20
"""Bytes of a log that is read, a bound on memory: 64 MiB."""

MOST_DURATIONS = 10**6
"""Times of a log lie within so many durations of its scenario: a page that computes all of it in each second gets there
in eleven days. A replay to a time that nothing reaches would go on without end."""
FARTHEST = squarable("f8")
"""Largest component of a vector of an event, and largest speed: squares of it do not overflow, nor does their sum."""

LOSS, NOISE = ("information", "loss"), ("information", "noise")
"""Paths at which a number is the probability of a loss, and the standard deviation of measured positions."""

Event = dict[str, Any]
"""An intervention: ``kind`` and its arguments, all of them JSON data."""


@dataclass(frozen=True)
class Outcome:
    """The effect of an event on an experiment.

    Parameters
    ----------
    scenario
        The new scenario; its start matters only where ``new_session`` is set.
    base
        The new scenario that factors multiply.
    state
        The new state, where it changes.
    new_session
        Whether a new session must start from the scenario: it has other agents.
    """

    scenario: Scenario
    base: Scenario
    state: State | None = None
    new_session: bool = False


def outcome(event: Event, scenario: Scenario, base: Scenario, state: State) -> Outcome:
    """The effect of ``event`` on a scenario at ``state``.

    Parameters
    ----------
    base
        The scenario as it was opened.

    Raises
    ------
    InvalidInput
        When it is not an event, or a part refuses the change.
    """
    kind = event.get("kind")
    if not isinstance(kind, str) or kind not in _KINDS:
        raise InvalidInput("lab", "kind", f"must be one of {', '.join(_KINDS)}", kind)
    try:
        return _KINDS[kind](event, scenario, base, state)
    except KeyError as missing:
        raise InvalidInput("lab", str(missing.args[0]), f"must be given for an event of kind {kind!r}", None) from None
    except InvalidInput:
        raise
    except (TypeError, IndexError, ValueError, ArithmeticError) as error:
        raise InvalidInput("lab", kind, f"must be an event that fits the scenario ({error})", event) from None


def _set(event: Event, scenario: Scenario, base: Scenario, _: State) -> Outcome:
    path, value = event["path"], event["value"]
    return Outcome(_with_value(scenario, path, value), _with_value(base, path, value))


def _with_value(scenario: Scenario, path: Sequence[Step], value: object) -> Scenario:
    """The scenario with one value changed; numbers of the law leave all else as it was checked before."""
    number = type(value) in (int, float) or isinstance(value, np.ndarray)
    if number and tuple(path) in (LOSS, NOISE):
        inner = (*path, "probability" if tuple(path) == LOSS else "position")
        # A slider keeps what else losses and noise are; where there were none, the number stands for the simplest.
        if isinstance(value_at(scenario, path), Bernoulli | Noise):
            return changed(scenario, inner, value)
    if path[0] != "law" or not number or scenario.energy.leader is not None:
        return changed(scenario, path, value)
    return scenario.with_numbers(changed(scenario.law, path[1:], value), scenario.t_end)


def _scale(event: Event, scenario: Scenario, base: Scenario, _: State) -> Outcome:
    factor = number("lab", "factor", event["value"], least=0.0)
    values = np.asarray(value_at(base, event["path"])) * factor
    return Outcome(_with_value(scenario, event["path"], values), base)


def _move(event: Event, scenario: Scenario, base: Scenario, state: State) -> Outcome:
    """A leader or the path of an obstacle, at another place ``to``, or moved ``by`` a vector."""
    leader = value_at(scenario, event["path"])
    if not isinstance(leader, Leader):
        raise InvalidInput("lab", "path", "must lead to a leader or to the path of an obstacle", leader)
    if "to" in event:
        to = event["to"]
    else:
        to = (np.asarray(leader.at(state.t)[0]) + _vector("by", event["by"], state.dimension)).tolist()
    moved = leader.moved_to(to, state.t)
    before = value_at(base, event["path"])
    return Outcome(substituted(scenario, leader, moved), substituted(base, before, moved))


def _kick(event: Event, scenario: Scenario, base: Scenario, state: State) -> Outcome:
    agents = _agents(event["agents"], state.n)
    if scenario.agents.order == 1:
        raise InvalidInput("lab", "kick", "needs agents with velocities of their own", type(scenario.agents).__name__)
    if "velocity" in event:
        added = np.array(state.p)
        added[agents] += _vector("velocity", event["velocity"], state.dimension)
        return Outcome(scenario, base, replace(state, p=added))
    speed = number("lab", "speed", event["speed"], least=0.0)
    if speed > FARTHEST:
        raise InvalidInput("lab", "speed", f"must be at most {FARTHEST:.3g}", speed)
    draws = np.random.default_rng(integer("lab", "seed", event["seed"], least=0)).normal(
        size=(len(agents), state.dimension)
    )
    p = np.array(state.p)
    p[agents] += speed * draws / np.maximum(np.linalg.norm(draws, axis=1, keepdims=True), NO_LESS)
    return Outcome(scenario, base, replace(state, p=p))


def _place(event: Event, scenario: Scenario, base: Scenario, state: State) -> Outcome:
    """One agent at another place ``to``."""
    agents = _agents([event["agent"]], state.n)
    return Outcome(scenario, base, _placed(scenario, state, agents, _vector("to", event["to"], state.dimension)))


def _shift(event: Event, scenario: Scenario, base: Scenario, state: State) -> Outcome:
    """Some agents, moved ``by`` the same vector."""
    agents = _agents(event["agents"], state.n)
    to = state.q[agents] + _vector("by", event["by"], state.dimension)
    return Outcome(scenario, base, _placed(scenario, state, agents, to))


def _placed(scenario: Scenario, state: State, agents: Indices, to: Array) -> State:
    """The state with some agents at other places: their links are those of the graph's rule there."""
    q = np.array(state.q)
    q[agents] = to
    links = None
    if state.links is not None:
        links = np.array(state.links)
        found = links_at_state(
            scenario.law.graph, scenario.space, replace(state, q=q, links=None), scenario.agents.headings
        )
        links[agents], links[:, agents] = found[agents], found[:, agents]
    return replace(state, q=q, links=links)


def _kill(event: Event, scenario: Scenario, base: Scenario, state: State) -> Outcome:
    chosen = np.setdiff1d(np.arange(state.n), _agents(event["agents"], state.n))
    left = state_of(state, chosen) if len(chosen) else state
    return Outcome(selected(scenario, chosen, left), selected(base, chosen, left), new_session=True)


def _add(event: Event, scenario: Scenario, base: Scenario, state: State) -> Outcome:
    """One more agent, at ``q`` with ``p``: its own numbers are agent 0's, its links those of the graph's rule."""
    q, p = (_vector(name, event[name], state.dimension)[None] for name in ("q", "p"))
    chosen = np.append(np.arange(state.n), 0)
    columns = {
        name: np.concatenate([values, scenario.agents.start(name, q, p)]) for name, values in state.columns.items()
    }
    bare = State(np.concatenate([state.q, q]), np.concatenate([state.p, p]), state.t, columns=columns)
    larger = selected(scenario, chosen, bare)
    links = None
    if state.links is not None:
        links = np.array(links_at_state(larger.law.graph, larger.space, bare, larger.agents.headings))
        links[:-1, :-1] = state.links
    grown = replace(bare, links=links)
    return Outcome(larger.with_(start=grown), selected(base, chosen, grown), new_session=True)


def _cut(event: Event, scenario: Scenario, base: Scenario, state: State) -> Outcome:
    """Links of some ``pairs``, or all of some ``agents``, are cut."""
    graph = scenario.law.graph
    if "agents" in event:
        links = graph.initial(state.q) if isinstance(graph, Fixed) else state.links
        linked = np.argwhere(np.zeros((0, 0)) if links is None else links).tolist()
        chosen = set(_agents(event["agents"], state.n).tolist())
        pairs = [(i, j) for i, j in linked if chosen & {i, j}]
    else:
        pairs = [(integer("lab", "pairs", i, least=0), integer("lab", "pairs", j, least=0)) for i, j in event["pairs"]]
    if any(max(pair) >= state.n for pair in pairs):
        raise InvalidInput("lab", "pairs", f"must join agents of 0..{state.n - 1}", pairs)
    if isinstance(graph, Fixed):
        removed = {frozenset(pair) for pair in pairs}
        edges = tuple(edge for edge in graph.edges if frozenset(edge) not in removed)
        fewer = Fixed(graph.n, edges, directed=graph.directed)
        return Outcome(substituted(scenario, graph, fewer), substituted(base, base.law.graph, fewer))
    if state.links is None:
        raise InvalidInput("lab", "pairs", "can be cut only where link matrices are stored", f"{state.n} agents")
    links = np.array(state.links)
    for i, j in pairs:
        links[i, j] = links[j, i] = False
    return Outcome(scenario, base, replace(state, links=links))


def _term(event: Event, scenario: Scenario, base: Scenario, _: State) -> Outcome:
    term = from_data(event["term"])
    longer, reference = (x.with_(law=Law(x.law.graph, (*x.law.terms, term))) for x in (scenario, base))
    return Outcome(longer, reference)


def _drop(event: Event, scenario: Scenario, base: Scenario, _: State) -> Outcome:
    number = integer("lab", "number", event["number"], least=0)
    shorter, reference = (
        x.with_(law=Law(x.law.graph, tuple(t for k, t in enumerate(x.law.terms) if k != number)))
        for x in (scenario, base)
    )
    return Outcome(shorter, reference)


def _obstacle(event: Event, scenario: Scenario, base: Scenario, state: State) -> Outcome:
    ball = Ball(event["centre"], event["radius"])
    return Outcome(_with_obstacle(scenario, ball), _with_obstacle(base, ball))


def _with_obstacle(scenario: Scenario, ball: Ball) -> Scenario:
    for term in scenario.law.terms:
        if isinstance(term, ObstacleTerm):
            found: Scenario = substituted(scenario, term, with_children(term, {"obstacles": (*term.obstacles, ball)}))
            return found
    reach = float(np.max(np.asarray(scenario.law.graph.break_radius)))
    reach = reach / 2 if np.isfinite(reach) else ball.radius
    term = Avoid((ball,), range=reach, gamma_agents=False)
    return scenario.with_(law=Law(scenario.law.graph, (*scenario.law.terms, term)))


def _remove(event: Event, scenario: Scenario, base: Scenario, _: State) -> Outcome:
    """Remove one obstacle; with the last one its term."""
    path = tuple(event["path"])
    if not isinstance(value_at(scenario, path), Obstacle):
        raise InvalidInput("lab", "path", "must lead to an obstacle", list(path))
    return Outcome(_without_obstacle(scenario, path), _without_obstacle(base, path))


def _without_obstacle(scenario: Scenario, path: Sequence[Step]) -> Scenario:
    *parents, _, number = path
    term = value_at(scenario, parents)
    assert isinstance(term, ObstacleTerm)
    left = tuple(x for k, x in enumerate(term.obstacles) if k != number)
    if left:
        found: Scenario = substituted(scenario, term, with_children(term, {"obstacles": left}))
        return found
    terms = tuple(each for each in scenario.law.terms if each is not term)
    if not terms:
        raise InvalidInput("lab", "obstacles", "must leave at least one term in the law", "none")
    return scenario.with_(law=Law(scenario.law.graph, terms))


def _clear(_: Event, scenario: Scenario, base: Scenario, __: State) -> Outcome:
    return Outcome(_without_obstacles(scenario), _without_obstacles(base))


def _without_obstacles(scenario: Scenario) -> Scenario:
    terms = tuple(term for term in scenario.law.terms if not isinstance(term, ObstacleTerm))
    if not terms:
        raise InvalidInput("lab", "obstacles", "must leave at least one term in the law", "none")
    return scenario.with_(law=Law(scenario.law.graph, terms))


def _agents(given: Sequence[int], n: int) -> Indices:
    numbers = [integer("lab", "agents", i, least=0) for i in given]
    if any(i >= n for i in numbers):
        raise InvalidInput("lab", "agents", f"must be agents of 0..{n - 1}", numbers)
    return np.array(numbers, dtype=np.intp)


def _vector(name: str, given: object, dimension: int) -> Array:
    found = array("lab", name, given, ndim=1)
    if found.shape != (dimension,):
        raise InvalidInput("lab", name, f"must have {dimension} components", given)
    if (np.abs(found) > FARTHEST).any():
        raise InvalidInput("lab", name, f"must be at most {FARTHEST:.3g} in each component", given)
    return found


_KINDS: dict[str, Callable[[Event, Scenario, Scenario, State], Outcome]] = {
    "set": _set, "scale": _scale, "move": _move, "kick": _kick, "place": _place, "shift": _shift, "kill": _kill,
    "add": _add, "cut": _cut, "term": _term, "drop": _drop, "obstacle": _obstacle, "remove": _remove,
    "clear obstacles": _clear,
}  # fmt: skip


def _check_times(log: EventLog) -> None:
    """Refuse times that no experiment reaches."""
    start = log.scenario.start.t
    longest = MOST_DURATIONS * (log.scenario.t_end - start)
    for name, time in (*(("time", time) for time, _ in log.entries), ("end", log.end)):
        if abs(time - start) > longest:
            raise InvalidInput("lab", name, f"must lie within {longest:g} of the start at {start:g}", time)


@dataclass
class EventLog:
    """A scenario, and the events that changed it with their times.

    Parameters
    ----------
    scenario
        The scenario at the start.
    engine
        Its engine.
    entries
        Times and events, in order.
    end
        Time until which it ran.
    """

    scenario: Scenario
    engine: str
    entries: list[tuple[float, Event]] = field(default_factory=list)
    end: float = 0.0

    def write(self, path: str | Path, more: Mapping[str, object] | None = None) -> Path:
        """Write the log as JSON.

        Parameters
        ----------
        path
            The file.
        more
            Further data at the top of the file, which reading ignores.

        Raises
        ------
        InvalidInput
            When the scenario has a part without a name in files, or the file cannot be written.
        """
        data = {
            **(more or {}), "format": FORMAT, "engine": self.engine, "end": self.end,
            "events": [{"time": t, **event} for t, event in self.entries], "scenario": to_data(self.scenario),
        }  # fmt: skip
        try:
            write_through(Path(path), (json.dumps(data, allow_nan=False) + "\n").encode(), parents=False)
        except (OSError, ValueError) as error:
            raise InvalidInput("lab", "log", f"cannot be written ({error})", str(path)) from None
        return Path(path)

    @classmethod
    def read(cls, path: str | Path) -> EventLog:
        """Read a log.

        Raises
        ------
        InvalidInput
            When the file is not a log.
        """
        file = Path(path)
        try:
            if not file.is_file():
                raise InvalidInput("lab", "log", "must be an event log", str(path))
            if file.stat().st_size > LARGEST_LOG:
                raise InvalidInput("lab", "log", f"must have at most {LARGEST_LOG} bytes", str(path))
            data = json.loads(file.read_text(encoding="utf-8"))
            if data["format"] != FORMAT:
                raise InvalidInput("lab", "format", f"must be {FORMAT}", data["format"])
            entries = [
                (number("lab", "time", e["time"]), {k: v for k, v in e.items() if k != "time"}) for e in data["events"]
            ]
            scenario = from_data(data["scenario"])
            found = cls(scenario, str(data["engine"]), entries, number("lab", "end", data["end"]))
            if isinstance(scenario, Scenario):
                _check_times(found)
        except InvalidInput:
            raise
        except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError, ArithmeticError) as error:
            raise InvalidInput("lab", "log", f"must be an event log ({error})", str(path)) from None
        if not isinstance(scenario, Scenario):
            raise InvalidInput("lab", "scenario", "must be a scenario", type(scenario).__name__)
        return found
