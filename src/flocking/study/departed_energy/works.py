"""The works of differences of forces along the motion of a run, from row to row of its ledger."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.imperfect.body_shares import BodyShares
from flocking.engine.imperfect.powers import FIFTEEN, integrated
from flocking.engine.imperfect.range_crossings import ObstacleRanges
from flocking.engine.imperfect.true_law import TrueLaw
from flocking.engine.protocol.body_chains import of_points
from flocking.engine.runs.run import Run
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND
from flocking.study.departed_energy.act_differences import KNOWLEDGE, act_differences
from flocking.study.departed_energy.ideal_motion import IdealMotion
from flocking.study.departed_energy.knowledge_differences import KnowledgeDifferences
from flocking.study.departed_energy.true_links import true_links
from flocking.study.message_logs.forced_motion import ForcedMotion
from flocking.study.message_logs.integrated_motion import IntegratedForcedMotion
from flocking.study.message_logs.logged_world import LoggedWorld

Sources = Callable[[float], Array]
"""Differences of forces at a time since the start, shape (names, N, m)."""


class Works:
    """The works of differences of forces along the motion of a run, from row to row of its ledger.

    Parameters
    ----------
    run
        The run.
    motion
        Its motion, computed a second time.
    bodies
        What changes its forces.
    """

    def __init__(self, run: Run, motion: ForcedMotion | IntegratedForcedMotion, bodies: BodyShares) -> None:
        self._run, self._motion, self._bodies = run, motion, bodies
        self._scenario, self._base = run.scenario, run.scenario.start.t
        self._law, self._links = TrueLaw(of_points(run.scenario)), true_links(run, motion)
        self._names = KNOWLEDGE + bodies.names
        self._largest = 0.0

    def under_held_control(self, world: LoggedWorld) -> dict[str, Array]:
        """Shares of what agents knew when they acted, and of their bodies, by name, shape (K,) each.

        Parameters
        ----------
        world
            What the declared world states.
        """
        log = world.log
        assert isinstance(world.scenario.control, Held)
        latencies = world.scenario.control.latencies(world.n).tolist()
        # The last row is of agents no force of which acts yet.
        known = np.concatenate([act_differences(self._run, world), np.zeros((len(KNOWLEDGE), 1, world.m))], axis=1)
        forces = np.concatenate([log.forces, np.zeros((1, world.m))])
        acts: list[tuple[list[float], list[int]]] = [([], []) for _ in range(world.n)]
        for row, (instant, agent, _) in enumerate(log.ticks.tolist()):
            acts[agent][0].append((instant + latencies[agent]) * NANOSECOND)
            acts[agent][1].append(row)
        constant = self._law.order == 2 and self._bodies.constant

        def between(begin: float, end: float) -> Array:
            middle = 0.5 * (begin + end)
            held = [(bisect_right(times, middle), rows) for times, rows in acts]
            rows = np.array([numbers[k - 1] if k else -1 for k, numbers in held])
            knowledge, desired = known[:, rows], forces[rows]

            def sources(seconds: float) -> Array:
                return np.concatenate([knowledge, self._parts(seconds, middle, desired)])

            if constant:
                # Forces that stay as they are work along the way, whatever the motion between its ends.
                way = self._place(end) - self._place(begin)
                found: Array = (sources(middle) * way).sum(axis=(1, 2))
                return found
            return self._work(begin, end, sources)

        return self._shares([t for times, _ in acts for t in times], between)

    def with_ideal_knowledge(self, motion: IdealMotion) -> dict[str, Array]:
        """Shares of the bodies of agents that know the truth at every moment, by name, shape (K,) each.

        Parameters
        ----------
        motion
            The motion.
        """
        none = np.zeros((len(KNOWLEDGE), motion.n, motion.m))

        def between(begin: float, end: float) -> Array:
            middle = 0.5 * (begin + end)

            def sources(seconds: float) -> Array:
                return np.concatenate([none, self._parts(seconds, middle, motion.desired(seconds))])

            return self._work(begin, end, sources)

        return self._shares([], between)

    def under_continuous_control(self, world: LoggedWorld) -> dict[str, Array]:
        """Shares of what agents know at every moment, and of their bodies, by name, shape (K,) each.

        Parameters
        ----------
        world
            What the declared world states.
        """
        differences = KnowledgeDifferences(world)

        def between(begin: float, end: float) -> Array:
            middle = 0.5 * (begin + end)
            differences.begin(begin, end, self._links.at(middle))

            def sources(seconds: float) -> Array:
                known, desired = differences.at(seconds)
                return np.concatenate([known, self._parts(seconds, middle, desired)])

            return self._work(begin, end, sources)

        return self._shares(differences.breaks.tolist(), between)

    def _shares(self, changes: Sequence[float], between: Callable[[float, float], Array]) -> dict[str, Array]:
        """Shares by name, shape (K,) each, from the works on each stretch; for ``changes`` see `_stretches`."""
        works = np.zeros((len(self._run.trace), len(self._names)))
        for row, begin, end in self._stretches(changes):
            works[row] += between(begin, end)
        return dict(zip(self._names, np.cumsum(works, axis=0).T, strict=True))

    def _parts(self, seconds: float, middle: float, desired: Array) -> Array:
        """Shares of the bodies in the forces at a time, on the stretch with a ``middle``."""
        if self._bodies.constant:
            return self._bodies.at(middle, desired, None, None)
        acting, applied = self._motion.acting(seconds)
        return self._bodies.at(middle, desired, applied, acting)

    def _stretches(self, changes: Sequence[float]) -> Iterator[tuple[int, float, float]]:
        """Row of the ledger to which a stretch leads, and its begin and end in seconds from the start.

        Parameters
        ----------
        changes
            When forces change; stretches end there too, and where gusts, links, gains or limits do.
        """
        body, times = self._scenario.agents, self._run.trace["time"] - self._base
        ends = [*changes, *(self._run.switches["time"] - self._base).tolist()]
        if isinstance(self._motion, IntegratedForcedMotion):
            ends += [x.end for x in self._motion.stretches]
        gust = body.drawn_until(0.0)
        while gust < times[-1]:
            ends.append(gust)
            gust = body.drawn_until(gust)
        every = np.unique([*times, *ends])
        every = every[(every >= times[0]) & (every <= times[-1])]
        rows = np.searchsorted(times, every[1:], side="left")
        yield from zip(rows.tolist(), every[:-1].tolist(), every[1:].tolist(), strict=True)

    def _place(self, seconds: float) -> Array:
        """Positions from a point that moves with the frame of the energy, shape (N, m)."""
        place, _ = self._motion.states(seconds)
        energy, masses = self._scenario.energy, self._motion.masses
        if energy.leader is not None:
            return place - np.asarray(energy.leader.at(self._base + seconds)[0])
        return place if energy.frame == "lab" else place - masses @ place / masses.sum()

    def _work(self, begin: float, end: float, sources: Sources) -> Array:
        """Works of differences of forces from a time to another, shape (names,)."""
        base, law, middle = self._base, self._law, 0.5 * (begin + end)
        met: list[tuple[Indices, Indices]] = []
        if law.order == 1:
            law.take_parameters(base + middle)
            met = ObstacleRanges(law.law, self._motion.states(middle)[0], base + middle).pairs
        pairs = law.pairs(np.array(self._links.at(middle)), met)

        def powers(times: Array) -> Array:
            found = []
            for s in (begin + times).tolist():
                q, p = self._motion.states(s)
                found.append(law.powers_of(base + s, np.ascontiguousarray(q), p, sources(s), pairs))
            return np.array(found)

        works, _, self._largest = integrated(
            powers, end - begin, self._scenario.tolerance, self._largest, FIFTEEN, len(self._names)
        )
        return works
