"""Claims about sampled motions of which no law is declared: what can be judged at the samples alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from flocking.formula.safe_digits import given_text
from flocking.model.graphs.connectivity import is_connected
from flocking.study.claims.claim import Basis, Claim, Measure, Origin, above, below
from flocking.study.claims.conclusions.limits import SETTLED, distances_settle, velocities_agree
from flocking.study.claims.subjects import Subject, about
from flocking.study.evidence import Evidence

SOURCE = "any motion"
"""Where these claims come from."""


@about(Subject.VELOCITIES, lasting=True)
def mean_velocity_constant(e: Evidence) -> Measure:
    """Largest change of the mean velocity against `SETTLED` of the largest speed."""
    fastest = float(e.speeds.max())
    error = 2.0 * e.velocity_error * float(np.sqrt(e.p.shape[2]))
    if not fastest and not error:
        return Measure(np.inf, 0.0, "all agents rest at all samples")
    drift = float(np.linalg.norm(e.mean_velocity - e.mean_velocity[0], axis=1).max())
    note = f"mean velocity moved by {drift:.2e}, largest speed {fastest:.2e}"
    return below(drift, SETTLED * fastest, note, (1 + SETTLED) * error)


@about(Subject.CLOSEST, lasting=True)
def apart_at_samples(e: Evidence) -> Measure:
    """Smallest distance of two agents at any sample."""
    c = e.closest
    if not np.isfinite(c.distance):
        return Measure(np.inf, 0.0, "one agent")
    note = f"closest {c.distance:.4g} at t = {e.when(c.time, 3)} (agents {c.pair[0]}, {c.pair[1]})"
    return above(c.distance, 0.0, note, e.distance_error)


def _radius(e: Evidence) -> float:
    return float(np.max(np.asarray(e.law.graph.break_radius)))


@about(Subject.CONNECTIVITY, lasting=True)
def connected_at_samples(e: Evidence) -> Measure:
    """Whether agents within the radius form one group at every sample, whatever the errors of the distances."""
    e.need_few()
    error, radius, doubtful = e.distance_error, _radius(e), -1
    for frame, q in enumerate(e.q):
        distance = e.distances(q)
        if is_connected(distance < radius - error):
            continue
        if not is_connected(distance < radius + error):
            return Measure(-1.0, 0.0, f"not one group at t = {e.when(e.t[frame])}, within {given_text(radius)}")
        doubtful = frame if doubtful < 0 else doubtful
    if doubtful >= 0:
        return Measure(1.0, np.inf, f"distances are too uncertain at t = {e.when(e.t[doubtful])}")
    return Measure(1.0, 0.0, f"one group at {len(e.t)} samples, within {given_text(radius)}")


@about(Subject.LINKS, lasting=True)
def neighbours_kept(e: Evidence) -> Measure:
    """Number of pairs within the radius at the first sample that are not within it at another one."""
    e.need_few()
    error, radius = e.distance_error, _radius(e)
    first = e.distances(e.q[0])
    # Distances of agents to themselves are infinite; agents at one point are neighbours.
    sure, possible = np.triu(first < radius - error, 1), np.triu(first < radius + error, 1)
    lost, perhaps = np.zeros_like(sure), np.zeros_like(sure)
    for q in e.q[1:]:
        distance = e.distances(q)
        lost |= sure & (distance >= radius + error)
        perhaps |= possible & (distance >= radius - error)
    count, most = int(lost.sum()), int(perhaps.sum())
    note = f"{count} of {int(sure.sum())} first neighbours are further apart than {given_text(radius)} at some sample"
    if most and not count:
        return Measure(0.5, np.inf, f"{note}; {most} may be")
    return Measure(0.5 - count, 0.0, note)


def _asked(key: str, statement: str, conclusion: Callable[[Evidence], Measure]) -> Claim:
    """A claim that nobody states and of which no verdict is expected."""
    return Claim(key, SOURCE, statement, conclusion, dynamic=False, origin=Origin.OWN, basis=Basis.OBSERVATION)


WITHOUT_LAW: tuple[Claim, ...] = (
    _asked("mean-velocity", "At every sample the mean velocity is the same, to 1 % of the largest speed.",
           mean_velocity_constant),
    _asked("velocities-agree", "All velocities become the same.", velocities_agree),
    _asked("distances-settle", "All distances become constant.", distances_settle),
    _asked("apart", "At every sample all agents are apart.", apart_at_samples),
)  # fmt: skip
"""Claims that need neither a law nor a radius."""

WITHIN_RADIUS: tuple[Claim, ...] = (
    _asked("connected", "At every sample the agents within the radius form one group.", connected_at_samples),
    _asked(
        "neighbours-kept",
        "At every sample agents that were within the radius at the first one still are.",
        neighbours_kept,
    ),
)
"""Claims that need a radius, within which agents are neighbours."""


def claims_without_law(radius: float | None) -> tuple[Claim, ...]:
    """Claims about samples of a motion without a declared law.

    Parameters
    ----------
    radius
        Radius within which agents are neighbours; without it no claim about neighbours is made.
    """
    return WITHOUT_LAW if radius is None else (*WITHOUT_LAW, *WITHIN_RADIUS)
