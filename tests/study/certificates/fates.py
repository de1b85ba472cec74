"""Promises about the fate of a disagreement, its noise and its stops, held against runs of random scenarios."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import flocking as fk
from flocking.study.certificates.certificate import Certificates
from flocking.study.certificates.consensus_certificates import LinearConsensus
from flocking.study.certificates.linear.directed_consensus import DirectedConsensus
from flocking.study.certificates.sampled_consensus import SampledConsensus
from tests.study.certificates.lattice_scenarios import deformation_fates

FALLEN = 1e-2
"""Share of its first value to which a disagreement must fall where it is promised that it does."""

SURE = 1e7
"""Factor above its mean that a number which is not negative exceeds with a probability of at most 1e-7."""

DEVIATIONS = 8.0
"""Standard deviations of an average of many that are never seen by chance."""

SLACK = 1e-6
"""Relative error of runs, whose tolerance is 1e-9, and of what is computed here."""


@dataclass(frozen=True)
class Fate:
    """One promise beside a run.

    Parameters
    ----------
    key
        Key of the certificate.
    kept
        Whether it was kept.
    words
        What was seen.
    tightness
        Observed over promised; None where the two are no numbers of one kind.
    """

    key: str
    kept: bool
    words: str
    tightness: float | None = None


def fates(found: Certificates, run: fk.Run) -> list[Fate]:
    """What a finished run shows of promises that `compare` does not hold against it."""
    if not run.finished:
        return []
    return [
        *(Fate(*row) for row in deformation_fates(found, run)),
        *_world(found, run),
        *_decay(found, run),
        *_noise(found, run),
        *_stops(found, run),
        *_collisions(found, run),
    ]


def _spread(values: np.ndarray) -> np.ndarray:
    return np.sqrt(((values - values.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2)))


def _values(run: fk.Run) -> np.ndarray:
    # Positions of agents that agree on velocities alone stay apart.
    return np.asarray(run.q if run.scenario.agents.order == 1 else run.p, dtype=np.float64)


def _ticks(scenario: fk.Scenario) -> float:
    return (scenario.t_end - scenario.start.t) / float(np.max(scenario.control.period))


def _world(found: Certificates, run: fk.Run) -> list[Fate]:
    """Growth from tick to tick, and delays: what falls, what does not, and how far on average."""
    rows, scenario, values = [], run.scenario, _values(run)
    spread = _spread(values)
    if spread[0] < 1e-6:
        return rows
    loss = getattr(scenario.information, "loss", None)
    noise = getattr(scenario.information, "noise", None)
    if noise is not None:
        return rows
    for key in ("growth_in_world", "delay_in_world", "directed_growth_in_world"):
        each = next((c for c in found if c.key == key), None)
        if each is None or each.outcome == "not applicable":
            continue
        share, words = spread[-1] / spread[0], f"{spread[-1] / spread[0]:.3g} of the start"
        if loss is not None:
            expected = _expected(scenario)
            if expected is not None:
                seen = _squares(scenario, run)
                kept = seen <= SURE * expected * (1 + SLACK) + 1e-18
                rows.append(Fate(key, kept, f"{seen:.6g} where {expected:.6g} is the mean"))
            continue
        if each.granted and key.endswith("growth_in_world"):
            # Powers of a matrix exceed those of its spectral radius for a while.
            if each.bound.hi ** _ticks(scenario) < 1e-4 * FALLEN:
                rows.append(Fate(key, bool(share < FALLEN), words))
        elif each.granted and each.bound is not None:
            # Far below the limit 40 delays are many times of decay for the fast ones, and slow ones do not grow.
            far = scenario.information.tau < 0.7 * each.bound.lo
            if far and scenario.agents.order == 1:
                rows.append(Fate(key, bool(share < 1.0 + SLACK), words))
        elif "it does not fall" in each.reason or "it is not stable" in each.reason:
            moving = np.sqrt((values**2).sum(axis=(1, 2))) if "common motion" in each.reason else spread
            rows.append(Fate(key, bool(moving[-1] > 1e-9 * moving[0]), words))
    return rows


def _system(scenario: fk.Scenario) -> LinearConsensus:
    graph = scenario.law.graph
    return DirectedConsensus(scenario) if getattr(graph, "directed", False) else LinearConsensus(scenario)


def _expected(scenario: fk.Scenario) -> float | None:
    """The expected sum of squares of the differences to agent 0 at the end, by the recursion of second moments."""
    world = SampledConsensus(_system(scenario))
    if not world.consensus.holds or not world.holds:
        return None
    recursion = world.recursion(world.period)
    z = _remembered(scenario, world)
    if len(z) != recursion.size:
        return None
    x = np.outer(z, z)
    for _ in range(round(_ticks(scenario))):
        x = recursion.moment(x)
    return float(np.trace(x[: world.n - 1, : world.n - 1]))


def _remembered(scenario: fk.Scenario, world: SampledConsensus) -> np.ndarray:
    """What agents know at the start: everyone's exact state, as late as messages are."""
    values = scenario.start.p if world.consensus.only_velocities else scenario.start.q
    q = values[:, 0] - values[0, 0]
    block = q
    if world.order == 2:
        p = scenario.start.p[:, 0]
        block = np.concatenate([q, p - p[0]])
    parts = [np.tile(block, world.delayed_samples + 1)]
    if world.uses_older_samples:
        links = np.argwhere(scenario.law.graph.initial(scenario.start.q))
        parts.append(q[links[:, 1]])
    full = np.concatenate(parts)
    dropped = [0, world.n] if world.order == 2 and not world.holds_common_motion else [0]
    return np.delete(full, dropped)


