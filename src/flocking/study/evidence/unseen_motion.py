"""What recorded steps show of motions that the frames of a run do not: frames too far apart look calm."""

from __future__ import annotations

from typing import Literal

import numpy as np

from flocking.arrays import Array
from flocking.engine.protocol.body_chains import has_energy_of_points
from flocking.engine.runs.run import Run
from flocking.model.world.control import Held
from flocking.model.world.times import NANOSECOND
from flocking.study.message_logs.recorded_motion import RecordedMotion

SEEN = 1e-6
"""Share by which the kinetic energy at a step may differ from that of the curves through the frames, besides what the
curves may be off: more than errors of the steps and of rounding in single precision add up to."""

STEPS = 8
"""Steps between two frames above which agents of order 1 may have turned there and back. Around a circle adaptive steps
are more, at tolerances of 1e-6 or less; steps that end at a switch do not count."""

TICKS = 2
"""Ticks from one frame to before the next up to which velocities that are set at ticks follow from the two frames: that
of the last part is known, that of the first one too where the frame is no tick, and the places fix the other."""

FARTHEST = 1.25
"""Largest distance of an agent from the cubic curve through two frames, over its largest speed times the time between
them: half of it to the nearer end, and three quarters from there to the curve, which is in the hull of four points."""

MOST_STATES = 10**7
"""States of agents at steps that are compared at most, a bound on time."""


def beyond_curves(run: Run) -> Array:
    """How far agents may be from the cubic curves through the frames where these are none of their motion.

    Parameters
    ----------
    run
        The run.

    Returns
    -------
    Array
        Shape (F - 1,): 0 where nothing shows that, else by the largest speed of the run, infinite where that is not
        known.
    """
    if len(run.t) < 2:
        return np.zeros(0)
    largest = None if run.accuracy is None else run.accuracy.largest.get("speed")
    speed = np.inf if largest is None else largest.value + largest.error
    found = np.zeros(len(run.t) - 1)
    missed = unseen(run)
    found[missed] = FARTHEST * np.diff(run.t)[missed] * (speed if speed >= 0.0 else np.inf)
    return found


def unseen(run: Run) -> Array:
    """Whether agents moved otherwise between two frames than on the cubic curves through these, shape (F - 1,).

    An agent that goes round and is back at every frame, at rest, leaves no trace there: neighbouring curves agree, and
    any estimate of what they miss is 0. But with given ends, at rest in them relative to the mean motion, its kinetic
    energy in between is larger than that of the curve, of all agents together too. The ledger has it at every step.

    Agents of order 1 have none: between two frames there may be few steps, see `STEPS`. Where their velocity is held,
    or what they know jumps, one instant between two frames is enough to go there and back. Velocities that are set at
    ticks leave no energy either, see `TICKS`. After the end of a ledger nothing is known.

    Parameters
    ----------
    run
        The run, with at least two frames.
    """
    found = np.zeros(len(run.t) - 1, dtype=bool)
    times = np.asarray(run.trace["time"], dtype=np.float64)
    inside = np.flatnonzero((times > run.t[0]) & (times < run.t[-1]))
    agents = run.scenario.agents
    if agents.discrete:
        return np.asarray(_instants(run, "left") > TICKS)
    if agents.order == 1:
        steps = np.setdiff1d(times[inside], run.switches["time"])
        often = np.histogram(steps, bins=np.asarray(run.t, dtype=np.float64))[0] > STEPS
        return np.asarray(often | (_instants(run, "right") > 0))
    found[np.asarray(run.t[1:]) > (times[-1] if len(times) else -np.inf)] = "ledger ends" in run.provenance
    if not has_energy_of_points(agents):
        return found
    motion, energy, start = RecordedMotion(run), run.scenario.energy, run.scenario.start
    masses = np.broadcast_to(np.asarray(agents.masses, dtype=np.float64), run.n)
    # Every one, or as many as there is time for, at even places.
    inside = inside[:: 1 + len(inside) * run.n // MOST_STATES]
    block = max(1, 10**6 // max(run.n, 1))
    errors = run.accuracy.frames[:, 1].max(initial=0.0) if run.accuracy is not None else 0.0
    for first in range(0, len(inside), block):
        rows = inside[first : first + block]
        between = motion.at((times[rows] - start.t)[:, None], np.arange(run.n)[None])
        w = between.p
        if energy.frame == "leader" and energy.leader is not None:
            w = w - energy.leader.velocities_at(times[rows])[:, None]
        elif energy.frame == "centre of mass":
            w = w - (np.einsum("i,kim->km", masses, w) / masses.sum())[:, None]
        off = between.off_p + errors + float(np.finfo(run.p.dtype).eps) * np.linalg.norm(between.p, axis=2)
        if energy.frame == "centre of mass":
            off = off + (off @ masses / masses.sum())[:, None]
        speed = np.linalg.norm(w, axis=2)
        kinetic, most = 0.5 * speed**2 @ masses, (speed * off + 0.5 * off**2) @ masses
        known = np.asarray(run.trace["kinetic"], dtype=np.float64)[rows]
        missed = np.abs(known - kinetic) > most + SEEN * (known + kinetic)
        found[np.searchsorted(run.t, times[rows][missed], side="right") - 1] = True
    return found


def _instants(run: Run, side: Literal["left", "right"]) -> Array:
    """Largest number of instants between two frames at which a velocity of one agent may jump, shape (F - 1,).

    They are the ticks of held control, without latency, or the acts of the log. They are compared in whole nanoseconds.

    Parameters
    ----------
    run
        The run.
    side
        ``"left"`` where an instant at the first of two frames counts, ``"right"`` where it does not.
    """
    start, control = run.scenario.start, run.scenario.control
    frames = np.round((np.asarray(run.t, dtype=np.float64) - start.t) / NANOSECOND)
    if isinstance(control, Held):
        schedule, late = control.schedule(run.n), control.latencies(run.n)
        found = np.zeros(len(frames) - 1)
        for period, first in {*zip(schedule.period.tolist(), (schedule.phase + late).tolist(), strict=True)}:
            # Numbers of the first tick that is not before a frame, and of the first one after it.
            at, after = np.ceil((frames - first) / period), np.floor((frames - first) / period) + 1.0
            begin = at[:-1] if side == "left" else after[:-1]
            found = np.maximum(found, np.maximum(at[1:], 0.0) - np.maximum(begin, 0.0))
        return found
    if run.log is None:
        return np.zeros(len(frames) - 1)
    acts = np.unique(run.log.ticks[:, 0])
    return np.asarray(np.searchsorted(acts, frames[1:], side="left") - np.searchsorted(acts, frames[:-1], side=side))
