"""What the departed energy of a run is due to: imperfections of knowledge, of control and of bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array
from flocking.engine.delayed.causes import DelayedCauses
from flocking.engine.imperfect.body_shares import PARTS, BodyShares
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.formula.compiled import Reading
from flocking.model.world.control import Continuous
from flocking.model.world.information import Delayed
from flocking.study.departed_energy.ideal_motion import IdealMotion
from flocking.study.departed_energy.works import Works
from flocking.study.message_logs.continuous_motion import ContinuousMotion
from flocking.study.message_logs.logged_world import LoggedWorld, check_run, check_unchanged, logged

CAUSES = ("delay", "loss", "noise", "links", "hold", *PARTS)
"""What departed energy is split into."""

WRONG = 1e-4
"""Remainder of the total, relative to the largest of all shares, from which on a run is not the one that is split:
errors of both are a thousandth of it for tolerances of up to 1e-7."""

ROUNDING = 1e-12
"""Remainder that is rounding, relative to the energies of a run, and to those of agents that go as far as their places
are from the origin in its time."""

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
    which include links that had expired), of leaders that send messages too. Whether an agent is within range of an
    obstacle follows each time from the place that it is taken to know of itself. Largest forces and speeds
    (``limits``), a ``lag``, gusts (``disturbance``) and bodies that do not move as points do (``body``) change forces
    one after another; the share of each is the work of what leaves it minus what comes to it. What a lag keeps back of
    a gust before it is thus due to the lag, as is what a largest rate of the lagged force keeps back. Each difference
    works along the motion, until the next force acts where control is held; that of agents of order 1, whose forces are
    velocities, by the gradient of the energy. Under held control what is left is the difference between the law at the
    tick and the law now: ``hold``, latency included. The order matters: another one would share out what two
    imperfections do together in another way.

    Runs with messages or held control are split by their log, those of `Delayed` knowledge by computing them again.
    Of a run without either all that departed is due to its bodies; it is computed again where these have several parts.

    Parameters
    ----------
    run
        A run.

    Raises
    ------
    InvalidInput
        When the run has no ledger, or agents use messages or held forces and it has no log of it; when the shares do
        not add up to what departed, since run and scenario do not belong together or the motion amplifies rounding.
    UnsupportedLaw
        When a safety filter changed the forces, the run was changed while it went on, the kinetic energy of bodies is
        not that of points, or two parts of the bodies cannot be separated.
    """
    check_run(run, ASKED)
    if not len(run.trace):
        raise InvalidInput(
            ASKED, "run", "must have an energy ledger", f"one of the engine {run.fidelity.engine!r} without",
            "What departed is a column of it; runs in discrete time have none, nor do some of large groups.",
        )  # fmt: skip
    scenario = run.scenario
    with Reading(), np.errstate(over="ignore", invalid="ignore"):
        if isinstance(scenario.control, Continuous):
            if scenario.information.ideal:
                return _found(run, _by_bodies_alone(run))
            if isinstance(scenario.information, Delayed):
                return _found(run, _by_late_knowledge(run))
        world = LoggedWorld(run, *logged(run, ASKED))
        works = Works(run, world.motion, BodyShares(scenario.agents, world.n, world.m))
        if isinstance(world.motion, ContinuousMotion):
            return _found(run, works.under_continuous_control(world))
        found = works.under_held_control(world)
        held = run.trace["departed"] - sum(found.values(), np.zeros(len(run.trace)))
        return _found(run, {**found, "hold": held})


def _found(run: Run, shares: dict[str, Array]) -> Departed:
    trace = run.trace
    causes = {name: shares.get(name, np.zeros(len(trace))) for name in CAUSES}
    found = Departed(trace["time"].copy(), trace["departed"].copy(), causes)
    gap = float(np.abs(found.remainder).max())
    size = max(float(np.abs(x).max()) for x in (found.total, *causes.values()))
    if not gap <= WRONG * size + _rounding(run) < np.inf:
        raise InvalidInput(
            ASKED, "run", "must have a ledger that follows from its scenario",
            f"shares that differ from what departed by {gap:.3g}, of up to {size:.3g}",
            "The run was changed, or its motion amplifies rounding, as where agents come near a pole of a potential.",
        )  # fmt: skip
    return found


def _rounding(run: Run) -> float:
    """Remainder that rounding explains, also of agents that stay where potentials are least, whose energies cancel."""
    scenario, length = run.scenario, float(np.abs(run.q).max(initial=0.0))
    time, order = float(run.trace["time"][-1] - run.trace["time"][0]), scenario.agents.order
    moved = float(np.sum(np.broadcast_to(scenario.agents.masses, run.n))) * length**2 / time**order if time else 0.0
    return ROUNDING * (float(np.abs(run.trace["energy"]).max()) + run.turnover + moved)


def _by_bodies_alone(run: Run) -> dict[str, Array]:
    """Shares where agents know the truth at every moment: all is due to their bodies."""
    scenario = run.scenario
    bodies = BodyShares(scenario.agents, *scenario.start.q.shape)
    if len(bodies.names) <= 1:
        return {name: run.trace["departed"].copy() for name in bodies.names}
    law = scenario.law
    if (
        not run.fidelity.switches_located
        or law.beyond_neighbours
        or any(getattr(term, "functional", False) for term in law.pair_terms)
    ):
        raise UnsupportedLaw(
            f"{ASKED} separates {' from '.join(bodies.names)} by forces computed again, for which with ideal "
            "control and information switches must be located and the law must be one of an agent and its neighbours."
        )
    check_unchanged(run, ASKED)
    motion = IdealMotion(run)
    return Works(run, motion, bodies).with_ideal_knowledge(motion)


def _by_late_knowledge(run: Run) -> dict[str, Array]:
    """Shares where agents know each other as they were a time ago, computed again."""
    check_unchanged(run, ASKED)
    session = DelayedCauses(run.scenario)
    works = np.array([session.works_until(float(t)) for t in run.trace["time"]]).reshape(-1, len(session.names))
    return dict(zip(session.names, works.T, strict=True))
