"""What the departed energy of a run is due to: imperfections of knowledge, of control and of bodies."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.delayed.causes import DelayedCauses
from flocking.engine.imperfect.body_shares import PARTS, BodyShares
from flocking.engine.imperfect.powers import FIFTEEN, integrated
from flocking.engine.imperfect.range_crossings import ObstacleRanges
from flocking.engine.imperfect.true_law import TrueLaw
from flocking.engine.protocol.body_chains import of_points
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.formula.compiled import Reading
from flocking.model.world.control import Continuous, Held
from flocking.model.world.information import Delayed
from flocking.model.world.times import NANOSECOND
from flocking.study.message_logs.act_differences import KNOWLEDGE, act_differences
from flocking.study.message_logs.continuous_motion import ContinuousMotion
from flocking.study.message_logs.forced_motion import ForcedMotion
from flocking.study.message_logs.integrated_motion import IntegratedForcedMotion
from flocking.study.message_logs.knowledge_differences import KnowledgeDifferences
from flocking.study.message_logs.logged_world import LoggedWorld, logged
from flocking.study.message_logs.true_links import TrueLinks

CAUSES = ("delay", "loss", "noise", "links", "hold", *PARTS)
"""What departed energy is split into."""

WRONG = 1e-4
"""Remainder of the total, relative to the largest of all shares, from which on a run is not the one that is split:
errors of both are a thousandth of it for tolerances of up to 1e-7."""

ASKED = "departed_causes"
"""The function that a user calls, for messages."""


@dataclass(frozen=True, eq=False)
class Departed:
    """Energy that departed, by its cause.

    Parameters
    ----------
    t
        Times of the rows of the ledger, shape (K,).
    total
        The column of the ledger, shape (K,).
    causes
        Of every name in `CAUSES` its share, shape (K,). What is not in the world has a share that is exactly zero.
    """

    t: Array
    total: Array
    causes: dict[str, Array]

    @property
    def remainder(self) -> Array:
        """The total minus all shares, shape (K,): rounding under held control, else errors of motion and quadrature."""
        return self.total - sum(self.causes.values(), np.zeros(len(self.total)))


def departed_causes(run: Run) -> Departed:
    """Split the departed energy of a run, by switching imperfections off one after another.

    The law is computed again on what agents used without errors (``noise``, resolution included), then as if no message
    had been lost (``loss``), then on the true present states (``delay``), and then over the true links (``links``,
    which include links that had expired), of leaders that send messages too. Largest forces and speeds (``limits``), a
    ``lag``, gusts (``disturbance``) and bodies that do not move as points do (``body``) change forces one after
    another; the share of each is the work of what leaves it minus what comes to it. What a lag keeps back of a gust
    before it is thus due to the lag, as is what a largest rate of the lagged force keeps back. Each difference works
    along the motion, until the next force acts where control is held; that of agents of order 1, whose forces are
    velocities, by the gradient of the energy. Under held control what is left is the difference between the law at the
    tick and the law now: ``hold``, latency included. The order matters: another one would share out what two
    imperfections do together in another way.

    Runs with messages or held control are split by their log, those of `Delayed` knowledge by computing them again.
    Of a run without either all that departed is due to its bodies.

    Parameters
    ----------
    run
        A run.

    Raises
    ------
    InvalidInput
        When the run has no ledger, or agents use messages or held forces and it has no log of it; when the shares do
        not add up to what departed, since run and scenario do not belong together.
    UnsupportedLaw
        When a safety filter changed the forces, the run was changed while it went on, the kinetic energy of bodies is
        not that of points, or two parts of the bodies cannot be told from each other.
    """
    if not isinstance(run, Run):
        raise InvalidInput(ASKED, "run", "must be a Run", run, "Read it with fk.read_run(folder).")
    if not len(run.trace):
        raise InvalidInput(
            ASKED, "run", "must have an energy ledger", f"one of the engine {run.fidelity.engine!r} without",
            "Energy that departed is a column of it; runs in discrete time have none.",
        )  # fmt: skip
    scenario = run.scenario
    with Reading(), np.errstate(over="ignore", invalid="ignore"):
        if run.log is None and isinstance(scenario.control, Continuous):
            if scenario.information.ideal:
                return _found(run, _by_bodies_alone(run))
            if isinstance(scenario.information, Delayed):
                return _found(run, _by_late_knowledge(run))
        world = LoggedWorld(run, *logged(run, ASKED))
        works = _Works(run, world, BodyShares(scenario.agents, world.n, world.m))
        if isinstance(world.motion, ContinuousMotion):
            return _found(run, works.under_continuous_control())
        found = works.under_held_control()
        held = run.trace["departed"] - sum(found.values(), np.zeros(len(run.trace)))
        return _found(run, {**found, "hold": held})


def _found(run: Run, shares: dict[str, Array]) -> Departed:
    trace = run.trace
    causes = {name: shares.get(name, np.zeros(len(trace))) for name in CAUSES}
    found = Departed(trace["time"].copy(), trace["departed"].copy(), causes)
    gap, size = (
        max(float(np.abs(x).max()) for x in each) for each in ([found.remainder], [found.total, *causes.values()])
    )
    if gap > WRONG * size:
        raise InvalidInput(
            ASKED, "run", "must have a ledger that follows from its scenario",
            f"shares that differ from what departed by {gap:.3g}, of up to {size:.3g}",
            "The run was changed, or its motion amplifies rounding, so that another machine computes another one.",
        )  # fmt: skip
    return found


def _by_bodies_alone(run: Run) -> dict[str, Array]:
    """Shares where agents know the truth at every moment: all is due to the one part that the bodies have."""
    scenario = run.scenario
    names = BodyShares(scenario.agents, *scenario.start.q.shape).names
    if len(names) > 1:
        raise UnsupportedLaw(
            "departed_causes splits what bodies do under held control, messages or delayed knowledge; with ideal "
            f"control and information runs store no forces that tell {' from '.join(names)}."
        )
    return {name: run.trace["departed"].copy() for name in names}


def _by_late_knowledge(run: Run) -> dict[str, Array]:
    """Shares where agents know each other as they were a time ago, computed again."""
    if run.fidelity.changed:
        raise UnsupportedLaw(
            "departed_causes computes again runs of one world and law; this one was changed while it went on."
        )
    session = DelayedCauses(run.scenario)
    works = np.array([session.works_until(float(t)) for t in run.trace["time"]]).reshape(-1, len(session.names))
    return dict(zip(session.names, works.T, strict=True))


Sources = Callable[[float], Array]
"""Differences of forces at a time since the start, shape (names, N, m)."""


class _Works:
    """The works of differences of forces along the motion of a run, from row to row of its ledger.

    Parameters
    ----------
    run
        The run.
    world
        What its declared world states.
    bodies
        What changes its forces.
    """

    def __init__(self, run: Run, world: LoggedWorld, bodies: BodyShares) -> None:
        self._run, self._world, self._bodies = run, world, bodies
        self._motion: ForcedMotion | IntegratedForcedMotion = world.motion
        self._law, self._links = TrueLaw(of_points(world.scenario)), TrueLinks(run)
        self._names = KNOWLEDGE + bodies.names
        self._largest = 0.0

    def under_held_control(self) -> dict[str, Array]:
        """Shares of what agents knew when they acted, and of their bodies, by name, shape (K,) each."""
        world, log = self._world, self._world.log
        assert isinstance(world.scenario.control, Held)
        latency = world.scenario.control.latency_in_nanoseconds
        known = act_differences(self._run, world)
        acts: list[tuple[list[float], list[int]]] = [([], []) for _ in range(world.n)]
        for row, (instant, agent, _) in enumerate(log.ticks.tolist()):
            acts[agent][0].append((instant + latency) * NANOSECOND)
            acts[agent][1].append(row)
        constant = self._law.order == 2 and self._bodies.constant
        works = np.zeros((len(self._run.trace), len(self._names)))
        for row, begin, end in self._stretches([t for times, _ in acts for t in times]):
            middle = 0.5 * (begin + end)
            held = [(bisect_right(times, middle), rows) for times, rows in acts]
            rows = np.array([numbers[k - 1] if k else -1 for k, numbers in held])
            there = (rows >= 0)[:, None]
            knowledge, desired = np.where(there, known[:, rows], 0.0), np.where(there, log.forces[rows], 0.0)
            if len(log.ticks) == 0:
                knowledge, desired = np.zeros((len(KNOWLEDGE), world.n, world.m)), np.zeros((world.n, world.m))

            def sources(
                seconds: float, knowledge: Array = knowledge, desired: Array = desired, middle: float = middle
            ) -> Array:
                return np.concatenate([knowledge, self._parts(seconds, middle, desired)])

            if constant:
                # Forces that stay as they are work along the way, whatever the motion between its ends.
                way = self._place(end) - self._place(begin)
                works[row] += (sources(middle) * way).sum(axis=(1, 2))
            else:
                works[row] += self._work(begin, end, sources)
        return dict(zip(self._names, np.cumsum(works, axis=0).T, strict=True))

    def under_continuous_control(self) -> dict[str, Array]:
        """Shares of what agents know at every moment, and of their bodies, by name, shape (K,) each."""
        differences = KnowledgeDifferences(self._world)
        works = np.zeros((len(self._run.trace), len(self._names)))
        for row, begin, end in self._stretches(differences.breaks.tolist()):
            middle = 0.5 * (begin + end)
            differences.begin(begin, end, self._links.at(middle))

            def sources(seconds: float, middle: float = middle) -> Array:
                known, desired = differences.at(seconds)
                return np.concatenate([known, self._parts(seconds, middle, desired)])

            works[row] += self._work(begin, end, sources)
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
        world, body = self._world, self._world.scenario.agents
        times = self._run.trace["time"] - world.base
        if not len(times):
            return
        ends = [*changes, *(self._run.switches["time"] - world.base).tolist()]
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
        energy, masses = self._world.scenario.energy, self._motion.masses
        if energy.leader is not None:
            return place - np.asarray(energy.leader.at(self._world.base + seconds)[0])
        return place if energy.frame == "lab" else place - masses @ place / masses.sum()

    def _work(self, begin: float, end: float, sources: Sources) -> Array:
        """Works of differences of forces from a time to another, shape (names,)."""
        base, law, middle = self._world.base, self._law, 0.5 * (begin + end)
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
            powers, end - begin, self._world.scenario.tolerance, self._largest, FIFTEEN, len(self._names)
        )
        return works
