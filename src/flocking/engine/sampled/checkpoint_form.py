"""The form of a checkpoint of held control for a given scenario.

Beside types, shapes and ranges: all that follows from the scenario and the time reached, such as how often agents have
acted, which forces wait, which samples have arrived and where links switch.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Protocol

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Form, Names, Table
from flocking.engine.imperfect.checkpoint_form import (
    LARGEST,
    MOST_COUNT,
    NEAR,
    ROUNDED,
    check_closest,
    check_links,
    checked_numbers,
    must,
)
from flocking.engine.imperfect.graph_views import GraphView, views_of
from flocking.engine.imperfect.link_rules import LinkRules, link_rules
from flocking.engine.imperfect.margins_in_pieces import MarginsInPieces, Places
from flocking.engine.imperfect.messages.checkpoint_form import check_newest, check_samples, knowledge_forms, vectors
from flocking.engine.imperfect.messages.knowledge import Knowledge
from flocking.engine.imperfect.messages.samples import START
from flocking.engine.imperfect.range_crossings import ObstacleRanges
from flocking.engine.imperfect.taylor_series import rates_of
from flocking.engine.sampled.motion import Drive
from flocking.engine.sampled.piece_series import LONGEST_PIECE
from flocking.engine.sampled.snapshot import SampledMemory
from flocking.model.law import Scenario
from flocking.model.space import Space
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants, PeriodicTimes


class MotionForm(Protocol):
    """What a checkpoint holds of the motion between two changes of forces."""

    @property
    def numbers(self) -> Mapping[str, Form[object]]:
        """Forms of its numbers."""

    @property
    def tables(self) -> Mapping[str, Table]:
        """Forms of its arrays."""

    def check(self, arrays: Arrays, began: Instants, now: tuple[float, float]) -> None:
        """Refuse arrays that do not follow from the forces.

        Parameters
        ----------
        began
            Nanoseconds at which the forces began to act, shape (N,).
        now
            Least and largest nanosecond that may be the time reached.
        """

    def ends(self, arrays: Arrays) -> Array:
        """When the motion of each agent goes on in another way under the same force, in seconds, shape (N,)."""

    def places(self, arrays: Arrays) -> Places:
        """Where agents are."""

    def looks(self, arrays: Arrays, column: str) -> Places:
        """Along which vectors of a ``column`` agents look."""


def check_sampled(
    data: object, arrays: Arrays, scenario: Scenario, fresh: SampledMemory, form: MotionForm | None = None
) -> dict[str, float]:
    """The numbers of a checkpoint of a session of this scenario, after all checks.

    Parameters
    ----------
    data, arrays
        What was read.
    fresh
        Memory of a session of the scenario at its start.
    form
        What it holds of the motion; polynomials of `Motion` when absent.

    Raises
    ------
    MalformedError
        When something is wrong; the message names it.
    """
    n, m = scenario.start.q.shape
    graphs, base = len(scenario.law.graphs), scenario.start.t
    form = _ClosedForm(fresh) if form is None else form
    numbers = checked_numbers(data, base, scenario.t_end, form.numbers)
    _forms(n, m, graphs, fresh, form.tables).check(arrays, "")
    now, accounted = numbers["time"] - base, numbers["accounted"]
    slack = ROUNDED * (abs(base) + abs(numbers["time"]))
    must(accounted <= now + slack, "accounted", "not lie after the time")
    ends = numbers["ledger_ends"]
    must(math.isinf(ends) or ends <= base + accounted + slack, "ledger_ends", "not lie after the time")
    earliest, latest = (now - slack) * PER_SECOND - 2.0, (now + slack) * PER_SECOND + 2.0
    control = scenario.control
    assert isinstance(control, Held)
    ticks, latency = control.schedule(n), control.latencies(n)
    for name, schedule, late in (
        ("ticked", ticks, np.zeros_like(latency)), ("applied", ticks, latency),
        ("taken", fresh.knowledge.schedule, np.zeros_like(latency)),
    ):  # fmt: skip
        counts = np.zeros(n) if schedule is None else arrays[name]
        least, most = (
            np.zeros(n) if schedule is None else schedule.count_until(int(at) - late) for at in (earliest, latest)
        )
        must(((least <= counts) & (counts <= most) & (counts == arrays[name])).all(), name,
              "agree with the schedule of the scenario until the time")  # fmt: skip
    ticked, applied = arrays["ticked"], arrays["applied"]
    must(numbers["steps"] == int(numbers["steps"]), "steps", "be a whole number")
    must(ticked.max() <= numbers["steps"] <= ticked.sum(), "steps", "be the number of times at which agents acted")
    _check_waiting(arrays, ticks, latency)
    began = np.where(applied > 0, ticks.at(np.arange(n), applied - 1) + latency, 0)
    must(not arrays.get("wanted", arrays["force"])[applied == 0].any(), "force", "be zero until a force acts")
    form.check(arrays, began, (earliest, latest))
    rules = link_rules(scenario.law.graphs, n)
    check_links(arrays, scenario.law.graphs, scenario.agents.headings, fresh.truth.links)
    pieces = np.minimum((ticks.at(np.arange(n), applied) + latency) * NANOSECOND, form.ends(arrays))
    places = form.places(arrays)
    views = views_of(scenario.law.graphs, scenario.agents.headings, scenario.start.q)
    margins = {k: MarginsInPieces(view, partial(form.looks, arrays), now, pieces) for k, view in views.items()}
    _check_crossings(arrays, (rules, views, margins), now, (slack, pieces), (scenario.space, places))
    check_closest(arrays["closest"], n, accounted)
    fresh.obstacle_ranges.ends = pieces
    if fresh.obstacle_ranges.groups:
        _check_obstacle_ranges(arrays, fresh.obstacle_ranges, (base, now, slack), places)
    _check_knowledge(arrays, fresh.knowledge, ticks)
    return numbers


def _forms(n: int, m: int, graphs: int, fresh: SampledMemory, motion: Mapping[str, Table]) -> Names:
    waiting = None
    count = Table("i8", (n,), least=0, most=MOST_COUNT)
    agent = Table("i8", (None,), least=0, most=n - 1)
    links = Table("?", (graphs, n, n))
    known, noise = knowledge_forms(fresh.knowledge)
    bodies = dict(motion)
    if fresh.obstacle_ranges.groups:
        every = sum(there.shape[1] for there in fresh.obstacle_ranges.near)
        bodies |= {
            "near_obstacles": Table("?", (n, every)), "meeting_time": Table("f8", (None,), least=0.0),
            "meeting": Table("i8", (None, 3), least=0, most=max(n, every) - 1),
        }  # fmt: skip
    if fresh.filter is not None:
        noise |= {
            "filter_normals": Table("f8", (n, n, m), -1.0 - NEAR, 1.0 + NEAR),
            "filter_counts": Table("i8", (3,), -1, MOST_COUNT),
        }
    return Names({
        "ticked": count, "applied": count, "links": links, "known_links": links,
        "force": vectors(n, m), "waiting_agent": agent,
        "waiting_time": Table("i8", (waiting,), least=0, most=MOST_COUNT),
        "waiting_force": vectors(waiting, m), "crossing_time": Table("f8", (None,), least=0.0),
        "crossing": Table("i8", (None, 3), least=0, most=max(n, graphs) - 1),
        "closest": Table("f8", (2, 4), finite=False), "sums": Table("f8", (4,), finite=False),
        "errors": Table("f8", (4,), least=0.0, finite=False),
        **known, **bodies,
    }, noise)  # fmt: skip


def _check_waiting(arrays: Arrays, ticks: PeriodicTimes, latency: Instants) -> None:
    """What waits are the forces of the ticks that have been and do not act yet."""
    ticked, applied = arrays["ticked"], arrays["applied"]
    number = ticked - applied
    lengths = {len(arrays[f"waiting_{name}"]) for name in ("time", "agent", "force")}
    must((number >= 0).all() and lengths == {int(number.sum())}, "waiting_time", "be one for each force that waits")
    agents = np.repeat(np.arange(len(number)), number)
    k = applied[agents] + np.arange(len(agents)) - np.repeat(np.cumsum(number) - number, number)
    times = ticks.at(agents, k) + latency[agents]
    order = np.lexsort((agents, times))
    must((arrays["waiting_time"] == times[order]).all(), "waiting_time", "be a latency after the ticks")
    must((arrays["waiting_agent"] == agents[order]).all(), "waiting_agent", "be whose ticks they are")


def _take_gusts(arrays: Arrays, fresh: SampledMemory, now: tuple[float, float]) -> None:
    """The gusts in force are those of the time reached."""
    for source, number in zip(fresh.actuation.gusts, arrays.get("gusts", np.zeros(0)).tolist(), strict=True):
        least, most = (int(at) // source.period for at in now)
        must(least <= number <= most, "gusts", "be those of the time reached")
        source.take(number)
    fresh.motion.beside = fresh.actuation.beside(np.arange(len(arrays["begin"])))


class _ClosedForm:
    """Polynomials of each agent, which follow from its force.

    Parameters
    ----------
    fresh
        Memory of a session at its start.
    """

    def __init__(self, fresh: SampledMemory) -> None:
        self._fresh = fresh

    @property
    def numbers(self) -> Mapping[str, Form[object]]:
        """None."""
        return {}

    @property
    def tables(self) -> Mapping[str, Table]:
        """When polynomials began, their coefficients, and what stands between forces and motion."""
        motion, gusts = self._fresh.motion, self._fresh.actuation.gusts
        _, n, m = motion.coefficients.shape
        found = {"begin": Table("i8", (n,), least=0, most=MOST_COUNT), "coefficients": vectors(motion.degree + 1, n, m)}
        if gusts:
            found |= {"wanted": vectors(n, m), "gusts": Table("i8", (len(gusts),), 0, MOST_COUNT)}
        if motion.lag is not None:
            found["lag"] = vectors(n, m)
        if motion.heading is not None:
            found["heading"] = Table("f8", motion.heading.shape, -1.0 - NEAR, 1.0 + NEAR)
        return found

    def check(self, arrays: Arrays, began: Instants, now: tuple[float, float]) -> None:
        """Pieces begin where forces change or the last piece ends, and follow from the force that acts."""
        _take_gusts(arrays, self._fresh, now)
        _check_motion(arrays, self._fresh, began, now)

    def ends(self, arrays: Arrays) -> Array:
        """When pieces of motion end, or a gust does."""
        motion, gust = self._fresh.motion, self._fresh.actuation.next_gust()
        motion.begin, motion.force, motion.lag = arrays["begin"], arrays["force"], arrays.get("lag")
        ends = motion.ends() if gust is None else np.minimum(motion.ends(), gust)
        return np.asarray(ends * NANOSECOND)

    def places(self, arrays: Arrays) -> Places:
        """By the polynomials."""
        return _polynomials(arrays["begin"], arrays["coefficients"])

    def looks(self, arrays: Arrays, column: str) -> Places:
        """By the velocities of the polynomials."""
        return _polynomials(arrays["begin"], rates_of(arrays["coefficients"]))


def _polynomials(begin: Instants, C: Array) -> Places:
    """Vectors by their Taylor coefficients ``C`` about the nanosecond at which the piece of each agent began."""

    def at(agents: Indices, time: Array) -> Array:
        s: Array = (time - (begin * NANOSECOND)[agents])[..., None]
        found: Array = C[-1][agents]
        for k in range(len(C) - 2, -1, -1):
            found = found * s + C[k][agents]
        return found

    return at


def _check_motion(arrays: Arrays, fresh: SampledMemory, began: Instants, now: tuple[float, float]) -> None:
    """Pieces begin where forces change or the last piece ends, and follow from the force that acts."""
    motion, begin, C, force = fresh.motion, arrays["begin"], arrays["coefficients"], arrays["force"]
    everyone = np.arange(len(begin))
    for source in fresh.actuation.gusts:
        began = np.maximum(began, source.number * source.period)
    age = begin - began
    steady = np.isfinite(motion.largest_rate).any()
    # Pieces of their own length begin together, whosever ended.
    short = motion.longest < LONGEST_PIECE
    together = len(np.unique(begin[short & (age > 0)])) <= 1
    fits = (age >= 0) & (steady | (age == 0) | (short & together)) & (begin <= now[1])
    fits &= np.minimum(begin, MOST_COUNT - motion.longest) + motion.longest >= min(now[0], float(MOST_COUNT))
    must(fits.all(), "begin", "be when the pieces of motion began")
    if fresh.actuation.gusts:
        with np.errstate(over="ignore", invalid="ignore"):
            again = fresh.actuation.exerted(everyone, arrays["wanted"], C[1])
            fits = np.abs(again - force) <= ROUNDED * np.abs(force)
        must(fits.all(), "force", "be what bodies exert for the desired one")
    first = begin == 0
    given = C[: motion.order]
    must((given == motion.coefficients[: motion.order])[:, first].all(), "coefficients", "begin at the start")
    for name, at_start in (("lag", motion.lag), ("heading", motion.heading)):
        if at_start is not None:
            must((arrays[name] == at_start)[first].all(), name, "begin at the start")
    if motion.heading is not None:
        lengths, at_start = (np.sqrt((x**2).sum(axis=1)) for x in (arrays["heading"], motion.heading))
        # In a mixture agents without a heading have a zero one.
        must((np.abs(lengths - at_start) <= NEAR).all(), "heading", "be unit vectors")
    with np.errstate(over="ignore", invalid="ignore"):
        drive = Drive(force, motion.beside, arrays.get("lag"))
        again = motion.piece(everyone, given[0], given[-1], drive)
        size = motion.piece(everyone, given[0], given[-1], drive, sizes=True)
        must((np.abs(again - C) <= ROUNDED * size).all(), "coefficients", "be those of the motion under the force")
        span = np.minimum(motion.longest, now[1] - begin + PER_SECOND) * NANOSECOND
        reach = sum(np.abs(C[k]) * span[:, None] ** k for k in range(len(C)))
    must((np.asarray(reach) <= LARGEST).all(), "coefficients", "keep the agents within numbers that can be squared")


def _check_crossings(
    arrays: Arrays, every: tuple[LinkRules, dict[int, GraphView], dict[int, MarginsInPieces]], now: float,
    spans: tuple[float, Array], where: tuple[Space, Places],
) -> None:  # fmt: skip
    """Crossings lie in the future, at their distances, and agree with the distances at the ends of pieces."""
    (rules, views, margins), (slack, ends), (space, places) = every, spans, where
    time, rows = arrays["crossing_time"], arrays["crossing"]
    must(len(time) == len(rows), "crossing", "have as many rows as crossing_time")
    must((rows[:, 2] < len(rules.ways)).all() and (rows[:, :2] < len(ends)).all(), "crossing",
          "name agents and graphs that there are")  # fmt: skip
    i, j, graph = rows.T
    by_view = np.array([0, *(1 if view.mutual else 2 for view in views.values())])
    seen = np.array([(list(views).index(k) + 1) if k in views else 0 for k in range(len(rules.ways))])
    ways = np.where(seen[graph] > 0, by_view[seen[graph]], rules.ways[graph])
    must(((ways > 0) & (i != j) & ((i < j) | (ways == 2))).all(), "crossing", "name pairs whose links switch")
    late = np.minimum(ends[i], ends[j])
    early = (time >= now - slack - 2.0 * NANOSECOND) & (time <= late + slack + 2.0 * NANOSECOND)
    must(early.all(), "crossing_time", "lie between now and the end of a piece of motion")
    order = list(zip(time.tolist(), *rows.T.tolist(), strict=True))
    must(order == sorted(set(order)), "crossing", "be in order")
    links = arrays["links"].copy()
    everyone = np.arange(len(ends))
    size = NEAR * float(np.abs(places(everyone, np.full(len(ends), now))).max())
    from_, to = places(i, time), places(j, time)
    distance = np.linalg.norm(space.displacement(to - from_), axis=-1)
    for row in range(len(time)):
        a, b, k = rows[row].tolist()
        level = (rules.break_ if links[k, a, b] else rules.appear)[k, a]
        off = distance[row] - level
        if k in views:
            offset = space.displacement(to[row] - from_[row])[None]
            inside, sure = margins[k].at(np.array([a]), np.array([b]), offset, time[[row]])
            off = inside[0] if sure[0] else 0.0
        must(abs(off) <= NEAR * level + size, "crossing_time", "be when a pair is at its distance")
        links[k, a, b] = not links[k, a, b]
        if ways[row] == 1:
            links[k, b, a] = links[k, a, b]
    until = np.minimum(ends[:, None], ends[None])
    for name, at, there in (
        ("links", np.full(until.shape, now), arrays["links"]), ("crossing", np.maximum(until, now), links),
    ):  # fmt: skip
        pairs = np.broadcast_to(everyone[:, None], at.shape)
        offset = space.displacement(places(pairs.T, at) - places(pairs, at))
        apart = np.linalg.norm(offset, axis=-1)
        for k in np.flatnonzero(rules.ways).tolist():
            appear, break_ = rules.appear[k][:, None], rules.break_[k][:, None]
            fits = np.where(there[k], apart <= break_ * (1.0 + NEAR) + size, apart >= appear * (1.0 - NEAR) - size)
            np.fill_diagonal(fits, True)
            must(fits.all(), name, "fit the distances of the agents")
        for k, view in views.items():
            slackened = NEAR * view.radii[:, None] + size
            rows_of = [margins[k].at(np.full(len(ends), i), everyone, offset[i], at[i]) for i in everyone.tolist()]
            inside, sure = np.array([x for x, _ in rows_of]), np.array([x for _, x in rows_of])
            fits = np.where(there[k], inside >= -slackened, inside <= slackened) | ~sure
            np.fill_diagonal(fits, True)
            must(fits.all(), name, "fit the fields of view of the agents")


def _check_obstacle_ranges(
    arrays: Arrays, obstacle_ranges: ObstacleRanges, when: tuple[float, float, float], places: Places
) -> None:
    """Agents stated to be within range of obstacles are, and crossings of the range lie in the future, at the range."""
    (base, now, slack), time, rows = when, arrays["meeting_time"], arrays["meeting"]
    must(len(time) == len(rows), "meeting", "have as many rows as meeting_time")
    counts = np.array([there.shape[1] for there in obstacle_ranges.near])
    agents, group, obstacle = rows.T
    must(
        (agents < len(obstacle_ranges.ends)).all() and (group < len(counts)).all(), "meeting", "name agents and groups"
    )
    must((obstacle < counts[group]).all(), "meeting", "name obstacles that there are")
    must(len(np.unique(rows, axis=0)) == len(rows), "meeting", "name an agent and an obstacle once")
    must((np.diff(time) >= 0.0).all(), "meeting_time", "be in order")
    late = time <= obstacle_ranges.ends[agents] + slack + 2.0 * NANOSECOND
    must((late & (time >= now - slack - 2.0 * NANOSECOND)).all(), "meeting_time", "lie between now and the next change")
    everyone = np.arange(len(obstacle_ranges.ends))
    here = places(everyone, np.full(len(everyone), now))
    first = 0
    for number, there in enumerate(obstacle_ranges.near):
        near = arrays["near_obstacles"][:, first : first + there.shape[1]]
        first += there.shape[1]
        level, size = obstacle_ranges.ranges[number], NEAR * (1.0 + float(np.abs(here).max()))
        away = obstacle_ranges.distances(number, here, base + now)
        must(np.where(near, away <= level + size, away >= level - size).all(), "near_obstacles", "fit the distances")
        mine = group == number
        which = agents[mine], time[mine]
        at = obstacle_ranges.clearance(number, places(*which), base + which[1], obstacle[mine])
        must((np.abs(at - level) <= size).all(), "meeting_time", "be when an agent is at the range of an obstacle")


def _check_knowledge(arrays: Arrays, fresh: Knowledge, ticks: PeriodicTimes) -> None:
    """All agents have the newest samples that had arrived when they acted, and all samples in use are kept."""
    check_samples(arrays, fresh)
    if fresh.messages is None:
        return
    acted, newest = np.flatnonzero(arrays["ticked"]), arrays["newest"]
    must((np.delete(newest, acted, axis=0) == START).all(), "newest", "name no samples before an agent acts")
    check_newest(arrays, fresh, acted, ticks.at(acted, arrays["ticked"][acted] - 1))
