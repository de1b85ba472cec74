"""Checks after the fact: bad numbers, lost links, steps too large for what the agents met."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.arrays import Indices, Reals
from flocking.engine.fixed_step.contact_limits import singular_graphs
from flocking.engine.fixed_step.passing_pairs import check_passing
from flocking.engine.fixed_step.step_checks import STRIDE, check_ledger, check_stride, step_too_large
from flocking.engine.runs.run import Closest
from flocking.engine.tiles.integrators import Integrator
from flocking.engine.tiles.neighbours.listed_pairs import tile_pairs
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.engine.tiles.records import TilesRecorder
from flocking.errors import LinkLost, NotFinite, OutOfPrecision
from flocking.model.checks import NO_LESS

COARSEST = 1e-2
"""Largest share of the radius that the rounding of positions may take for most agents."""

UNSTABLE = 40.0
"""A step so many times longer than one that resolves the start turns damped velocities round, to three times their
size, and skips whole periods of its oscillations."""

UNSTABLE_DESCENTS = {"euler": 80.0, "rk4": 11.2}
"""The same for agents of order 1, by scheme: twice the limit of stability, 2 and 2.8, over `DESCENTS`, since the rate
that a step resolves is a bound by sums, which the true one may be half of."""

MOST_TILES = 4096
"""Tiles whose pairs are measured one by one after a step, those with the closest pairs first: a bound on the time and
the memory of a check, some 65,000 agents. A pair moves too far for its distance where distances are least."""

FARTHEST = 1e15
"""Distances beyond it are those of no pair at all: what a kernel starts from that has not met one."""


def after_step(
    particles: ParticleArrays, h: float, records: TilesRecorder, step: float, time: float, singular_reach: float | None
) -> None:
    """What every step is checked for. The state before the step is still in ``particles.Y``.

    Parameters
    ----------
    h, step
        The step just made, and the longest step.
    records
        Take the closest pair.
    time
        Time before the step.
    singular_reach
        Where a potential diverges at contact, the shortest radius of such a one; None where none does.

    Raises
    ------
    NotFinite
        When a position, a velocity or a force is no number.
    LinkLost
        When a link broke although its potential is infinite there.
    StepTooLarge
        When a pair moved too far for its distance.
    """
    _check_finite(particles, time)
    links_kept(particles, step, time)
    records.closest_linked = _closest_pair(particles, records.closest_linked, time)
    _check_pair_motion(particles, h, step, time, singular_reach)


def _check_finite(particles: ParticleArrays, time: float) -> None:
    if np.isfinite(particles.top_speed):
        return
    bad = np.flatnonzero(~np.isfinite(particles.X[:, : particles.n]).all(axis=0))
    if not len(bad):
        bad = np.array([int(np.argmax(np.abs(particles.X[particles.m :, : particles.n]).max(axis=0)))])
    raise NotFinite(
        "Velocities or positions became infinite or NaN. Lower the step, or look at the potential there.",
        time=time, agents=tuple(sorted(int(i) for i in particles.ids[bad[:10]])),
    )  # fmt: skip


def _closest_pair(particles: ParticleArrays, before: Closest, time: float) -> Closest:
    """The closest listed pair until now, given that of all earlier steps."""
    near = _nearest(particles)
    if not near < min(before.distance, FARTHEST):
        return before
    pair = _closest_in(particles, int(np.argmin(particles.tile_extremes[:, 1])))
    return before if pair is None else Closest(near, time, pair)


def _nearest(particles: ParticleArrays) -> float:
    return float(np.sqrt(particles.extremes[1]))


def _check_pair_motion(
    particles: ParticleArrays, h: float, step: float, time: float, singular_reach: float | None
) -> None:
    """Whether a pair met where a formula has no value, or moved too far for its distance."""
    near = _nearest(particles)
    if near == 0.0:
        _check_contact(particles, time)
    if singular_reach is None:
        return
    top = 2.0 * particles.top_speed * h
    if top > STRIDE * near:
        _check_strides(particles, h, step, time)
    if top > STRIDE * singular_reach:
        q = particles.Y[: particles.m, : particles.n].T.astype(np.float64)
        moved = particles.X[: particles.m, : particles.n].T - q
        check_passing(q, moved, singular_reach, step, time=time, ids=particles.ids)


def _check_contact(particles: ParticleArrays, time: float) -> None:
    """Whether a pair that coincided before the step is linked where a formula has no value for it."""
    for number in singular_graphs(particles.spec.layout, particles.m, particles.parameters.P):
        lists = particles.lists[number]
        if lists is None:
            continue
        i, j = tile_pairs(lists, np.flatnonzero(particles.tile_extremes[:, 1] == 0.0), particles.n)
        same = np.flatnonzero((particles.Y[: particles.m, i] == particles.Y[: particles.m, j]).all(axis=0))
        if len(same):
            pair = sorted((int(particles.ids[i[same[0]]]), int(particles.ids[j[same[0]]])))
            raise NotFinite(
                "Two linked agents are at the same point, where their pair force or energy is infinite. "
                "Start them apart, or take a potential that is finite at r = 0.",
                time=time, agents=tuple(pair),
            )  # fmt: skip


def stiff_start(step: float, resolves: float, scheme: str, order: int, time: float) -> None:
    """Whether a step that no ledger will judge is beyond all stability at the start.

    Parameters
    ----------
    step
        The longest step.
    resolves
        A step that resolves the forces of the start.
    scheme
        Name of the integrator.
    order
        Order of the agents.

    Raises
    ------
    StepTooLarge
        When it is.
    """
    unstable = UNSTABLE if order == 2 else UNSTABLE_DESCENTS[scheme]
    if scheme != "damped" and step > unstable * resolves:
        why = f"it is {step / resolves:.3g} times one that resolves the forces of the start, and unstable"
        raise step_too_large(step, resolves, why, time=time)


def links_kept(particles: ParticleArrays, step: float, time: float) -> None:
    """Whether a link broke although its potential is infinite there.

    Parameters
    ----------
    particles
        The agents, after the step.
    step
        The longest step.

    Raises
    ------
    LinkLost
        When one did.
    """
    if particles.lost is not None:
        raise LinkLost(
            "A link whose potential is infinite at the break radius reached it: the step "
            f"{step:.3g} is too large. A step of {step / 4:.2g} may do.",
            time=time, agents=tuple(sorted(particles.lost)),
        )  # fmt: skip


def _listed(particles: ParticleArrays, tiles: Sequence[int] | Indices) -> tuple[Indices, Indices]:
    """Places of all listed pairs of some tiles, over all graphs."""
    found = [tile_pairs(lists, tiles, particles.n) for lists in particles.lists if lists is not None]
    return np.concatenate([i for i, _ in found]), np.concatenate([j for _, j in found])


def _closest_in(particles: ParticleArrays, tile: int) -> tuple[int, int] | None:
    i, j = _listed(particles, [tile])
    if not len(i):
        return None
    square = ((particles.Y[: particles.m, j] - particles.Y[: particles.m, i]) ** 2).sum(axis=0)
    k = int(np.argmin(square))
    a, b = int(particles.ids[i[k]]), int(particles.ids[j[k]])
    return (min(a, b), max(a, b))


def _check_strides(particles: ParticleArrays, h: float, step: float, time: float) -> None:
    """Whether some pair really moved too far for its distance; positions before the step are in ``Y``."""
    m = particles.m
    reach = (2.0 * particles.top_speed * h / STRIDE) ** 2
    tiles = np.flatnonzero(particles.tile_extremes[:, 1] < reach)
    if len(tiles) > MOST_TILES:
        tiles = tiles[np.argsort(particles.tile_extremes[tiles, 1], kind="stable")[:MOST_TILES]]
    i, j = _listed(particles, tiles)
    if not len(i):
        return
    distance = np.sqrt(((particles.Y[:m, j] - particles.Y[:m, i]) ** 2).sum(axis=0))
    moved = np.sqrt(
        ((particles.X[:m, j] - particles.X[:m, i] - particles.Y[:m, j] + particles.Y[:m, i]) ** 2).sum(axis=0)
    )
    linked = distance < max(particles.radii.cutoffs) if particles.moving else np.ones(len(i), dtype=bool)
    share = np.where(linked, moved / np.maximum(distance, NO_LESS), 0.0)
    k = int(np.argmax(share))
    if linked[k]:
        pair = (int(particles.ids[i[k]]), int(particles.ids[j[k]]))
        check_stride(step, float(distance[k]), float(moved[k]), time=time, agents=(min(pair), max(pair)))


def resolution(particles: ParticleArrays, q: Reals, time: float) -> None:
    """Whether numbers can still tell the positions of most agents, shape (N, m), apart.

    Raises
    ------
    OutOfPrecision
        When they cannot.
    """
    if not particles.moving:
        return
    out = float(np.median(np.abs(q).max(axis=1)))
    spacing = float(np.finfo(particles.dtype).eps) * out
    if spacing > COARSEST * max(particles.radii.cutoffs):
        wider = "use precision='float64', or s" if particles.dtype == np.float32 else "S"
        raise OutOfPrecision(
            f"Most agents are so far out ({out:.3g}) that {particles.spec.precision} tells positions apart only by "
            f"{spacing:.2g}, of a radius of {max(particles.radii.cutoffs):.3g}: {wider}tart near the origin.",
            time=time,
        )


def ledger(records: TilesRecorder, scheme: Integrator, eps: float, step: float, time: float) -> None:
    """Whether the energy ledger closes well enough.

    Parameters
    ----------
    records
        The rows of the ledger.
    scheme
        The integrator, which holds the last sums.
    eps
        Rounding unit of the state.
    step
        The longest step.
    """
    first, trace = records.first, records.trace
    if first is None or trace[-1][0] == first[0]:
        return
    sums = scheme.ledger_sums.sums
    scale = abs(sums["pairs"]) + abs(sums["bodies"]) + trace[-1][2]
    check_ledger(step, first, trace[-1], order=scheme.order, rounding=1e3 * eps * scale, time=time)
