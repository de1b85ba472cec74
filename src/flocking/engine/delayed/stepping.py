"""Steps of delayed knowledge: adaptive ones of order 8, no longer than the delay, that end where links switch."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.engine.adaptive_steps.adaptive_session import AdaptiveSession
from flocking.engine.adaptive_steps.segment import Segment
from flocking.engine.adaptive_steps.state_vectors import place_of
from flocking.engine.adaptive_steps.step_lengths import StepLengths
from flocking.engine.adaptive_steps.stepper import Stepper, StepperMemory
from flocking.engine.delayed.delayed_law import DelayedLaw
from flocking.engine.delayed.delays import Delays, OneDelay
from flocking.engine.delayed.history import History, position_series, split_state
from flocking.engine.delayed.known_links import followed_links, without_end
from flocking.engine.delayed.met_obstacles import NOBODY, Crossings, MetObstacles
from flocking.engine.delayed.pair_delays import PairDelays
from flocking.engine.imperfect.graph_views import turns_with_bodies, views_now, with_bodies
from flocking.engine.imperfect.powers import FIFTEEN, Powers, integrated
from flocking.engine.imperfect.session import ImperfectSession
from flocking.engine.imperfect.true_law import check_forces
from flocking.errors import InvalidInput, NotFinite
from flocking.model.law import Scenario
from flocking.model.world.information import Delayed

SLIDING = 100
"""Successive steps cut short by switches after which an error reports that links switch to and fro without end."""

SLIDING_SHARE = 1e-6
"""Longest such step, over the least delay."""


class DelayedSteps(AdaptiveSession, ImperfectSession):
    """The motion of a session of delayed knowledge, with known and true links located.

    Parameters
    ----------
    scenario
        What is simulated; its information is delayed.
    longest_step
        Longest step as a share of the least delay, at most 1. Of runs that repeat another with shorter steps, which are
        not saved: a session that is unpacked has 1 again.

    Attributes
    ----------
    known_links
        Links by what agents know, shape (graphs, N, N).
    history
        The past.
    pending
        Known links that switch at the end of the last step, rows (i, j, graph).
    obstacles
        Which agents are within range of obstacles, in truth and by what they know of themselves.
    delays
        How late agents know each other, and where steps end because of it.
    """

    engine = "delayed"
    rule = FIFTEEN
    rounding_alone = False
    _segment: Segment
    _everybody: Indices

    def __init__(self, scenario: Scenario, longest_step: float = 1.0) -> None:
        self._prepare(scenario, longest_step)
        y = np.array(self._segment.coefficients[-1])
        self.known_links = self.links_by_known_distances(self.links.copy(), 0.0, y)
        self.delays.points.jump(0.0, self._everybody, self.known_links)
        self._relink_known()
        self._follow_limits(0.0, y)
        self._stepper = self._new_stepper(0.0)
        self.begin()
        try:
            self._check_slope()
        except NotFinite as error:
            raise InvalidInput(
                "Scenario", "start", "must have finite forces by the states that agents have at it",
                f"agent {error.agents[0]}",
                "Another agent was where it is, one delay before the start. Move them apart.",
            ) from None  # fmt: skip
        self._record_frames(0.0)

    def _prepare(self, scenario: Scenario, longest_step: float) -> None:
        """Set all but what the forces at the start decide: a law that has replaced another has none there."""
        super().__init__(scenario)
        self._longest_step = longest_step
        start = scenario.start
        self._delayed_law = DelayedLaw(scenario)
        self.history = History(start.q, start.p, self._law.order)
        self.delays: Delays = self._new_delays(scenario)
        self.known_links = np.zeros_like(self.links)
        self.pending: Indices = np.zeros((0, 3), dtype=np.int64)
        self.obstacles = self._obstacles_at(0.0, self._law.joined(start))
        self._everybody = np.arange(self.n)
        self._short_steps = 0
        self._lengths = StepLengths(scenario.t_end - start.t)
        self._segment = Segment.resting(0.0, self._law.joined(start))
        self._gust_ends = scenario.agents.drawn_until(0.0)

    def _new_delays(self, scenario: Scenario) -> Delays:
        """What agents know of each other, and where steps end because of it."""
        assert isinstance(scenario.information, Delayed)
        tau, late = scenario.information.tau, scenario.information.self_delayed
        seen = self._views, self._law.widths
        if isinstance(tau, np.ndarray):
            return PairDelays(tau, self.history, *seen)
        return OneDelay(tau, late, self.history, *seen)

    @property
    def _law(self) -> DelayedLaw:
        return self._delayed_law

    def relink(self) -> None:
        """Take the true links and the obstacles within range as they are now."""
        self._pairs = self._law.pairs(self.links, self.obstacles.true.pairs)
        self._linked = int(self.links[0].sum())

    def _relink_known(self) -> None:
        self._law.relink(self.known_links, self.obstacles.known.pairs)

    def _obstacles_at(self, seconds: float, y: Array) -> MetObstacles:
        """Who is within range of obstacles at a time since the start at which the state vector is ``y``."""
        true = self._true(y)
        known = None if self.delays.knows_present else self.delays.own(seconds, true)[:, : self.m]
        return MetObstacles(self._law.law, true[:, : self.m], known, self._base + seconds)

    def links_by_known_distances(
        self, found: Links, seconds: float, y: Array, pairs: Links | None = None, turned: Links | None = None
    ) -> Links:  # fmt: skip
        """Links after the distances that agents know have become what they are.

        Parameters
        ----------
        found
            The links before, shape (graphs, N, N), which are changed.
        seconds, y
            Time since the start, and the true state vector.
        pairs
            Pairs whose distances jump, shape (N, N); all when absent.
        turned
            Agents whose bodies may have turned, shape (N,): they look along these at once.
        """
        if not self._rules.ways.any() and not self._views:
            return found
        own, known = self.delays.all_states(seconds, self._true(y))
        offset = self.scenario.space.displacement(known[..., : self.m] - own[:, None, : self.m])
        views = views_now(with_bodies(self._views, lambda: self._law.further(y)), lambda _: own[:, self.m :])
        jumping = np.ones((self.n, self.n), dtype=bool) if pairs is None else pairs
        for graph, followed in followed_links(self._known_rules, views, found, offset).items():
            at_once = turned if turns_with_bodies(self._views.get(graph)) else None
            found[graph] = np.where(jumping if at_once is None else jumping | at_once[:, None], followed, found[graph])
            np.fill_diagonal(found[graph], False)
        return found

    def _new_stepper(self, step: float) -> Stepper:
        """A stepper that goes on from the end of the last step; ``step`` is the proposed length, 0 for none."""
        segment = self._segment
        y = np.array(segment.coefficients[-1])
        memory = StepperMemory(segment.t1, y, self._slope(segment.t1, y), step)
        shape = self._law.order, self.n, self.m
        tolerances = self._law.tolerances(self.scenario.start)
        return Stepper(self._slope, self._stages, tolerances, memory, self._base, shape)

    # The motion.

    def _true(self, y: Array) -> Array:
        return split_state(y[: self._law.order * self.n * self.m], self.n, self.m)

    def _force(self, seconds: float, y: Array) -> Array:
        known = self.delays.states(seconds, self._true(y), *self._law.linked)
        return self._law.forces(self._base + seconds, *known, self.delays.leaders(seconds))

    def _slope(self, seconds: float, y: Array) -> Array:
        return self._law.slope(self._base + seconds, y, self._force(seconds, y))

    def _limit_signs(self, seconds: float, y: Array) -> Array:
        return self._law.limit_signs(self._base + seconds, y, self._force(seconds, y))

    def _follow_limits(self, seconds: float, y: Array) -> bool:
        """Change which limits of bodies act according to a state vector; whether one changed."""
        held = self._law.held
        if not held.limits:
            return False
        before = held.acting.copy()
        if not held.follow(self._limit_signs, seconds, y, self._law.put_held):
            return False
        changed = np.flatnonzero((held.acting != before).any(axis=0))
        self.delays.points.jump(seconds, changed, self.known_links)
        return True

    def _stages(
        self, first: int, last: int, state_stage: int, t: float, y: Array, h: float, K: Array, nodes: Array,
        weights: Array,
    ) -> Array:  # fmt: skip
        """Slopes of a step, see `flocking.engine.kernels.law_kernels.stages`; the state at ``state_stage``."""
        found = y
        for s in range(first, max(last, state_stage + 1)):
            z = y + h * (weights[s, :s] @ K[:s])
            if s == state_stage:
                found = z
            if s < last:
                K[s] = self._slope(t + nodes[s] * h, z)
        return found

    def motion_at(self, seconds: float, agents: Indices | slice = slice(None)) -> tuple[Array, Array]:
        """Positions and velocities of ``agents`` at ``seconds`` from the start, within the last step."""
        segment, count = self._segment, self.n * self.m
        if self._law.order == 2:
            q, p = segment.at(seconds)[: 2 * count].reshape(2, self.n, self.m)
            return q[agents], p[agents]
        if segment.t1 > segment.t0:
            y, slope = segment.with_slope(seconds)
        else:
            y = segment.at(seconds)
            slope = self._slope(seconds, y)
        return y[:count].reshape(self.n, self.m)[agents], slope[:count].reshape(self.n, self.m)[agents]

    def _series(self, seconds: float) -> Array:
        return position_series(self._segment, self.n, self.m, seconds)

    def _headings(self, seconds: float, column: str) -> Array:
        first = place_of(column, self._law.order, self.n, self.m, self._law.widths)
        return position_series(self._segment, self.n, self.m, seconds, first)

    def _integrated(self, length: float) -> tuple[Array, Array, float]:
        powers = self._powers(self.accounted)
        return integrated(powers, length, self.scenario.tolerance, self.largest_power, self.rule)

    def _powers(self, seconds: float) -> Powers:
        """Powers of the ledger as functions of the time from ``seconds`` since the start on."""

        def at(times: Array) -> Array:
            found = np.empty((len(times), 4))
            for row, s in enumerate((seconds + times).tolist()):
                true = self._true(y := self._segment.at(s))
                q, p = (np.ascontiguousarray(true[:, part]) for part in (slice(self.m), slice(self.m, None)))
                force = self._law.acting(self._base + s, y, self._force(s, y))
                found[row] = self._law.power(self._base + s, q, p, force, self._pairs)
            return found

        return at

    # Steps.

    def _next_change(self) -> float:
        return self._segment.t1

    def _change(self) -> None:
        """Record the step that ends, switch what agents know, and take the next step, up to the next such switch."""
        t = self._segment.t1
        self._end_step(t)
        self._change_bodies(t)
        self._note(t)
        points, links = self.delays.points, self.known_links
        points.reach(t, links)
        known = self.delays.jumps.following(t, points.rounding(t))
        bound = min(points.following(t, links), known, self._next_gains(), self._next_gust())
        before, crossings = self._stepper.memory, NOBODY
        try:
            segment = self._stepper.step(bound, self._longest_step * self.delays.least)
            if (bite := self._law.held.first_limit_change(self._limit_signs, segment)) is not None:
                segment = segment.cut(bite)
            if self._law.held.limits:
                end, y = segment.t1, segment.coefficients[-1]
                self._law.held.check(self._limit_signs(end, y), end)
            segment, crossings = self._met_on(segment)
            rows = self._known_switches(segment)
        except BaseException:
            self._stepper.recall(before)
            raise
        self.obstacles.crossings = crossings if not len(rows) else NOBODY
        if len(rows):
            self.pending = rows[rows[:, 0] <= rows[0, 0] + points.rounding(segment.t1), 1:].astype(np.int64)
            segment = segment.cut(min(float(rows[0, 0]) / (segment.t1 - segment.t0), 1.0))
        if segment.t1 > segment.t0:
            self._segment = segment
            self.history.add(segment, segment.t0 - self.delays.largest)
            self.steps += 1
            self._lengths.add(segment.t1 - segment.t0)
            self._watch(segment.t0, np.full(self.n, segment.t1 - segment.t0), np.ones(self.n, dtype=bool))
        self._short_steps = (
            self._short_steps + 1 if len(rows) and segment.t1 - t <= SLIDING_SHARE * self.delays.least else 0
        )
        # Its slope is computed anew, as it is when a saved run goes on: that of the last stage may differ in a bit.
        self._stepper.restart(self._segment.t1, np.array(self._segment.coefficients[-1]))

    def _end_step(self, t: float) -> None:
        """Record the step that ended, and switch what switches at its end, at time ``t``."""
        if self.accounted < t:
            self._account(t)
            self._record_row(t)
        self.delays.begin_step(t)
        self._hear(t)
        if len(self.pending):
            self._switch_known(t)
        if any(map(len, self.obstacles.crossings)):
            self._meet(t)
        if len(self.delays.jumps.times):
            self._know_jumps(t)

    def _hear(self, seconds: float) -> None:
        """Take up what becomes known at a time; nothing where the past is."""

    def _note(self, seconds: float) -> None:
        """Record what agents use from a time on; nothing where it is the past."""

    def _know_jumps(self, t: float) -> None:
        """Let agents know of states that were replaced a delay before ``t``: what they know jumps, and their forces."""
        pairs = self.delays.jumps.arriving(t, self.delays.points.rounding(t))
        if not pairs.any():
            return
        y = np.array(self._segment.coefficients[-1])
        self.known_links = self.links_by_known_distances(self.known_links.copy(), t, y, pairs)
        moved = np.flatnonzero(pairs.diagonal())
        self.obstacles.take(moved, self.delays.own(t, self._true(y))[moved, : self.m], self._base + t)
        self._relink_known()
        self.delays.points.jump(t, np.flatnonzero(pairs.any(axis=1)), self.known_links)
        self._begin_anew(t)
        self._check_slope()

    def _next_gust(self) -> float:
        """When a gust begins next, in seconds from the start."""
        return self._gust_ends

    def _change_bodies(self, t: float) -> None:
        """Take the gusts that begin now, and change which limits act."""
        held, y = self._law.held, np.array(self._segment.coefficients[-1])
        gust = t >= self._gust_ends
        if gust:
            held.draw(t)
            self._law.put_held()
            self._gust_ends = self.scenario.agents.drawn_until(t)
            self.delays.points.jump(t, self._everybody, self.known_links)
        if self._follow_limits(t, y) or gust:
            self._stepper.restart(t, y)

    def _begin_anew(self, seconds: float) -> None:
        """Go on under forces that have jumped, with the limits that act under them."""
        y = np.array(self._segment.coefficients[-1])
        self._follow_limits(seconds, y)
        self._stepper.restart(seconds, y)

    def _change_gains(self) -> None:
        """Take the next gains, at which the forces jump."""
        super()._change_gains()
        self.delays.points.jump(self._segment.t1, self._everybody, self.known_links)
        self._begin_anew(self._segment.t1)

    def _known_switches(self, segment: Segment) -> Array:
        """The first switches of known links on a step: rows (time since it began, i, j, graph)."""
        if not self._rules.ways.any() and not self._views:
            return np.zeros((0, 4))
        return self.delays.switches(self.scenario.space, segment, self._base, self.known_links, self._rules)

    def _met_on(self, segment: Segment) -> tuple[Segment, Crossings]:
        """A step up to the first moment at which an agent comes within range of an obstacle, or leaves it, and who."""
        obstacles, delays = self.obstacles, self.delays
        if not obstacles.true.groups:
            return segment, NOBODY
        true = [(self._everybody, [(segment.t0, segment.t1, position_series(segment, self.n, self.m, segment.t0))])]
        known = [] if delays.knows_present else delays.own_paths(segment)
        first, crossings = obstacles.first_on(self._base, true, known, delays.points.rounding)
        if first == np.inf:
            return segment, NOBODY
        return segment.cut(min((first - segment.t0) / (segment.t1 - segment.t0), 1.0)), crossings

    def _meet(self, seconds: float) -> None:
        """Let agents come within range of obstacles, or leave it, and begin anew with the forces that follow."""
        t, (true, known) = self._base + seconds, self.obstacles.cross()
        for agent, group, obstacle in true.tolist():
            (q,), (p,) = self.motion_at(seconds, np.array([agent]))
            self.records.switches.append(self.obstacles.true.record(t, agent, group, obstacle, (q, p)))
        if len(true):
            self.relink()
            before = self.energy
            self.energy, self.kinetic = self._energy(seconds)
            self.jumped += self.energy - before
            self._record_row(seconds)
        if len(known):
            self._relink_known()
            self.delays.points.jump(seconds, np.unique(known[:, 0]), self.known_links)
            self._begin_anew(seconds)
            self._check_slope()

    def _switch_known(self, seconds: float) -> None:
        """Switch the known links that are pending, and begin anew with the forces that follow."""
        for i, j, graph in self.pending.tolist():
            self.known_links[graph, i, j] = not self.known_links[graph, i, j]
        agents, switched = tuple(self.pending[0, :2].tolist()), np.unique(self.pending[:, 0])
        seen = int(self.pending[0, 2]) in self._views
        self.pending = np.zeros((0, 3), dtype=np.int64)
        self._relink_known()
        self.delays.points.jump(seconds, switched, self.known_links)
        self._begin_anew(seconds)
        self._check_slope()
        if self._short_steps > SLIDING:
            raise without_end(self._base + seconds, agents, seen=seen)

    def _check_slope(self) -> None:
        """Refuse to go on where no step is short enough for the forces."""
        rates = self._accelerations(self._stepper.memory.slope)
        check_forces(rates, self._base + self._stepper.memory.t, np.arange(self.n), self.scenario)

    # What others ask.

    def accelerations(self) -> Array:
        """Rates of change of the velocities now, shape (N, m); of agents of order 1 their velocities."""
        seconds = self.time - self._base
        return self._accelerations(self._slope(seconds, self._segment.at(seconds)))

    def _accelerations(self, slope: Array) -> Array:
        order, count = self._law.order, self.n * self.m
        return slope[(order - 1) * count : order * count].reshape(self.n, self.m)

    def _columns_at(self, seconds: float) -> dict[str, Array]:
        return self._law.further(self._segment.at(seconds))