def _squares(scenario: fk.Scenario, run: fk.Run) -> float:
    world = _system(scenario)
    values = np.asarray(run.p[-1] if world.only_velocities else run.q[-1], dtype=np.float64)[:, 0]
    return float(((values - values[0]) ** 2).sum())


def _decay(found: Certificates, run: fk.Run) -> list[Fate]:
    """Rates of decay in the ideal world, with what eigenvectors that are not orthogonal may hold back."""
    scenario, rows = run.scenario, []
    if scenario.imperfections:
        return rows
    time = float(run.t[-1] - run.t[0])
    for key in ("decay_rate", "directed_decay_rate"):
        each = next((c for c in found if c.key == key), None)
        if each is None or not each.granted:
            continue
        system = _system(scenario)
        # A symmetric Laplacian is diagonal in an orthogonal basis, seen relative to the mean.
        condition = 1.0 if key == "decay_rate" and system.is_first else _condition(scenario, system)
        if not condition < 1e6:
            continue
        about_mean = condition == 1.0
        first, last = (_state(run, frame, system, about_mean=about_mean) for frame in (0, -1))
        size = np.linalg.norm(first)
        most = condition * np.exp(-each.bound.lo * time) * size
        floor = 1e-7 * (size + float(np.abs(run.q).max()))
        kept = bool(np.linalg.norm(last) <= most * (1 + SLACK) + floor)
        tight = None
        if about_mean and most > 100.0 * floor:
            tight = float(np.linalg.norm(last) / most)
        rows.append(Fate(key, kept, f"{np.linalg.norm(last):.6g}, at most {most:.6g}", tight))
    return rows


def _state(run: fk.Run, frame: int, system: LinearConsensus, *, about_mean: bool) -> np.ndarray:
    """The disagreement at a frame, relative to the mean or to agent 0, shape (D, m)."""
    q, p = (np.asarray(x[frame], dtype=np.float64) for x in (run.q, run.p))
    q, p = (x - (x.mean(axis=0) if about_mean else x[0]) for x in (q, p))
    if system.is_first:
        return p if system.only_velocities else q
    return np.concatenate([q, p])


def _condition(scenario: fk.Scenario, system: LinearConsensus) -> float:
    """Condition of the eigenvectors of the motion relative to agent 0."""
    links = np.asarray(scenario.law.graph.initial(scenario.start.q), dtype=np.float64)
    laplacian = np.diag(links.sum(axis=1)) - links
    reduced = (laplacian - laplacian[0])[1:, 1:]
    if system.is_first:
        matrix = -float(system.first_gain.lo) * reduced
    else:
        n, a, b = len(reduced), float(system.place_gain.lo), float(system.rate_gain.lo)
        matrix = np.block([[np.zeros((n, n)), np.eye(n)], [-a * reduced, -b * reduced]])
    return float(np.linalg.cond(np.linalg.eig(matrix)[1]))


def _noise(found: Certificates, run: fk.Run) -> list[Fate]:
    """The average over the later part of a run beside the value in the long run."""
    each, growth = (next((c for c in found if c.key == k), None) for k in ("noise_in_world", "growth_in_world"))
    if each is None or not each.granted or not growth.granted or growth.bound.hi > 0.97:
        return []
    if getattr(run.scenario.information, "loss", None) is not None:
        return []
    values = np.asarray(run.p if "velocities" in each.quantity else run.q, dtype=np.float64)[:, :, 0]
    away = ((values - values.mean(axis=1, keepdims=True)) ** 2).mean(axis=1)
    begin = int(np.ceil(np.log(1e-8) / np.log(growth.bound.hi))) if growth.bound.hi > 0 else 1
    if len(away) - begin < 50:
        return []
    seen = float(away[begin:].mean())
    # Squares of normal numbers whose correlation falls with the square of the growth: at most this relative deviation.
    share = growth.bound.hi**2
    deviation = np.sqrt(2.0 / (len(away) - begin) * (1 + share) / (1 - share))
    kept = abs(seen - each.bound.hi) <= DEVIATIONS * deviation * each.bound.hi
    return [
        Fate("noise_in_world", bool(kept), f"{seen:.6g} where {each.bound.hi:.6g} is promised", seen / each.bound.hi)
    ]


def _stops(found: Certificates, run: fk.Run) -> list[Fate]:
    """Whether the way to rest is as long as promised at least, for the agent for which it is longest."""
    each = next((c for c in found if c.key == "stopping_distance"), None)
    if each is None or not each.granted:
        return []
    rest = np.linalg.norm(run.p[-1], axis=1).max() < 1e-6 * np.linalg.norm(run.p[0], axis=1).max()
    if not rest or len(run.scenario.law.pair_terms) != 1:
        return []
    way = float(np.linalg.norm(run.q[-1] - run.q[0], axis=1).max())
    kept = way >= each.bound.lo * (1.0 - SLACK)
    return [Fate("stopping_distance", bool(kept), f"{way:.9g} where {each.bound.lo:.9g} is least", each.bound.lo / way)]


def _collisions(found: Certificates, run: fk.Run) -> list[Fate]:
    """Pairs at one point at a frame."""
    each = next((c for c in found if c.key == "simultaneous_collisions"), None)
    if each is None or not each.granted:
        return []
    i, j = np.triu_indices(run.n, 1)
    if "linked" in each.quantity:
        linked = np.asarray(run.links[0])[i, j]
        i, j = i[linked], j[linked]
    most = max((int((np.linalg.norm(q[i] - q[j], axis=1) == 0.0).sum()) for q in np.asarray(run.q)), default=0)
    return [Fate("simultaneous_collisions", most <= each.bound.hi, f"{most} where {each.bound.hi} is most")]
