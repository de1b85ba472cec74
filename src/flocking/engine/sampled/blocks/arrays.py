"""Arrays and numbers of the native loop over events, which changes them in place."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Links, Mask, Numbers
from flocking.engine.imperfect.link_rules import LinkRules
from flocking.engine.imperfect.powers import LawInForce, Rule
from flocking.engine.kernels.law_kernels import Pairs
from flocking.model.world.times import Instants

TIME, JUMPED, ACCOUNTED, ENERGY, KINETIC, LARGEST, ENDS = range(7)
"""Places of numbers in ``Truth.progress``: time of the scenario, jumps of the energy, time until which the ledger is
computed, energies, the largest power, and when the ledger ends."""
PROGRESS = 7
"""How many they are."""

STEPS, CROSSINGS, WAITING, LINKED = range(4)
"""Places of numbers in ``Truth.counts``: acts of the session, rows of crossings and of waiting forces in use, and
ordered pairs linked under the graph of the law."""
COUNTS = 4
"""How many they are."""

ROWS, SWITCHES, FRAMES, ACTS, USES = range(5)
"""Places of numbers of rows in ``Records.counts``."""
TABLES = 5
"""How many they are."""

NONE, BERNOULLI, GILBERT_ELLIOTT, DISTANCE = range(4)
"""Kinds of losses."""


class Schedules(NamedTuple):
    """When agents act and measure, in nanoseconds.

    Parameters
    ----------
    period, phase
        Of the acts, shape (N,).
    latency
        From an act until its force acts, shape (N,).
    sampling, offset
        Period and phase of the samples, shape (N,); without messages they are not read.
    messages
        Whether there are messages.
    """

    period: Instants
    phase: Instants
    latency: Instants
    sampling: Instants
    offset: Instants
    messages: bool


class Sending(NamedTuple):
    """How messages are sent, as `flocking.model.world.information.Messages` defines it.

    Parameters
    ----------
    delay, jitter, expires
        In nanoseconds; ``expires`` is negative where samples never expire.
    predict, measured
        Whether samples are moved on, and whether agents know themselves by their newest sample.
    resolution, velocity_resolution
        Multiples to which samples are rounded; 0 where they are not.
    seed
        Seed of the draws.
    loss, paired
        Kind of the losses, and whether both directions lose alike.
    chances
        Numbers of the losses: probability; or probabilities of a loss in a good and in a bad channel, that of a redraw,
        that it is bad then, and that it is bad at first, and the sum of the probabilities of a change; or floor, range
        and exponent.
    noisy
        Whether samples have errors.
    deviations
        Standard deviations of positions and of velocities.
    memory
        Correlation of the errors of one sample with those of the next, of each agent, shape (N,).
    normals, first
        Standard normal numbers of the samples from number ``first`` of each agent on, shape (samples, N, 2 m), and
        these numbers, shape (N,).
    """

    delay: int
    jitter: int
    expires: int
    predict: bool
    measured: bool
    resolution: float
    velocity_resolution: float
    seed: int
    loss: int
    paired: bool
    chances: Array
    noisy: bool
    deviations: Array
    memory: Array
    normals: Array
    first: Instants


class Movement(NamedTuple):
    """The polynomials of the agents, see `flocking.engine.sampled.motion.Motion`.

    Parameters
    ----------
    order
        Order of the agents.
    masses, rate
        Masses and rates of damping, shape (N,).
    begin, longest
        As there.
    coefficients, force
        As there.
    binomials
        Binomials of a and k in row k, shape (degree + 1, degree + 1).
    limits, boxed
        Largest forces, in the order in which they act, shape (limits, N), and whether each axis is limited by itself.
    speed, speed_terms
        As in `flocking.engine.sampled.actuation.Actuation`; without largest speeds ``speed`` is of shape (0,).
    """

    order: int
    masses: Array
    rate: Array
    begin: Instants
    longest: Instants
    coefficients: Array
    force: Array
    binomials: Array
    limits: Array
    boxed: Mask
    speed: Array
    speed_terms: Array


class Acts(NamedTuple):
    """What agents did and will do.

    Parameters
    ----------
    ticked, applied, desired
        As in `flocking.engine.sampled.snapshot.SampledMemory`.
    when, who, what
        Forces that wait, in the order of their times, shapes (room,), (room,) and (room, m).
    """

    ticked: Instants
    applied: Instants
    desired: Array
    when: Instants
    who: Numbers
    what: Array


class Memory(NamedTuple):
    """What agents know, see `flocking.engine.imperfect.messages.knowledge.Knowledge`.

    Parameters
    ----------
    links, newest, taken
        As there.
    rows, start, distances
        As in `flocking.engine.imperfect.messages.samples.Samples`.
    errors
        Errors of the last samples, shape (N, 2 m).
    """

    links: Links
    newest: Numbers
    taken: Instants
    rows: Array
    start: Array
    distances: Array
    errors: Array


class KnownLaw(NamedTuple):
    """The law on what agents know, and room for the pairs of those that act.

    Parameters
    ----------
    control
        Address of its compiled function.
    degree
        Degree in time of what is known of a neighbour.
    pairs
        Pairs, with room for some number of them.
    times, rows
        What is known of the neighbours, shapes (room,) and (room, degree + 1, 2 m).
    """

    control: int
    degree: int
    pairs: Pairs
    times: Array
    rows: Array


class Truth(NamedTuple):
    """The true state beside the motion, and the law on it.

    Parameters
    ----------
    law, energies
        The law on the true state, whose pairs have room for more, and the address of its energies.
    unlinked
        Energy of a pair without a link.
    rules, known_rules, barriers
        When links switch, when those that agents know do, and under which graphs the energy has a barrier, shape
        (graphs,).
    rows
        Row of the limits of pieces of each graph and sensing agent, shape (graphs, N).
    lengths, table
        As in `flocking.engine.imperfect.pair_polynomials.Paths`.
    links, crossings, closest
        As in `flocking.engine.imperfect.session.ImperfectSession`; the crossings in no order, shape (room, 4).
    sums
        Integrals of the ledger and their errors, shape (2, 4).
    progress, counts
        Numbers, see `TIME` and `STEPS`.
    """

    law: LawInForce
    energies: int
    unlinked: float
    rules: LinkRules
    known_rules: LinkRules
    barriers: Mask
    rows: NDArray[np.int32]
    lengths: Array
    table: Array
    links: Links
    crossings: Array
    closest: Array
    sums: Array
    progress: Array
    counts: Numbers


class Records(NamedTuple):
    """What a block records.

    Parameters
    ----------
    counts
        Rows in use, see `ROWS`.
    trace, switches
        Rows of the ledger, shape (room, 8), and of switches: time, pair, whether the link breaks, graph, speed at which
        the distance changes, and relative speed, shape (room, 7).
    frame_times, q, p, links
        Times of the frames that are not made yet, and room for some of them.
    acts, forces, uses
        Rows of the log, see `flocking.engine.runs.message_log.MessageLog`.
    """

    counts: Numbers
    trace: Array
    switches: Array
    frame_times: Array
    q: Array
    p: Array
    links: Links
    acts: Numbers
    forces: Array
    uses: Numbers


class Bounds(NamedTuple):
    """How far a block goes.

    Parameters
    ----------
    base
        Time of the scenario at the start.
    end
        Seconds from the start before which events take place.
    most
        Most events.
    tolerance, rule
        Of the integrals of the ledger.
    """

    base: float
    end: float
    most: int
    tolerance: float
    rule: Rule


class Work(NamedTuple):
    """Arrays to work with.

    Parameters
    ----------
    S, q, p, seen, u
        Taylor coefficients about now, shape (degree + 1, N, m); positions, velocities, what the law takes for
        velocities, and forces, shape (N, m).
    acting, changed, there
        Who acts, whose motion changes, and who is known to whom, shapes (N,), (N,) and (N, N).
    length
        How long each motion goes on, shape (N,).
    closest, found
        Rows of closest pairs, and integrals, shape (2, 4).
    fresh
        Rows of crossings, shape (room, 4).
    three
        Three numbers.
    """

    S: Array
    q: Array
    p: Array
    seen: Array
    u: Array
    acting: Mask
    changed: Mask
    there: Links
    length: Array
    closest: Array
    found: Array
    fresh: Array
    three: Array
