"""The error of a running solution, and its consequences for switches and extreme values."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from flocking.engine.adaptive_steps.segment import ROUNDING, Segment
from flocking.engine.exact.companion import (
    Companion,
    Difference,
    StateError,
    companion_gap,
    unexplained_energy,
)
from flocking.engine.exact.crossings.coincidences import kick_of
from flocking.engine.exact.crossings.images import nearest_shift
from flocking.engine.exact.crossings.obstacle_approaches import ObstacleStep
from flocking.engine.exact.crossings.switch_numbers import beyond_level, radial_motion, switch_errors
from flocking.engine.exact.crossings.switching import Crossing, LinkState, slack_of
from flocking.engine.exact.crossings.view_guards import Bearing, ViewGuard, of_pair
from flocking.engine.exact.dynamics import LEDGER, Dynamics
from flocking.engine.exact.extremes import Extremes
from flocking.engine.exact.origin import Origin
from flocking.engine.exact.recorder import ExactRecorder
from flocking.engine.exact.uncertain_switches import DoubtMemory, Doubts, Passages, Settled
from flocking.engine.imperfect.view_switches import crosses_radius
from flocking.engine.runs.run import DoubtRow
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.model.space import Space

MOST_DOUBTS = 2000
"""Number of switches in doubt after which the rest of a run counts as unknown."""


@dataclass(frozen=True, eq=False)
class ErrorMemory:
    """State of the error estimate.

    Parameters
    ----------
    difference
        Difference of the companion.
    doubts
        Pairs that are within the error of a switch, as plain data.
    """

    difference: Difference
    doubts: DoubtMemory


class SolutionError:
    """Estimates the error of a solution and records switches that it leaves open.

    Parameters
    ----------
    dynamics
        The law in force.
    recorder
        Takes switches in doubt and extreme values.
    memory
        State to go on from; an exact start when absent.
    size
        Size of the state vector.
    """

    def __init__(
        self, dynamics: Dynamics, recorder: ExactRecorder, size: int, memory: ErrorMemory | None = None
    ) -> None:
        self._dynamics = dynamics
        self._recorder = recorder
        law = dynamics.layout.law
        self.reach = min((float(np.min(np.asarray(g.break_radius))) for g in law.graphs), default=np.inf)
        """Shortest reach of a graph."""
        difference = Difference.none(size) if memory is None else memory.difference
        self._companion = Companion(dynamics, difference, self.reach)
        self._doubts = Doubts()
        if memory is not None:
            self._doubts.recall(memory.doubts)
        self._passages = Passages(dynamics)
        self._jump: tuple[float, Array] | None = None
        self._explained: tuple[Segment, float] | None = None
        self._foreseen: tuple[Segment, Difference, StateError] | None = None

    @property
    def memory(self) -> ErrorMemory:
        """State of the estimate."""
        return ErrorMemory(self.difference, self._doubts.memory())

    @property
    def difference(self) -> Difference:
        """Difference of the companion from the solution on the step followed last."""
        return self._companion.difference

    @difference.setter
    def difference(self, value: Difference) -> None:
        self._companion.difference = value

    @property
    def in_doubt(self) -> bool:
        """Whether a pair is within the error of a switch that it has not made, or has made with doubt on record."""
        return self._doubts.open

    @property
    def fresh(self) -> Array:
        """Pairs that have switched and are not beyond the error yet, as rows, see `Doubts.fresh_rows`."""
        return self._doubts.fresh_rows()

    def take_fresh(self, rows: Array, links: LinkState) -> None:
        """Take such ``rows`` in place of those known, under the watches of ``links``."""
        self._doubts.take_fresh(rows, links)

    def know(self, segment: Segment, errors: Array) -> None:
        """Store the results of the native loop for the step ``segment`` followed last, see `leave`.

        Parameters
        ----------
        errors
            See `flocking.engine.exact.blocks.loop.step_block`.
        """
        *numbers, unexplained = errors.tolist()
        self._companion.know(segment, numbers)
        self._explained = (segment, unexplained)

    @property
    def known_until(self) -> float:
        """User time from which on nothing is known; infinite if the solution is known."""
        return self.difference.lost + self._dynamics.base

    def follow(self, segment: Segment, *, again: bool = False) -> None:
        """Estimate the error on a step ``segment``; ``again``: on the first part of the step followed last."""
        self._companion.follow(segment, self.difference.nodes[0] if again else None)

    def over(self, segment: Segment) -> StateError:
        """Errors on the step ``segment`` followed last."""
        return self._companion.over(segment)

    def once_left(self, segment: Segment, links: LinkState) -> StateError:
        """Errors on the step followed last as they are known once it is left, with the doubts that end in it.

        Errors of frames do not depend then on whether a session stops within the step. Nothing is put on record.

        Parameters
        ----------
        segment
            The step.
        links
            Links on it.
        """
        if not segment.t1 > segment.t0:
            return self.over(segment)
        seen = self._foreseen
        if seen is not None and seen[0] is segment and seen[1] is self.difference:
            return seen[2]
        difference, doubts, rows = self.difference, self._doubts, len(self._recorder.doubts)
        self._doubts = Doubts()
        self._doubts.recall(doubts.memory())
        try:
            self._settle(self._doubts.follow(segment, links, self.over(segment)), segment, links)
            self._look_at_passages(segment)
            found = self.over(segment)
        finally:
            self.difference, self._doubts = difference, doubts
            del self._recorder.doubts[rows:]
        self._foreseen = (segment, difference, found)
        return found

    def leave(self, segment: Segment, links: LinkState, origin: Origin) -> None:
        """Record the step ``segment`` followed last, relative to ``origin``, before the crossings at its end."""
        error = self.over(segment)
        nearby = links.nearby_on(segment)
        self._recorder.extremes.follow(segment, links.links[0], error, origin, links.space, nearby)
        self._recorder.extremes.add_to_ledger(segment, self._unexplained(segment), origin.time)
        self._settle(self._doubts.follow(segment, links, error), segment, links)
        self._look_at_passages(segment, left=True)
        links.leave(segment, segment.motion(*self._sizes, self._dynamics.order))

    def _unexplained(self, segment: Segment) -> float:
        """Difference of the ledger residuals of the solution and of the companion on a step.

        Without integration error a residual is zero, so this is the part of it that the error alone explains, whatever
        law the ledger belongs to.
        """
        if self.known_until < np.inf:
            return np.inf
        if self._explained is not None and self._explained[0] is segment:
            return self._explained[1]
        nodes, gaps = self.difference.nodes, []
        integrated = self._dynamics.motion_size
        ends = (segment.t0, segment.coefficients[0], nodes[0]), (segment.t1, segment.coefficients[-1], nodes[-1])
        with np.errstate(all="ignore"):
            for t, y, e in ends:
                _, dissipated, supplied = e[integrated : integrated + LEDGER]
                found = self._dynamics.energy(t, y + e)[0], self._dynamics.energy(t, y)[0]
                gaps.append(companion_gap(*found, dissipated, supplied))
            return float(unexplained_energy(*gaps))

    def _look_at_passages(self, segment: Segment, *, left: bool = False) -> None:
        """Take in what is open where two agents pass each other at one point, or may turn back there."""
        if not self._dynamics.pointed:
            return
        error, order = self.over(segment), self._dynamics.order
        for found in self._passages.on(segment, error, self._velocities(segment), left=left):
            if found.undecided:
                self._companion.lose(found.time)
            elif found.passed and not error.lost:
                self._companion.push(kick_of(found, segment.t1 - segment.t0, order, self.difference.nodes[-1]))

    def _settle(self, settled: list[Settled], segment: Segment, links: LinkState) -> None:
        for doubt in settled:
            self._recorder.doubts += self._in_user_time([doubt.row])
            begin, end = doubt.row[:2]
            if len(self._recorder.doubts) > MOST_DOUBTS:
                self._companion.lose(begin)
            if self.known_until < np.inf:
                continue
            number, i, j = doubt.key
            watch = links.watches[number]
            if watch.kind == "link" and watch.enter[i] < watch.leave[i]:
                # Whether it is linked from then on is open.
                self._companion.lose(begin)
                continue
            self._push(number, i, j, segment, links, end - begin, doubt.row[9])

    def _push(
        self, number: int, i: int, j: int, segment: Segment, links: LinkState, longest: float, bound: float
    ) -> None:
        """Add the effect of the force while a pair in doubt was on the other side of its distance."""
        t, y = segment.t1, segment.coefficients[-1]
        memory = links.memory()
        try:
            before = self._dynamics.slope(t, y)
            links.apply(Crossing(number, np.array([[i, j]])), self._dynamics.split(y)[0])
            self._dynamics.relink(links)
            change = self._dynamics.slope(t, y) - before
        except InvalidInput:
            change = np.full_like(y, np.inf)
        finally:
            links.recall(memory)
            self._dynamics.relink(links)
        if not change.any():
            return
        if not np.isfinite(change).all():
            self._companion.lose(t)
            return
        if number >= links.first_level:
            motion = segment.motion(*self._sizes, self._dynamics.order)
            acceleration = ObstacleStep(links, segment, motion.positions).acceleration(number, i, j)
        else:
            *_, acceleration = _radial(segment, i, j, *self._sizes, links.space)
            if (view := links.view_of(number)) is not None and segment.t1 > segment.t0:
                side = self._at_side(segment, (i, j), view, float(links.watches[number].leave[i]))
                if side is not None:
                    acceleration = side.bend / side.steep if side.steep > 0.0 else 0.0
        since = longest
        if acceleration:
            longest = min(longest, 3 * float(np.sqrt(2 * bound / abs(acceleration))))
        kick = change * longest
        if self._dynamics.order == 2:
            # The force acted some time since the doubt began, and the velocity has moved the agents from then on.
            count = self._dynamics.n * self._dynamics.m
            kick[:count] += kick[count : 2 * count] * since
        self._companion.push(kick)

    def _agent(self, y: Array, i: int) -> Array:
        """Position of an agent in a state vector ``y``, shape (m,)."""
        return y[i * self._dynamics.m : (i + 1) * self._dynamics.m]

    def _velocities(self, segment: Segment) -> Array:
        """Differences of the velocities, shape (k, N m): those of agents of order 1 are their slopes."""
        count = self._dynamics.n * self._dynamics.m
        if self._dynamics.order == 2:
            return self.difference.nodes[:, count : 2 * count]
        slope, other = self.slopes(segment)
        return (other - slope)[None, :count]

    def slopes(self, segment: Segment) -> tuple[Array, Array]:
        """Slopes of solution and companion at the end of ``segment``, see `Companion.slopes`."""
        return self._companion.slopes(segment)

    @property
    def _sizes(self) -> tuple[int, int]:
        return self._dynamics.n, self._dynamics.m

    def crossing(
        self, crossing: Crossing, k: int, speed: float, segment: Segment, links: LinkState
    ) -> tuple[float, float]:
        """Errors of the time and the speed at which pair ``k`` of a crossing crosses, before it switches.

        Parameters
        ----------
        speed
            Rate of change of its distance.
        segment
            The step at whose end it crosses.
        """
        watch, error = links.watches[crossing.watch], self.over(segment)
        i, j = (int(x) for x in crossing.pairs[k])
        if self.known_until < np.inf:
            return np.inf, np.inf
        if not segment.t1 > segment.t0:
            # A given state crosses at once: without motion before it there is no estimate of its error.
            self._companion.lose(segment.t1)
            return np.inf, np.inf
        if watch.kind in ("obstacle", "rim"):
            bound, drift, level = error.agent(i), np.inf, crossing.watch - links.first_level
            if links.contacts.levels[level].jumps:
                self._settle(self._doubts.cross(crossing, k, segment.t1, links, bound), segment, links)
            y, e = (self._agent(x, i) for x in (segment.coefficients[-1], self.difference.nodes[-1]))
            off = links.contacts.farther(watch.graph - len(links.graphs), t := segment.t1 + links.base, y, e, j)
            beyond = links.contacts.beyond(level, t, y, j, error.q_floor)
            late, drift, delay = switch_errors(bound, drift, speed, off, 0.0, 0.0, beyond)
        else:
            bound, view = error.pair(i, j), links.view_of(crossing.watch)
            drift = error.pair_velocity(i, j, self._velocities(segment))
            turned = 0.0 if view is None else float(view.heading_errors(segment, error.column)[i])
            most = bound if view is None else bound + float(watch.leave[i]) * turned
            self._settle(self._doubts.cross(crossing, k, segment.t1, links, most), segment, links)
            apart, off, turning, bend = _radial(segment, i, j, *self._sizes, links.space, self.difference.nodes[-1])
            side = None if view is None else self._at_side(segment, (i, j), view, float(watch.leave[i]))
            # It counts from where the pair is that far beyond the distance.
            beyond = slack_of(watch, error.q_floor / ROUNDING)
            if side is None:
                beyond = beyond_level(apart, watch.level(i, bool(links.near[crossing.watch][i, j])), beyond)
            late, drift, delay = switch_errors(bound, drift, speed, off, turning, bend, beyond)
            if side is not None:
                most = bound * side.steep + float(np.linalg.norm(apart)) * turned * side.turned
                late, _, delay = switch_errors(most, 0.0, side.rate, side.off, 0.0, side.bend, abs(side.inside))
        if not np.isfinite(late):
            self._companion.lose(segment.t1)
            return np.inf, np.inf
        if self._jump is None or abs(delay) > abs(self._jump[0]):
            # The slope of the polynomial has the error of a step over a part of its length.
            self._jump = (delay, self._dynamics.slope(segment.t1, segment.coefficients[-1]))
        # The user's time is resolved no finer.
        return late + float(np.spacing(abs(segment.t1 + self._dynamics.base))), drift

    def _at_side(self, segment: Segment, pair: tuple[int, int], view: ViewGuard, radius: float) -> Bearing | None:
        """How a ``pair`` at a side of a ``view`` stands to it at the end of a step; None at its ``radius``."""
        (i, j), m, C, e = pair, self._dynamics.m, segment.coefficients, self.difference.nodes[-1]
        apart = C[:, j * m : (j + 1) * m] - C[:, i * m : (i + 1) * m]
        found = view.bearing(segment, pair, apart, of_pair(e, pair, m), e)
        return None if crosses_radius(radius, float(np.linalg.norm(apart[-1])), found.inside) else found

    def switched(self, slope: Array) -> None:
        """Update the difference after a switch of the law; ``slope`` is the slope after it."""
        if self._jump is not None:
            delay, before = self._jump
            self._jump = None
            self._companion.push((before - slope) * delay)

    def abandon(self, t: float, links: LinkState) -> None:
        """Record the doubts open at time ``t`` and drop them: the watches of ``links`` end."""
        self._recorder.doubts += self._in_user_time(self._doubts.open_rows(t, links))
        self._doubts = Doubts()

    def until_now(
        self, segment: Segment, t: float, links: LinkState, origin: Origin
    ) -> tuple[list[DoubtRow], Extremes]:
        """Switches in doubt and extreme values until time ``t`` on the step followed last, which goes on.

        Rows of `flocking.engine.runs.run.DOUBT_FIELDS`; nothing is put on record.

        Parameters
        ----------
        segment
            The step followed last.
        t
            Until when, on that step or at its end.
        links
            Links on it.
        origin
            What its time and coordinates are relative to.
        """
        doubts, extremes = Doubts(), self._recorder.extremes.copy()
        doubts.recall(self._doubts.memory())
        part = segment.until(t)
        rows = list(self._recorder.doubts)
        if part.t1 > part.t0:
            error = self.over(segment)
            extremes.follow(part, links.links[0], error, origin, links.space, links.nearby_on(part))
            rows += self._in_user_time([settled.row for settled in doubts.follow(part, links, error)])
        return rows + self._in_user_time(doubts.open_rows(t, links)), extremes

    def _in_user_time(self, rows: list[DoubtRow]) -> list[DoubtRow]:
        """Rows with the user's times in place of the session's own."""
        base = self._dynamics.base
        return [(row[0] + base, row[1] + base, row[2] + base, *row[3:]) for row in rows]

    def take_over(self, other: SolutionError, *, exact: bool) -> None:
        """Go on from the ``other`` estimate under a new law; ``exact``: from a given state."""
        known, mine = other.difference, self.difference
        nodes = np.zeros_like(mine.nodes)
        if not exact:
            size = min(nodes.shape[1], known.nodes.shape[1])
            nodes[:, :size] = known.nodes[-1, :size]
        self.difference = replace(mine, nodes=nodes, lost=known.lost)


def _radial(
    segment: Segment, i: int, j: int, n: int, m: int, space: Space, difference: Array | None = None
) -> tuple[Array, float, float, float]:
    """Difference of the positions of two agents at the end of a segment, shape (m,), and their `radial_motion` where
    the state vectors differ by ``difference``.
    """
    C = segment.coefficients
    apart = C[:, j * m : (j + 1) * m] - C[:, i * m : (i + 1) * m]
    if not space.is_open:
        apart = apart + nearest_shift(space, apart[-1])
    e = np.zeros(m) if difference is None else of_pair(difference, (i, j), m)
    return apart[-1], *radial_motion(apart, segment.t0, segment.t1, e)
