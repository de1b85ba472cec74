"""A running simulation of messages under continuous control: adaptive steps between the instants of messages."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from flocking.arrays import AnyArray, Array, Indices, Links
from flocking.engine.delayed.delays import Delays
from flocking.engine.delayed.messages.instants import BEFORE
from flocking.engine.delayed.messages.leader_samples import LeaderSamples
from flocking.engine.delayed.messages.message_states import MessageStates
from flocking.engine.delayed.replacement import Replacement
from flocking.engine.delayed.session import CLOCK, DelayedSession
from flocking.engine.imperfect.messages.interventions import (
    KEPT,
    Interventions,
    check_information,
    packed_changes,
    unpacked_changes,
)
from flocking.engine.imperfect.messages.knowledge import Knowledge
from flocking.engine.imperfect.messages.leader_news import check_number_of_leaders, with_leaders
from flocking.engine.protocol.session import Packed, Stored
from flocking.engine.runs.fidelity import Fidelity
from flocking.engine.runs.message_log import CHANGED
from flocking.errors import UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.state import State
from flocking.model.world.information import Information, Messages
from flocking.model.world.times import NANOSECOND, PER_SECOND


class MessagesSession(DelayedSession):
    """Continuous control on what messages have stated, with known and true links located.

    At an instant, in whole nanoseconds, samples are taken, arrive, expire, then links follow, then forces jump. Between
    two instants what an agent knows of another one is constant, or moves on with the velocity that its newest message
    states, and links of knowledge switch where the known distance crosses a radius.

    Parameters
    ----------
    scenario
        What is simulated; its information are messages, its control is continuous.
    longest_step
        Longest step as a share of the shortest period of the messages, see `DelayedSession`.
    """

    def _prepare(self, scenario: Scenario, longest_step: float) -> None:
        super()._prepare(scenario, longest_step)
        self._in_use: list[AnyArray | None] = [None] * self.n
        """Entries of the log of what each agent uses; None where those from now on are logged anyway."""
        self._using = np.ones(self.n, dtype=bool)
        """Who may use something else than the log states."""
        self.interventions = Interventions()

    def _new_delays(self, scenario: Scenario) -> Delays:
        start = scenario.start
        # Agents of order 1 stand still before the start, whatever velocities it gives.
        sent = start.p if scenario.agents.order == 2 else np.zeros_like(start.p)
        self.knowledge = Knowledge(scenario.information, start.q, sent, self.links, scenario.space)
        led = isinstance(scenario.information, Messages) and scenario.information.leader
        leaders = LeaderSamples(scenario.law.leaders, self.knowledge, start.t) if led else None
        return MessageStates(self.knowledge, self.history, self._views, self._law.widths, leaders)

    @property
    def _states(self) -> MessageStates:
        assert isinstance(self.delays, MessageStates)
        return self.delays

    def _relink_known(self) -> None:
        self.knowledge.links = self.known_links
        self._law.relink(self.known_links & self._states.points.there, self.obstacles.known.pairs)
        self._states.prepare(*self._law.linked)

    # What falls on an instant.

    def _with_instant(self, seconds: float, rounding: float) -> float:
        """A time in seconds from the start, or that of the next instant where it is later by rounding alone.

        Samples are taken first: the velocities that agents of order 1 send must not depend on how equal times are
        rounded.
        """
        if self._law.order != 1:
            return seconds
        instant = self._states.points.following(seconds, self.known_links)
        return instant if 0.0 < instant - seconds <= rounding else seconds

    def _next_gust(self) -> float:
        found = super()._next_gust()
        return self._with_instant(found, CLOCK * found)

    def _next_gains(self) -> float:
        found = super()._next_gains()
        return self._with_instant(found, CLOCK * (abs(self._base) + abs(self._base + found)))

    def _seen(self, seconds: float) -> tuple[Array, Array]:
        """True positions and velocities before forces change at a time; of order 1 the velocity agents move with."""
        q, p = self.motion_at(seconds)
        if self._law.order == 1 and self._segment.t1 == self._segment.t0:
            p = np.zeros_like(p)
        return q, p

    def _hear(self, seconds: float) -> None:
        """Take up the instant at which the last step ended, if it is one of messages."""
        points = self._states.points
        instant = points.next
        if instant * NANOSECOND > seconds:
            return
        changed, leaders = points.hear(instant, lambda: self._seen(seconds))
        agents = np.flatnonzero(changed.any(axis=1) | leaders)
        if not agents.size:
            return
        own = changed.diagonal().copy()
        changed |= own[:, None]
        # Links of these pairs follow from what is known now, not from what was known until now.
        self.pending = self.pending[~changed[self.pending[:, 0], self.pending[:, 1]]]
        known = self.knowledge.known(instant, agents, *self._seen(seconds))
        self.obstacles.take(np.flatnonzero(own), known.own[own[agents], : self.m], self._base + seconds)
        before = self.known_links[:, agents].copy()
        self.knowledge.relink(known, self._known_rules, self._views_at(seconds))
        self.known_links[:, agents] = np.where(changed[agents], self.known_links[:, agents], before)
        self._using[agents] = True
        self._relink_known()
        self._begin_anew(seconds)
        self._check_slope()

    def _switch_known(self, seconds: float) -> None:
        """Switch the known links that are pending, and note whose they are."""
        self._using[self.pending[:, 0]] = True
        super()._switch_known(seconds)

    def _note(self, seconds: float) -> None:
        """Log what agents use from now on, where that is something else than before."""
        asked = np.flatnonzero(self._using)
        self._using[:] = False
        if not asked.size:
            return
        heard, log = self._states.points.heard, self.records.log
        assert log is not None
        found = self._uses(asked)
        new = [k for k, agent in enumerate(asked.tolist()) if _differ(found[k], self._in_use[agent])]
        if not new:
            return
        agents = asked[new]
        for k, agent in zip(new, agents.tolist(), strict=True):
            self._in_use[agent] = found[k]
        # Between two instants the whole nanosecond before is logged, but none before the last instant.
        instant = heard if heard * NANOSECOND == seconds else max(int(seconds * PER_SECOND), heard)
        force = self._force(seconds, np.array(self._segment.coefficients[-1]))
        log.act(instant, agents, force[agents], [found[k] for k in new])

    def _uses(self, agents: Indices) -> list[AnyArray]:
        """Entries of the log of what ``agents`` use, shape (entries, 3) each."""
        senders, sensed = self._law.linked
        offsets, leaders = self._law.offsets, self._states.points.leaders
        used = self.knowledge.used(agents, (senders, sensed, offsets))
        return with_leaders(used, None if leaders is None else leaders.newest[agents])

    # Changes, and saving.

    def replace(self, *, law: Law | None = None, state: State | None = None) -> None:
        """Replace the law or the state from the session's time on; samples that were taken state what they did.

        What falls on an instant of messages at this time comes first. Forces jump, by what agents know; the change of
        energy counts as a jump of the ledger. Agents know of another state of a neighbour when a sample arrives that
        was taken later, of their own at once, or by their next sample with ``self_known="measured"``. Graphs
        that a new law shares with the one before keep links and what agents know of them; under others both are those
        of a start, of whom something is known. A state with links sets those of the law's graph, and between agents
        that it does not move also what these know of them. An equal law changes nothing. Where leaders are known by
        messages, agents follow those of another law, in the order of its terms, by the samples of those before until
        one arrives that was taken later.

        Raises
        ------
        InvalidInput
            When law, state and agents disagree, or the new energy or a force is not finite; the session then goes on
            as it was.
        UnsupportedLaw
            When this engine cannot run the law, or it has another number of graphs, or of leaders that send messages.
        """
        if law is not None and len(law.graphs) != len(self.scenario.law.graphs):
            raise UnsupportedLaw(
                f"engine={self.engine!r} keeps the number of graphs of a law, {len(self.scenario.law.graphs)}, while "
                f"messages are under way: the log names graphs by number, and the law has {len(law.graphs)}. Start "
                "another run from run.state(-1)."
            )
        leaders = self._states.points.leaders
        if law is not None and leaders is not None:
            check_number_of_leaders(self.engine, len(leaders.leaders), law)
        try:
            super().replace(law=law, state=state)
        finally:
            if self._states.points.heard > BEFORE:
                self._note(self._now())

    def _part_from_what_is_saved(self) -> None:
        super()._part_from_what_is_saved()
        self.knowledge, self._using = self._states.knowledge, self._using.copy()

    def _go_on_with(self, new: Replacement, seconds: float, before: Array) -> None:
        super()._go_on_with(new, seconds, before)
        if self._states.points.leaders is not None:
            self._states.points.leaders.leaders = new.scenario.law.leaders
        # Nothing of the past is read, and a step before the last one could have a gap that no jump explains any more.
        self.history.drop(seconds)
        self._using[:], self._in_use = True, [None] * self.n

    def _renew_links(self, new: Replacement, seconds: float, y: Array, moved: Links) -> None:
        super()._renew_links(new, seconds, y, moved)
        self.known_links &= self._states.points.there

    def replace_information(self, information: Information) -> None:
        """Send messages in another way from now on: samples on their way arrive, or not, as before."""
        scenario = check_information(self.engine, self.scenario, information, (*KEPT, "expires", "self_known"))
        assert isinstance(information, Messages)
        self.scenario = scenario
        self.knowledge.change(information)
        self.interventions.times.append(self.time)

    @property
    def about(self) -> dict[str, object]:
        """Provenance of the records, and when the session was changed."""
        changed = sorted({*self.interventions.times, *self.replaced_at})
        return super().about | ({CHANGED: changed} if changed else {})

    @property
    def fidelity(self) -> Fidelity:
        """As of all sessions with adaptive steps, and whether this one was changed."""
        found = super().fidelity
        return dataclasses.replace(found, changed=found.changed or bool(self.interventions.times))

    def pack(self) -> Packed:
        """All that another session needs to go on bit for bit, but its scenario and its records."""
        (numbers, arrays), (more, rows) = super().pack(), packed_changes(self.interventions, self.knowledge)
        return numbers | more, arrays | rows

    def _recall_changes(self, packed: Packed) -> Packed:
        return super()._recall_changes(unpacked_changes(packed, self.interventions, self.knowledge))

    def _recall_log(self, stored: Stored) -> None:
        """Messages that earlier versions logged need nothing else: entries in use follow from what agents know."""

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> MessagesSession:
        """The session that was packed."""
        session = super().unpack(packed, stored, changes)
        assert isinstance(session, MessagesSession)
        session._using[:] = session._states.points.heard == BEFORE
        if session._states.points.heard > BEFORE:
            session._in_use = list(session._uses(np.arange(session.n)))
        return session


def _differ(one: AnyArray, other: AnyArray | None) -> bool:
    """Whether entries of the log differ from others, or these are to be logged whatever they are."""
    return other is None or not np.array_equal(one, other)
