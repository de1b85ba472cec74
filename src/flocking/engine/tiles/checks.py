"""Checks after each step: values that are not finite, lost links, and steps that are too large."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.arrays import Indices, Reals
from flocking.engine.fixed_step.contact_limits import singular_graphs
from flocking.engine.fixed_step.passing_pairs import check_passing
from flocking.engine.fixed_step.step_checks import ENERGY_ROUNDING, STRIDE, check_ledger, check_stride, step_too_large
from flocking.engine.runs.run import Closest
from flocking.engine.tiles.integrators import Integrator
from flocking.engine.tiles.law_check import LawCheck
from flocking.engine.tiles.neighbours.listed_pairs import tile_pairs
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.engine.tiles.records import TilesRecorder
from flocking.errors import LinkLost, NotFinite, OutOfPrecision
from flocking.model.checks import NO_LESS

COARSEST = 1e-2
"""Largest rounding error of positions, relative to the radius, that is accepted for most agents."""

UNSTABLE = 40.0
"""Largest accepted ratio of a given step to one that resolves the start. Beyond it a step reverses damped velocities,
amplifies them up to three times, and exceeds the period of oscillations."""

UNSTABLE_DESCENTS = {"euler": 80.0, "rk4": 11.2}
"""The same for agents of order 1, by integrator: twice the limit of stability (2 and 2.8) divided by `DESCENTS`. The
factor 2 is there because the resolved rate is an upper bound from sums; the true rate may be half of it."""

MOST_TILES = 4096
"""Largest number of tiles whose pairs are checked one by one after a step, about 65,000 agents; limits the time and
memory of a check. Tiles with the closest pairs come first, since those pairs approach fastest for their distance."""

FARTHEST = 1e15
"""Larger distances are the initial value of a kernel that found no pair."""


def after_step(
    particles: ParticleArrays, h: float, records: TilesRecorder, step: float, time: float, singular_reach: float | None
) -> None:
    """Run all checks of one step. The state before the step is still in ``particles.Y``.

    Parameters
    ----------
    h, step
        The length of the step just taken, and the largest step.
    records
        Receives the closest pair.
    time
        Time before the step.
    singular_reach
        Shortest radius of a potential that diverges at contact; None if there is none.

    Raises
    ------
    NotFinite
        If a position, a velocity or a force is not finite.
    LinkLost
        If a link broke although its potential is infinite at the break radius.
    StepTooLarge
        If a pair approached too far in one step for its distance.
    """
    _check_finite(particles, time)
    links_stay(particles, step, time)
    records.closest_linked = closest_pair(particles, records.closest_linked, time, particles.Y)
    _check_pair_motion(particles, h, step, time, singular_reach)


def _check_finite(particles: ParticleArrays, time: float) -> None:
    if not np.isfinite(particles.top_speed):
        particles.agree(lambda: _no_infinite_agent(particles, time))


def _no_infinite_agent(particles: ParticleArrays, time: float) -> None:
    if np.isfinite(particles.results.tile_extremes[:, 0]).all():
        return
    bad = np.flatnonzero(~np.isfinite(particles.X[:, : particles.n]).all(axis=0))
    what = "Velocities or positions"
    if not len(bad) and len(particles.body_rows.further):
        bad = np.flatnonzero(~np.isfinite(particles.body_rows.further[:, : particles.n]).all(axis=0))
        what = "Further columns" if len(bad) else what
    if not len(bad):
        bad = np.array([int(np.argmax(np.abs(particles.X[particles.m :, : particles.n]).max(axis=0)))])
    raise NotFinite(
        f"{what} became infinite or NaN. Lower the step, or check the potential there.",
        time=time, agents=tuple(sorted(int(i) for i in particles.ids[bad[:10]])),
    )  # fmt: skip


def closest_pair(particles: ParticleArrays, before: Closest, time: float, rows: Reals) -> Closest:
    """The closest listed pair so far.

    Parameters
    ----------
    before
        That of all earlier steps.
    time
        Time of the positions.
    rows
        Positions that the last pass was made from, each axis in a row, shape (m or more, size).
    """
    near = _nearest(particles)
    if not near < min(before.distance, FARTHEST):
        return before
    own = particles.results.tile_extremes[:, 1]
    least = float(own.min(initial=np.inf))
    pair = particles.agreed_pair(least, _closest_in(particles, int(np.argmin(own)), least, rows) if len(own) else None)
    return before if pair is None else Closest(near, time, pair)


def look_at_closest(particles: ParticleArrays, records: TilesRecorder, time: float) -> None:
    """Record the closest pair of a pass that has left the agents where they were.

    Parameters
    ----------
    records
        Receives the pair.
    """
    records.closest_linked = closest_pair(particles, records.closest_linked, time, particles.X)


def _nearest(particles: ParticleArrays) -> float:
    return float(np.sqrt(particles.results.extremes[1]))


def _check_pair_motion(
    particles: ParticleArrays, h: float, step: float, time: float, singular_reach: float | None
) -> None:
    """Check that no pair coincides where a formula is singular, or approached too far for its distance."""
    near = _nearest(particles)
    if near == 0.0:
        particles.agree(lambda: _check_contact(particles, time))
    if singular_reach is None:
        return
    top = 2.0 * particles.top_speed * h
    if top > STRIDE * near:
        particles.refresh_copies(particles.agents)
        particles.agree(lambda: _check_strides(particles, h, step, time))
    if top > STRIDE * singular_reach:
        found = particles.motions()
        if found is None:
            particles.agree(lambda: None)
            return
        q, moved, ids = found
        particles.agree(
            lambda: check_passing(q, moved, singular_reach, step, time=time, ids=ids, space=particles.space)
        )


def _check_contact(particles: ParticleArrays, time: float) -> None:
    """Check that no pair that coincided before the step is linked where a formula is singular."""
    for number in singular_graphs(particles.spec.layout, particles.m, particles.parameters.P):
        lists = particles.lists[number]
        if lists is None:
            continue
        i, j = tile_pairs(lists, np.flatnonzero(particles.results.tile_extremes[:, 1] == 0.0), particles.n)
        apart = particles.space.displacement((particles.Y[: particles.m, j] - particles.Y[: particles.m, i]).T)
        same = np.flatnonzero((apart == 0.0).all(axis=1))
        if len(same):
            pair = sorted((int(particles.ids[i[same[0]]]), int(particles.ids[j[same[0]]])))
            raise NotFinite(
                "Two linked agents are at the same point, where their pair force or energy is infinite. "
                "Start them apart, or use a potential that is finite at r = 0.",
                time=time, agents=tuple(pair),
            )  # fmt: skip


def stiff_start(step: float, resolves: float, scheme: str, order: int, time: float) -> None:
    """Check a given step for gross instability at the start, for runs without a ledger.

    Parameters
    ----------
    step
        The longest step.
    resolves
        A step that resolves the forces at the start.
    scheme
        Name of the integrator.
    order
        Order of the agents.

    Raises
    ------
    StepTooLarge
        If the step is unstable.
    """
    unstable = UNSTABLE if order == 2 else UNSTABLE_DESCENTS[scheme]
    if scheme != "damped" and step > unstable * resolves:
        why = f"it is {step / resolves:.3g} times one that resolves the forces at the start, and unstable"
        raise step_too_large(step, resolves, why, time=time)


def links_stay(particles: ParticleArrays, step: float, time: float) -> None:
    """Check that no link broke whose potential is infinite at the break radius.

    Parameters
    ----------
    particles
        The agents, after the step.
    step
        The longest step.

    Raises
    ------
    LinkLost
        If one did.
    """
    if particles.lost is not None:
        raise LinkLost(
            "A link whose potential is infinite at the break radius reached it: the step "
            f"{step:.3g} is too large. A step of {step / 4:.2g} may do.",
            time=time, agents=tuple(sorted(particles.lost)),
        )  # fmt: skip


def _listed(particles: ParticleArrays, tiles: Sequence[int] | Indices) -> tuple[Indices, Indices]:
    """Positions in the arrays of all listed pairs of some tiles, over all graphs."""
    found = [tile_pairs(lists, tiles, particles.n) for lists in particles.lists if lists is not None]
    return np.concatenate([i for i, _ in found]), np.concatenate([j for _, j in found])


def _closest_in(particles: ParticleArrays, tile: int, least: float, rows: Reals) -> tuple[int, int] | None:
    """Numbers of the linked agents of a tile whose squared distance the kernel found to be the ``least``."""
    # Lists have pairs that are not linked too; lists without marks have none that is as near.
    found = [
        tile_pairs(lists, [tile], particles.n, linked=kind.memory or kind.fixed)
        for lists, kind in zip(particles.lists, particles.spec.graphs, strict=True)
        if lists is not None
    ]
    i, j = (np.concatenate(x) for x in zip(*found, strict=True))
    if not len(i):
        return None
    apart = rows[: particles.m, j] - rows[: particles.m, i]
    square = (particles.space.displacement(apart.T) ** 2).sum(axis=1)
    k = int(np.argmin(np.abs(square - least)))
    a, b = int(particles.ids[i[k]]), int(particles.ids[j[k]])
    return (min(a, b), max(a, b))


def _check_strides(particles: ParticleArrays, h: float, step: float, time: float) -> None:
    """Check the approach of the closest pairs exactly; positions before the step are in ``Y``."""
    m = particles.m
    reach = (2.0 * particles.top_speed * h / STRIDE) ** 2
    tiles = np.flatnonzero(particles.results.tile_extremes[:, 1] < reach)
    if len(tiles) > MOST_TILES:
        tiles = tiles[np.argsort(particles.results.tile_extremes[tiles, 1], kind="stable")[:MOST_TILES]]
    i, j = _listed(particles, tiles)
    if not len(i):
        return
    distance = np.sqrt((particles.space.displacement((particles.Y[:m, j] - particles.Y[:m, i]).T) ** 2).sum(axis=1))
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
    """Check that floating-point numbers resolve the positions of most agents, shape (N, m).

    Raises
    ------
    OutOfPrecision
        If they do not.
    """
    if not particles.moving:
        return
    out = float(np.median(np.abs(q).max(axis=1)))
    spacing = float(np.finfo(particles.dtype).eps) * out
    if not resolved(particles, out):
        wider = "use precision='float64', or s" if particles.dtype == np.float32 else "S"
        raise OutOfPrecision(
            f"Most agents are so far from the origin ({out:.3g}) that {particles.spec.precision} resolves positions "
            f"only to {spacing:.2g}, of a radius of {max(particles.radii.cutoffs):.3g}: {wider}tart near the origin.",
            time=time,
        )


def resolved(particles: ParticleArrays, out: float) -> bool:
    """Whether floating-point numbers resolve a position so far from the origin.

    Parameters
    ----------
    out
        Its largest coordinate.
    """
    spacing = float(np.finfo(particles.dtype).eps) * out
    return not particles.moving or spacing <= COARSEST * max(particles.radii.cutoffs)


def ledger(
    records: TilesRecorder, scheme: Integrator, particles: ParticleArrays, law_check: LawCheck, step: float, time: float
) -> None:
    """Check that the residual of the energy ledger is small enough.

    Parameters
    ----------
    records
        The rows of the ledger.
    scheme
        The integrator, which has the last sums.
    law_check
        Estimates what rounding makes of the energy.
    step
        The largest step.
    """
    first, trace = records.first, records.trace
    if first is None or trace[-1][0] == first[0]:
        return
    sums = scheme.ledger_sums.sums
    scale = abs(sums["pairs"]) + abs(sums["bodies"]) + trace[-1][2]
    rounding = ENERGY_ROUNDING * float(np.finfo(particles.dtype).eps) * scale
    needed = check_ledger(
        step, first, trace[-1], order=scheme.order, rounding=rounding, time=time,
        of_places=lambda: law_check.energy_rounding(particles, time),
    )  # fmt: skip
    records.energy_rounding = max(records.energy_rounding, needed)
