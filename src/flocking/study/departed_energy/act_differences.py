"""By how much each imperfection of what agents know changed the forces that they computed when they acted."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array
from flocking.engine.runs.message_log import LEADER, OWN, PRESENT
from flocking.engine.runs.run import Run
from flocking.model.law import Law
from flocking.model.world.information import Messages
from flocking.model.world.times import NANOSECOND
from flocking.study.departed_energy.true_links import SteppedLinks, TrueLinks, true_links
from flocking.study.message_logs.logged_world import LoggedWorld

KNOWLEDGE = ("noise", "loss", "delay", "links")
"""What may be wrong with what an agent knows, in the order in which it is switched off."""

Neighbours = list[tuple[int, int, Array, Array]]
"""Graph, agent, position and velocity of each neighbour."""


def imperfect(messages: Messages | None) -> tuple[bool, bool]:
    """Whether samples have errors, and whether messages are lost."""
    if messages is None:
        return False, False
    noisy = messages.noise is not None and not messages.noise.ideal
    lossy = messages.loss is not None and not messages.loss.ideal
    return noisy or bool(messages.resolution or messages.velocity_resolution), lossy


def act_differences(run: Run, world: LoggedWorld) -> Array:
    """By how much each of `KNOWLEDGE` changed the force of each act of a log, shape (4, acts, m).

    Parameters
    ----------
    run
        The run, under held control.
    world
        What its declared world states.
    """
    log = world.log
    found = np.zeros((len(KNOWLEDGE), len(log.ticks), world.m))
    links, act = true_links(run, world.motion), _Act(world)
    for row, (instant, agent, count) in enumerate(log.ticks.tolist()):
        first = int(log.firsts[row])
        entries = log.uses[first : first + count].tolist()
        found[:, row] = act.differences(instant, agent, entries, links)
    return found


class _Act:
    """What an agent computes at an act with fewer and fewer imperfections.

    Parameters
    ----------
    world
        What the declared world states.
    """

    def __init__(self, world: LoggedWorld) -> None:
        self._world, self._messages = world, world.messages
        self._noisy, self._lossy = imperfect(world.messages)

    def differences(self, instant: int, agent: int, entries: list[list[int]], links: TrueLinks | SteppedLinks) -> Array:
        """Differences of its force, shape (4, m).

        Parameters
        ----------
        instant, agent
            When, in nanoseconds since the start, and who.
        entries
            Graph, sender and number of each sample that it used.
        links
            The true ones.
        """
        world, leaders = self._world, self._world.leaders
        used = [(g, j, k) for g, j, k in entries if g >= 0]
        own_number = next((k for g, _, k in entries if g == OWN), PRESENT)
        led_by = next((k for g, _, k in entries if g == LEADER), None)
        measured, here = world.sample(agent, own_number, instant), world.sample(agent, PRESENT, instant)
        own = measured.exact_q, measured.exact_p
        law = None if leaders is None or led_by is None else leaders.law(led_by, instant)
        found = np.zeros((len(KNOWLEDGE), world.m))

        def force(own: tuple[Array, Array], states: Neighbours, law: Law | None) -> Array:
            others: dict[int, list[tuple[int, Array, Array]]] = {}
            for g, j, q, p in states:
                others.setdefault(g, []).append((j, q, p))
            return world.law.force(agent, own, others, world.law.time(instant), law)

        # Not the logged force: equal arguments then give equal bits, and a difference that is exactly zero.
        received = [(g, j, *world.received(world.sample(j, k, instant), instant)) for g, j, k in used]
        before = force((measured.q, measured.p), received, law)
        if self._noisy:
            now = force(own, self._exact(used, instant), law)
            found[0], before = before - now, now
        newest = used
        if self._lossy and world.arrivals is not None:
            newest = [(g, j, world.arrivals.newest(agent, j, instant, lossless=True)) for g, j, _ in used]
            last = led_by if leaders is None else leaders.newest(agent, instant, lossless=True)
            if newest != used or last != led_by:
                if leaders is not None and last is not None:
                    law = leaders.law(last, instant)
                now = force(own, self._exact(newest, instant), law)
                found[1], before = before - now, now
        if law is not None and leaders is not None:
            law = leaders.true_law(instant)
        present = [(g, j, PRESENT) for g, j, _ in used]
        if self._messages is not None:
            now = force((here.q, here.p), self._exact(present, instant), law)
            found[2], before = before - now, now
        true = links.at(instant * NANOSECOND)
        neighbours = [(g, int(j), PRESENT) for g in range(len(true)) for j in np.flatnonzero(true[g][agent])]
        if sorted(neighbours) != sorted(present):
            found[3] = before - force((here.q, here.p), self._exact(neighbours, instant), law)
        return found

    def _exact(self, numbers: list[tuple[int, int, int]], instant: int) -> Neighbours:
        """States as samples without errors give them, moved on where they are."""
        states = []
        for g, j, k in numbers:
            sample = self._world.sample(j, k, instant)
            predicted = self._messages is not None and self._messages.predict
            moved = (instant - sample.instant) * NANOSECOND if predicted else 0.0
            states.append((g, j, sample.exact_q + moved * sample.exact_p, sample.exact_p))
        return states
