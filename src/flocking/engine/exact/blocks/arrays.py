"""What the native loop over steps is given and fills, as named tuples of arrays and numbers."""

from __future__ import annotations

from typing import NamedTuple

from flocking.arrays import Array, Indices, Links, Mask
from flocking.engine.adaptive_steps.integration_method import Tableau
from flocking.engine.adaptive_steps.segment import Motion
from flocking.engine.exact.crossings.nearby_pairs import NearbyPairs
from flocking.engine.exact.crossings.watch_tables import BallWatches, PairWatches

TIME, LENGTH, ENERGY, KINETIC, RATE, GAP, BEGIN, TRIED, STOP, PROPOSED = range(10)
"""What ``progress`` holds: time, length proposed for the next step, energy and kinetic energy, rate of the companion,
its `flocking.engine.exact.companion.companion_gap`, when the step taken last began, and of the step tried last its
length, its end before it was cut, and the length proposed for the one after it."""

PROGRESS = PROPOSED + 1
"""Length of ``progress``."""

ERRORS = 8
"""How many numbers are known of the error of the step taken last: those of `flocking.engine.exact.companion.summary`,
then the energy that the error leaves the ledger unable to explain."""

STEP_END, STEP_ENERGY, STEP_KINETIC, STEP_LENGTH, STEP_JUMPED = range(5)
"""What a row of ``steps`` holds: time, energy and kinetic energy at the end of a step, its length, and the sum of the
jumps of the energy until then. A row of length 0 follows a step whose switches may change the energy."""

STEP_NUMBERS = STEP_JUMPED + 1
"""Length of such a row."""

WATCH, FIRST, SECOND = range(3)
"""What rows of pairs that have switched or do so begin with: number of the watch, and the pair."""

AT, BEGUN, LEVEL, OUTWARD, BOUND, LATER, LEFT_AT = range(SECOND + 1, SECOND + 8)
"""What a row of ``fresh`` holds then: the fields of `flocking.engine.exact.uncertain_switches.Fresh`, and of the step
looked at last the error with it and the place at which the pair was beyond the error."""

SLID_AT, SLID_SPEED, SLIDES = range(SECOND + 1, SECOND + 4)
"""What a row of ``sliding`` holds then: time and speed of the last crossing of a pair, and the number of those in a row
on which it hardly moved."""

SWITCHED_AT, SPEED, RELATIVE, LATE, DRIFT, INWARD, DELAY, ERROR = range(SECOND + 1, SECOND + 9)
"""What a row of ``switches`` holds then: time, rate of change of the distance, relative speed, errors of time and
speed, 1 for a pair that comes closer, the likely delay, and the error of its distance."""

SWITCH_NUMBERS = ERROR + 1
"""Length of such a row."""

PLACE, NEARED = 1, 4
"""Of a row of ``crossed``: where on the step the pair crosses; 1 where it came within the error before. The watch is at
0, the pair at 2 and 3."""

FRESH_ROWS, SLIDING_ROWS, SWITCH_ROWS = range(3)
"""What ``counts`` holds: the numbers of rows in use."""


class Method(NamedTuple):
    """Coefficients of the integrator.

    Parameters
    ----------
    tableau
        The method.
    to_bernstein
        See `flocking.engine.adaptive_steps.integration_method.TO_BERNSTEIN`.
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
    nearby
        Pairs of agents that are looked at.
    zones, owners
        Narrow features of the potentials, rows (from, to, width), and the graphs they belong to.
    graphs
        Number of graphs.
    singular, pointed, timed
        Whether a potential is infinite at zero, whether one has a slope there, and whether the law depends on time.
    """

    pairs: PairWatches
    balls: BallWatches
    nearby: NearbyPairs
    zones: Array
    owners: Indices
    graphs: int
    singular: bool
    pointed: bool
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
    place, speed, finest
        Tolerance of places, least speed that counts, and the finest difference of radii, see
        `flocking.engine.exact.precision.Precision`.
    velocities
        How many components of the state vector are velocities; they follow the positions.
    unlinked
        Energy of all pairs without links, shape (1,); it changes with the links.
    recording
        Whether steps may be put on record: one that is taken while a switch is in doubt may not.
    most, few
        Largest number of steps, and of pairs up to which the companion takes half steps.
    """

    end: float
    bound: float
    base: float
    tolerance: float
    components: Array
    reach: float
    place: float
    speed: float
    finest: float
    velocities: int
    unlinked: Array
    recording: bool
    most: int
    few: int


class Switching(NamedTuple):
    """What switches of pairs of agents change, beside the watches and the pairs of the law.

    Parameters
    ----------
    allowed
        Whether the loop may apply them.
    linked
        Links of each graph, shape (graphs, N, N).
    directed
        Whether pairs of each graph are ordered, shape (graphs,).
    owners, kinks
        Graph of each watch of pairs of agents, and whether it watches a kink, shape (watches,).
    walls
        Whether links appear there where their potential is infinite.
    jumping
        Whether the energy may change at a watch; those of balls follow, shape (watches + levels,).
    each
        Energy of a pair without a link.
    """

    allowed: bool
    linked: Links
    directed: Mask
    owners: Indices
    kinks: Mask
    jumping: Mask
    walls: Mask
    each: float


class Switched(NamedTuple):
    """Pairs that switch; all of it changes.

    Parameters
    ----------
    fresh, sliding, switches
        Pairs that have switched and are not beyond the error yet, last crossings of pairs, and switches that are put on
        record; rows, see `AT`, `SLID_AT` and `SWITCHED_AT`.
    counts
        See `FRESH_ROWS`.
    jumped
        Sum of the jumps of the energy, shape (1,).
    """

    fresh: Array
    sliding: Array
    switches: Array
    counts: Indices
    jumped: Array


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
        Takes the crossings at the end of the step taken last, shape (room, 5), see `PLACE`.
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
    extremes
        See `flocking.engine.exact.extremes.Extremes`.
    velocity_rounding
        What the velocity of the origin adds to the rounding of velocities.
    frame_times
        Own times of the frames to come.
    frames, frame_errors, frame_links
        Take their state vectors, shape (frames, size), the errors of positions and velocities, shape (frames, 2), and
        the links of the graph of the law, shape (frames, N, N).
    steps, states
        Take what is recorded of each step, see `STEP_END`, shape (rows, 5), and the state vectors at their ends.
    """

    extremes: Array
    velocity_rounding: float
    frame_times: Array
    frames: Array
    frame_errors: Array
    frame_links: Links
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
    hits, doubtful
        Crossings of one watch, shape (room, 3), and pairs that come within the error of one, shape (room, 6).
    energies
        Pair storage, body storage and kinetic energy.
    linked, sides
        Links of the graph of the law on the step, and the sides and watched pairs of those that switch at its end, see
        `flocking.engine.exact.blocks.switches.keep_sides`, shape (room, watches, 4).
    d, v, apart
        Of a pair the differences of positions, of velocities, shape (m,), and of the Bernstein coefficients of the
        positions, shape (8, m).
    velocities
        Slopes by the law before a switch, which hold the velocities of agents of order 1, and their errors there,
        shape (2, size).
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
    doubtful: Array
    energies: Array
    linked: Links
    sides: Mask
    d: Array
    v: Array
    apart: Array
    velocities: Array
