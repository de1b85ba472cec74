"""What was promised of a scenario beside what a run of it shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Indices
from flocking.engine.reference.control import control
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput
from flocking.model.bodies.actuators import Limited
from flocking.model.law import Law
from flocking.model.observables import diameters
from flocking.model.terms.avoidance import Avoid
from flocking.model.world.safety_filters import SafetyFilter
from flocking.study.certificates.certificate import Certificate, Certificates
from flocking.study.certificates.energy_setting import EnergySetting
from flocking.study.evidence import Evidence, NotMeasurable, NotResolvable
from flocking.study.evidence.obstacle_approach import nearest_obstacle

MOST_STATES = 32
"""Frames of which the energy is computed, at even places of the run."""

ROUNDING = 1e-9
"""Relative difference up to which a value beyond its bound counts as kept whatever the error."""

RESOLVED = 100.0
"""Differences of velocities that are this many times their error count in a rate of decay."""


@dataclass(frozen=True)
class Comparison:
    """One certificate beside a run.

    Parameters
    ----------
    key
        Key of the certificate.
    promised
        The safe end of its bound.
    observed
        What the run shows; between its frames only where the engine records it, and of obstacles.
    error
        Error of what was observed.
    kept
        Whether the promise was kept, within the error; None where it seems broken and the run states no error.
    tightness
        The observed over the promised value, or its inverse for a lower bound: at most 1 where the promise is kept, and
        1 where nothing better could have been promised.
    """

    key: str
    promised: float
    observed: float
    error: float
    kept: bool | None
    tightness: float

    def as_dict(self) -> dict[str, object]:
        """The comparison as plain values for JSON."""
        return dict(vars(self))


def compare(certificates: Certificates, run: Run) -> tuple[Comparison, ...]:
    """Every granted certificate that a run can be held against, beside what it shows.

    Parameters
    ----------
    certificates
        Those of the scenario of the run.
    run
        The run, under one law throughout; its frames are looked at, and for closest approaches all of its steps.

    Raises
    ------
    InvalidInput
        When it holds no frames.
    """
    if not len(run.t):
        raise InvalidInput("compare", "run", "must hold frames", run, "Leave Scenario.frames as it is.")
    found = []
    for each in certificates.granted:
        if each.key in _OBSERVED:
            seen = _OBSERVED[each.key](run, each)
            if seen is not None:
                found.append(_compared(each, *seen))
    return tuple(found)


def _compared(certificate: Certificate, observed: float, error: float) -> Comparison:
    promised = certificate.safe_bound
    assert promised is not None
    slack = (error if np.isfinite(error) else 0.0) + ROUNDING * abs(promised)
    if certificate.side == "at least":
        within, small, large = observed >= promised - slack, promised, observed
    else:
        within, small, large = observed <= promised + slack, observed, promised
    kept = True if within else False if np.isfinite(error) else None
    tightness = 1.0 if small == large else small / large if large else np.inf
    return Comparison(certificate.key, promised, observed, error, kept, float(tightness))


def _closest(run: Run, certificate: Certificate) -> tuple[float, float] | None:
    """The closest approach of those pairs that the certificate is about."""
    found = run.closest_linked if "linked" in certificate.quantity else run.closest
    return (found.distance, found.error) if np.isfinite(found.distance) else None


def _obstacles(run: Run, certificate: Certificate) -> tuple[float, float]:
    """The smallest distance of an agent from an obstacle of the safety filter."""
    control = run.scenario.control
    assert isinstance(control, SafetyFilter)
    found = nearest_obstacle(run, control.obstacles)
    error = 0.5 * _position_error(run)
    # What the sampled engine computes is exact up to rounding, which the promise allows for.
    return found.distance, found.error + (error if np.isfinite(error) else 0.0)


def _avoided(run: Run, certificate: Certificate) -> tuple[float, float]:
    """The smallest distance of an agent from an obstacle of the law."""
    obstacles = [x for term in run.scenario.law.body_terms if type(term) is Avoid for x in term.obstacles]
    found = nearest_obstacle(run, obstacles)
    return found.distance, found.error + 0.5 * _position_error(run)


def _link_lengths(run: Run, certificate: Certificate) -> tuple[float, float] | None:
    if run.links.shape[1:] != (run.n, run.n):
        return None
    largest = 0.0
    for q, links in zip(run.q, run.links, strict=True):
        i, j = np.nonzero(links)
        largest = max(largest, float(np.linalg.norm(q[i] - q[j], axis=1).max(initial=0.0)))
    return largest, _position_error(run)


def _diameter(run: Run, certificate: Certificate) -> tuple[float, float]:
    return float(diameters(run.q).max()), _position_error(run)


def _position_error(run: Run) -> float:
    """Error of a distance at any frame: that of both positions; NaN where it is not known."""
    if run.accuracy is None or not len(run.accuracy.frames):
        return np.nan
    return 2.0 * float(run.accuracy.frames[:, 0].max())


def _losses(run: Run, certificate: Certificate) -> tuple[float, float] | None:
    """Number of links lost, and how many of them are in doubt, NaN where the errors of the motion leave all open.

    Where no switches are recorded frames can show a loss, but not that there is none.
    """
    evidence = Evidence(run)
    if not evidence.switches_known and not evidence.seen_lost:
        return None
    lost = evidence.links_lost if evidence.switches_known else evidence.seen_lost
    if not lost or evidence.sampled:
        return float(lost), 0.0
    if run.accuracy is not None:
        return float(lost), float(lost - evidence.numbers("break")[0])
    try:
        certain = evidence.lost_for_certain()
    except (NotMeasurable, NotResolvable):
        certain = 0
    return float(lost), float(lost - certain) if certain else np.nan


def _speed(run: Run, certificate: Certificate) -> tuple[float, float]:
    setting = EnergySetting(run.scenario)
    p = np.asarray(run.p, dtype=np.float64)
    if setting.frame == "centre of mass":
        p = p - np.einsum("i,fik->fk", setting.masses, p)[:, None] / setting.masses.sum()
    elif setting.track is not None:
        p = p - setting.track.leader.along(run.t)[1][:, None]
    return float(np.linalg.norm(p, axis=2).max()), _velocity_error(run)


def _centre_speeds(run: Run, *, behind: bool) -> Array:
    """Speeds of the centre of mass at the frames, at rest or relative to the leader, shape (F,)."""
    p = np.asarray(run.p, dtype=np.float64)
    masses = np.broadcast_to(np.asarray(run.scenario.agents.masses, dtype=np.float64), run.n)
    mean = np.einsum("i,fik->fk", masses, p) / masses.sum()
    if behind:
        mean = mean - run.scenario.law.leaders[0].along(run.t)[1]
    return np.asarray(np.linalg.norm(mean, axis=1))


def _drift(run: Run, certificate: Certificate) -> tuple[float, float]:
    return float(_centre_speeds(run, behind=False).max()), _velocity_error(run)


def _mean_error(run: Run, certificate: Certificate) -> tuple[float, float]:
    return float(_centre_speeds(run, behind=True).max()), _velocity_error(run)


def _mean_error_at_end(run: Run, certificate: Certificate) -> tuple[float, float] | None:
    if not run.finished or run.t[-1] != run.scenario.t_end:
        return None
    return float(_centre_speeds(run, behind=True)[-1]), _velocity_error(run)


def _velocity_error(run: Run) -> float:
    """Error of a difference of velocities at any frame; NaN where it is not known."""
    if run.accuracy is None or not len(run.accuracy.frames):
        return np.nan
    return 2.0 * float(run.accuracy.frames[:, 1].max())


def _velocity_difference(run: Run, certificate: Certificate) -> tuple[float, float]:
    return float(diameters(run.p).max()), _velocity_error(run)


def _alignment_rate(run: Run, certificate: Certificate) -> tuple[float, float] | None:
    """The smallest average rate of decay up to a frame, of those whose difference is well above its error."""
    differences, error = diameters(run.p), _velocity_error(run)
    first, later = differences[0], differences[1:]
    doubt = (error if np.isfinite(error) else 0.0) + ROUNDING * first
    seen = later > RESOLVED * doubt
    if not seen.any():
        return None
    times = (run.t[1:] - run.t[0])[seen]
    rates = np.log(first / later[seen]) / times
    k = int(np.argmin(rates))
    return float(rates[k]), float(2.0 * error / (later[seen][k] * times[k]))


def _force(run: Run, certificate: Certificate) -> tuple[float, float]:
    """The largest force of the law at some frames; its error is not known."""
    return float(max(_forces(run).max(initial=0.0), 0.0)), np.nan


def _forces(run: Run) -> Array:
    """Sizes of the forces of the law at some frames, shape (frames, N)."""
    frames = np.unique(np.linspace(0, len(run.t) - 1, MOST_STATES).astype(int))
    law, agents = run.scenario.law, run.scenario.agents
    if type(agents) is Limited:
        agents = agents.body
    found = [control(law, run.state(int(frame)), agents=agents) for frame in frames]
    return np.asarray(np.linalg.norm(np.array(found), axis=2))


def _limits(run: Run, certificate: Certificate) -> tuple[float, float]:
    """The largest share of a limit that forces and speeds use at some frames; its error is not known."""
    body = run.scenario.agents
    assert type(body) is Limited
    largest, forces = 0.0, _forces(run)
    if body.force is not None:
        largest = max(largest, float((forces / np.asarray(body.force)).max()))
    if body.speed is not None:
        speeds = forces if body.order == 1 else np.linalg.norm(np.asarray(run.p, dtype=np.float64), axis=2)
        largest = max(largest, float((speeds / np.asarray(body.speed)).max()))
    return largest, np.nan


def _disagreement(run: Run, certificate: Certificate) -> tuple[float, float]:
    """Root of the sum of squares about the mean, at the frames; its error is at most that of all agents together."""
    of_velocities = "velocities" in certificate.quantity
    values = np.asarray(run.p if of_velocities else run.q, dtype=np.float64)
    away = values - values.mean(axis=1, keepdims=True)
    error = _velocity_error(run) if of_velocities else _position_error(run)
    return float(np.sqrt((away**2).sum(axis=(1, 2)).max())), float(np.sqrt(run.n) * error)


def _energy(run: Run, certificate: Certificate) -> tuple[float, float]:
    """The largest excess among some frames; see `EnergySetting.start_excess`."""
    frames = np.unique(np.linspace(0, len(run.t) - 1, MOST_STATES).astype(int))
    setting = EnergySetting(run.scenario)
    largest = max(float(setting.at(run.state(int(frame))).start_excess.lo) for frame in frames)
    # No part of the excess is negative, though the lower end of its enclosure may be.
    return max(largest, 0.0), _energy_error(run, frames)


def _energy_error(run: Run, frames: Indices) -> float:
    """Error of the energy at some frames, of first order in the errors of positions and velocities, and doubled.

    NaN where a force is infinite.
    """
    if run.accuracy is None or not len(run.accuracy.frames):
        return np.nan
    setting = EnergySetting(run.scenario)
    errors = []
    for frame in frames:
        state, (of_q, of_p) = run.state(int(frame)), run.accuracy.frames[frame]
        force = np.zeros(1)
        if setting.gradients:
            law = Law(run.scenario.law.graph, setting.gradients)
            force = np.linalg.norm(control(law, state, agents=run.scenario.agents), axis=1)
        total = float(force.sum())
        error = total * float(of_q) if np.isfinite(total) else np.nan
        if setting.order == 2:
            error += float((setting.masses * np.linalg.norm(state.p, axis=1)).sum() * of_p)
        if setting.track is not None:
            away = np.linalg.norm(state.q - setting.track.leader.at(state.t)[0], axis=1)
            error += float((setting.position_gains * away).sum() * of_q)
        errors.append(2.0 * error)
    return float(np.max(errors))


_OBSERVED: dict[str, Callable[[Run, Certificate], tuple[float, float] | None]] = {
    "largest_energy": _energy,
    "closest_approach": _closest,
    "safe_distance": _closest,
    "obstacle_distance": _obstacles,
    "obstacles_not_entered": _avoided,
    "longest_link": _link_lengths,
    "group_diameter": _diameter,
    "alignment_diameter": _diameter,
    "velocity_difference": _velocity_difference,
    "alignment_rate": _alignment_rate,
    "steady_drift": _drift,
    "mean_leader_error": _mean_error,
    "mean_leader_error_at_end": _mean_error_at_end,
    "disagreement": _disagreement,
    "largest_force": _force,
    "limit_never_acts": _limits,
    "links_kept": _losses,
    "largest_speed": _speed,
}
"""How a run shows the quantity of a certificate, by key."""
