"""What the native loop over steps is given and fills, as named tuples of arrays and numbers."""

from __future__ import annotations

from typing import NamedTuple

from flocking.arrays import Array, Indices, Links
from flocking.engine.exact.crossings.watch_tables import BallWatches, PairWatches
from flocking.engine.integrator.integration_method import Tableau
from flocking.engine.integrator.segment import Motion

TIME, LENGTH, ENERGY, KINETIC, RATE, GAP, BEGIN, TRIED, STOP, PROPOSED = range(10)
"""What ``progress`` holds: time, length proposed for the next step, energy and kinetic energy, rate of the companion,
its `flocking.engine.exact.companion.companion_gap`, when the step taken last began, and of the step tried last its
length, its end before it was cut, and the length proposed for the one after it."""

PROGRESS = PROPOSED + 1
"""Length of ``progress``."""

ERRORS = 8
"""How many numbers are known of the error of the step taken last: those of `flocking.engine.exact.companion.summary`,
then the energy that the error leaves the ledger unable to explain."""

STEP_END, STEP_ENERGY, STEP_KINETIC, STEP_LENGTH = range(4)
"""What a row of ``steps`` holds: time, energy and kinetic energy at the end of the step, and its length."""

STEP_NUMBERS = STEP_LENGTH + 1
"""Length of such a row."""


class Method(NamedTuple):
    """Coefficients of the integrator.

    Parameters
    ----------
    tableau
        The method.
    to_bernstein
        See `flocking.engine.integrator.integration_method.TO_BERNSTEIN`.
    inside, second
        See `flocking.engine.exact.companion.INSIDE` and ``SECOND``.
    """

    tableau: Tableau
    to_bernstein: Array
    inside: Array
    second: Array


class Watches(NamedTuple):
    """What a step is watched for.

    Parameters
    ----------
    pairs, balls
        Distances that may be crossed.
    zones, owners
        Narrow features of the potentials, rows (from, to, width), and the graphs they belong to.
    senders, sensed
        The linked pairs, shape (K,) each.
    singular, timed
        Whether a potential is infinite at zero, and whether the law depends on time.
    """

    pairs: PairWatches
    balls: BallWatches
    zones: Array
    owners: Indices
    senders: Indices
    sensed: Indices
    singular: bool
    timed: bool


class Limits(NamedTuple):
    """What bounds the steps.

    Parameters
    ----------
    end, bound
        Own times at which to stop, and at which a step must end.
    base
        The time at which the own time is 0.
    tolerance, components
        Tolerance of the scenario, and that of each component of the state vector, shape (size,).
    reach
        Shortest reach of a graph.
    finest
        The finest difference of radii, see `flocking.engine.exact.precision.Precision`.
    unlinked
        Energy of all pairs without links.
    recording
        Whether steps may be put on record: one that is taken while a switch is in doubt may not.
    """

    end: float
    bound: float
    base: float
    tolerance: float
    components: Array
    reach: float
    finest: float
    unlinked: float
    recording: bool


class Solution(NamedTuple):
    """The solution as it goes on; all of it changes.

    Parameters
    ----------
    progress
        See `TIME`.
    y, slope
        State vector and its slope, shape (size,).
    K
        Slopes at the stages of the step tried last, shape (16, size).
    coefficients
        Bernstein coefficients of the step taken last, shape (8, size); of the step tried last where it was refused.
    uncut
        State vector at the end of the step tried last before it was cut, shape (size,).
    difference, errors
        Difference of the companion on the step taken last, shape (6, size), and the numbers of its error, see `ERRORS`.
    crossed
        Takes the crossings at the end of the step taken last: watch, place, and pair, shape (room, 4).
    """

    progress: Array
    y: Array
    slope: Array
    K: Array
    coefficients: Array
    uncut: Array
    difference: Array
    errors: Array
    crossed: Array


class Records(NamedTuple):
    """What is put on record.

    Parameters
    ----------
    linked
        Links of the graph of the law, shape (N, N).
    extremes
        See `flocking.engine.exact.extremes.Extremes`.
    velocity_rounding
        What the velocity of the origin adds to the rounding of velocities.
    frame_times
        Own times of the frames to come.
    frames, frame_errors
        Take their state vectors, shape (frames, size), and the errors of positions and velocities, shape (frames, 2).
    steps, states
        Take what is recorded of each step, see `STEP_END`, shape (steps, 4), and the state vectors at their ends.
    """

    linked: Links
    extremes: Array
    velocity_rounding: float
    frame_times: Array
    frames: Array
    frame_errors: Array
    steps: Array
    states: Array


class Work(NamedTuple):
    """Arrays of the loop itself.

    Parameters
    ----------
    new, fresh
        State vector at the end of the step that is tried, and its slope there, shape (size,).
    other, middle, end
        The companion at the start, in the middle and at the end of a step, shape (size,).
    K
        Slopes of the companion, shape (16, size).
    C, motion
        Bernstein coefficients of the step, shape (8, size), and how the agents move on it; its ``size`` is not used.
    e
        Difference of the companion on it, shape (6, size).
    offsets
        Errors of the positions at its nodes, shape (6, N, m).
    part
        Coefficients of a part of it, shape (8, size).
    hits
        Crossings of one watch, shape (room, 3).
    energies
        Pair storage, body storage and kinetic energy.
    none
        Takes nothing, shape (0, 6).
    """

    new: Array
    fresh: Array
    other: Array
    middle: Array
    end: Array
    K: Array
    C: Array
    motion: Motion
    e: Array
    offsets: Array
    part: Array
    hits: Array
    energies: Array
    none: Array
