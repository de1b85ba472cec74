"""Velocities, distances and forces of a run at its frames."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flocking.engine.runs.run import Largest
from flocking.model.checks import Array
from flocking.model.observables import diameters
from flocking.model.potentials.potential import Potential
from flocking.study.evidence.basis import NotMeasurable, NotResolvable, RunEvidence
from flocking.study.evidence.repetitions import Repetitions, repetitions_of
from flocking.study.potentials.equilibrium import Equilibrium

LATE = 0.1
"""Share of a run at its end over which a limit must hold, by the criterion of claims about limits."""

ROUNDINGS = 2
"""Operations on top of the N of a mean that round a difference from it, in units of the spacing of doubles at 1."""


class MotionEvidence(RunEvidence):
    """Velocities, distances and forces."""

    @cached_property
    def repetitions(self) -> Repetitions:
        """The run again, twice, with more accurate steps.

        Raises
        ------
        NotResolvable
            When it cannot be repeated, or their motions differ too much for an estimate.
        """
        return repetitions_of(self.checked)

    @cached_property
    def mean_velocity(self) -> Array:
        """Velocity of the centre of mass at the frames, shape (F, m)."""
        return np.asarray(np.einsum("i,fik->fk", self.masses, self.p) / self.masses.sum())

    @cached_property
    def spread_times(self) -> Array:
        """Times of `velocity_spread`, shape (F,)."""
        return np.asarray(self.run.observables["time"]) if self._observed_spread else self.t  # type: ignore[index]

    @cached_property
    def velocity_spread(self) -> Array:
        """Largest |p_i - mean| at each frame, shape (F,); the recorded observable where the run has no frames.

        Raises as `p` does, for agents of order 1.
        """
        if self._observed_spread:
            return np.asarray(self.run.observables["spread"])  # type: ignore[index]
        offsets = self.p - self.mean_velocity[:, None, :]
        return np.asarray(np.linalg.norm(offsets, axis=2).max(axis=1))

    @cached_property
    def spread_rounding(self) -> float:
        """Most that rounding adds to `velocity_spread`; 0 where it is a recorded observable.

        A sum of N products has a relative error of at most N + 1 units of rounding, the sum of the masses N, their
        ratio and a difference one each, a unit being half the spacing of doubles at 1 (N. J. Higham, Accuracy and
        Stability of Numerical Algorithms, 2002, section 3.1).
        """
        if self._observed_spread:
            return 0.0
        return (self.run.n + ROUNDINGS) * float(np.finfo(np.float64).eps) * float(self.speeds.max())

    @cached_property
    def spread_error(self) -> float:
        """Estimated error of the differences of two velocities of the run; 0 where none is stated."""
        return float(self.spread_errors.max(initial=0.0))

    @cached_property
    def spread_errors(self) -> Array:
        """The same at each of `spread_times`, shape (F,); where these are no frames, the largest of the frames."""
        stated = 2.0 * self.velocity_error * float(np.sqrt(self.run.scenario.start.q.shape[1]))
        return stated + 2.0 * self.stated_errors(1, len(self.spread_times))

    def stated_errors(self, column: int, count: int) -> Array:
        """Errors that the run states of single agents at its frames, shape (count,); 0 where it states none.

        Parameters
        ----------
        column
            0 for positions, 1 for velocities.
        count
            Number of times; where it is not that of the frames, each has the largest error of these.
        """
        known = None if self.run.accuracy is None else np.asarray(self.run.accuracy.frames[:, column], dtype=np.float64)
        if known is None:
            return np.zeros(count)
        return known if len(known) == count else np.full(count, known.max(initial=0.0))

    @cached_property
    def late_errors(self) -> tuple[float, float]:
        """Estimated errors of a distance of two agents, and of a difference of two velocities, at the end of the run.

        The largest of the last tenth of the run, over which claims about limits are judged; 0 where none is stated.
        """
        place, speed, root = self.position_error, self.velocity_error, float(np.sqrt(self.run.q.shape[2]))
        found = np.array([root * place, root * speed])
        if self.run.accuracy is not None and len(self.run.accuracy.frames):
            errors = np.asarray(self.run.accuracy.frames)
            late = self.t >= self.t[-1] - LATE * (self.t[-1] - self.t[0]) if len(errors) == len(self.t) else slice(None)
            found = found + errors[late].max(axis=0)
        return 2.0 * float(found[0]), 2.0 * float(found[1])

    @property
    def _observed_spread(self) -> bool:
        seen, moving = self.run.observables, self.run.scenario.agents.order > 1
        return not len(self.run.t) and seen is not None and len(seen) > 0 and not np.ptp(self.masses) and moving

    @cached_property
    def speeds(self) -> Array:
        """Largest speed at each frame, shape (F,)."""
        return np.asarray(np.linalg.norm(self.p, axis=2).max(axis=1))

    @property
    def largest_spread(self) -> float:
        """Largest |p_i - mean| of the run, between the frames too where that is known."""
        found = self.largest("spread")
        return max(float(self.velocity_spread.max()), -np.inf if found is None else found.value)

    def largest(self, name: str) -> Largest | None:
        """Largest value of a quantity over the whole run, between frames too; None where that is not known.

        Parameters
        ----------
        name
            As in `flocking.engine.runs.run.Accuracy`.
        """
        return None if self.run.accuracy is None else self.run.accuracy.largest.get(name)

    @cached_property
    def path_about_mean(self) -> float:
        """Longest path of an agent about the mean position, from frame to frame, against the largest distance from it.

        Infinite without frames, for one agent, and where all agents are at one place.
        """
        size, before = 0.0, None
        paths = np.zeros(self.q.shape[1])
        for q in self.q:
            offsets = q - q.mean(axis=0)
            size = max(size, float(np.linalg.norm(offsets, axis=1).max()))
            paths += 0.0 if before is None else np.linalg.norm(offsets - before, axis=1)
            before = offsets
        return float(paths.max()) / size if size > 0.0 else np.inf

    @cached_property
    def diameter(self) -> Array:
        """Largest distance of two agents at each frame, shape (F,), of positions as they are, not of their images."""
        self.need_few()
        return diameters(self.q)

    @cached_property
    def distance_rate(self) -> float:
        """Largest rate of change of a pair distance at the last frame."""
        return self.distance_rate_at(-1)

    def distance_rate_at(self, frame: int) -> float:
        """Largest rate of change of a pair distance at a frame."""
        self.need_few()
        q, p = self.q[frame], self.p[frame]
        i, j = np.triu_indices(self.run.n, 1)
        if len(i) == 0:
            return 0.0
        d, v = self.displacement(q[j] - q[i]), p[j] - p[i]
        r = np.linalg.norm(d, axis=1)
        return float(np.abs((d * v).sum(axis=1) / np.where(r > 0, r, 1.0)).max())

    @cached_property
    def distance_rate_error(self) -> float:
        """Error of `distance_rate` from that of the positions; 0 where they are exact.

        The unit vector between two agents a distance r apart is off by at most 2 d / r, and never by more than 2, where
        d is the error of the vector between them.
        """
        off = self.late_errors[0]
        if not off:
            return 0.0
        i, j = np.triu_indices(self.run.n, 1)
        if len(i) == 0:
            return 0.0
        q, p = self.q[-1], self.p[-1]
        r = np.linalg.norm(self.displacement(q[j] - q[i]), axis=1)
        speed = np.linalg.norm(p[j] - p[i], axis=1)
        turned = np.minimum(2.0, 2.0 * off / np.where(r > 0, r, off))
        return float((speed * turned).max())

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """Forces and stiffness of the potentials at the last frame."""
        self.need_few()
        return Equilibrium(self.law, self.state(-1), self.run.scenario.space)

    def equilibrium_at(self, frame: int) -> Equilibrium:
        """Forces and stiffness of the potentials at a frame."""
        return self.equilibrium.at(self.law, self.state(frame))

    @cached_property
    def potential(self) -> Potential:
        """The potential of a link: the first that acts over the law's own graph.

        Raises
        ------
        NotMeasurable
            When there is none.
        """
        if not self.equilibrium.potentials:
            raise NotMeasurable("the law has no potential over its graph")
        return self.equilibrium.potentials[0]

    @cached_property
    def stiffness(self) -> Array:
        """Eigenvalues of the total potential's Hessian at the last frame, ascending.

        Raises
        ------
        NotResolvable
            When it is not finite, as for two agents at one point under a singular potential.
        """
        self._need_finite_stiffness()
        return self.equilibrium.stiffness

    @cached_property
    def largest_stiffness(self) -> float:
        """Largest absolute value of `stiffness`; raises as it does."""
        self._need_finite_stiffness()
        return self.equilibrium.largest_stiffness

    def _need_finite_stiffness(self) -> None:
        if not np.isfinite(self.equilibrium.hessian).all():
            raise NotResolvable("the stiffness of the potential is not finite at the end")
