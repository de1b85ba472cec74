"""Velocities, distances and forces of a run at its frames."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from flocking.model.checks import Array
from flocking.study.equilibrium import Equilibrium
from flocking.study.evidence.basis import RunEvidence


class MotionEvidence(RunEvidence):
    """How the agents move."""

    @cached_property
    def mean_velocity(self) -> Array:
        """Velocity of the centre of mass at the frames, shape (F, m)."""
        self._need_frames()
        return np.asarray(np.einsum("i,fik->fk", self.masses, self.run.p) / self.masses.sum())

    @cached_property
    def velocity_spread(self) -> Array:
        """Largest |p_i - mean| at each frame, shape (F,); what was observed where the run keeps no frames."""
        seen = self.run.observables
        if not len(self.run.t) and seen is not None and len(seen) and not np.ptp(self.masses):
            return np.asarray(seen["spread"])
        offsets = self.run.p - self.mean_velocity[:, None, :]
        return np.asarray(np.linalg.norm(offsets, axis=2).max(axis=1))

    @cached_property
    def speeds(self) -> Array:
        """Largest speed at each frame, shape (F,)."""
        self._need_frames()
        return np.asarray(np.linalg.norm(self.run.p, axis=2).max(axis=1))

    @cached_property
    def diameter(self) -> Array:
        """Largest distance of two agents at each frame, shape (F,)."""
        self._need_all_pairs()
        found = []
        for q in self.run.q:
            offsets = q[None] - q[:, None]
            found.append(float(np.sqrt((offsets**2).sum(axis=2).max())))
        return np.array(found)

    @cached_property
    def distance_rate(self) -> float:
        """Largest rate of change of a pair distance at the last frame."""
        self._need_all_pairs()
        q, p = self.run.q[-1], self.run.p[-1]
        i, j = np.triu_indices(self.run.n, 1)
        if len(i) == 0:
            return 0.0
        d, v = q[j] - q[i], p[j] - p[i]
        r = np.linalg.norm(d, axis=1)
        return float(np.abs((d * v).sum(axis=1) / np.where(r > 0, r, 1.0)).max())

    @cached_property
    def equilibrium(self) -> Equilibrium:
        """Forces and stiffness of the potentials at the last frame."""
        self._need_all_pairs()
        return Equilibrium(self.law, self.run.state(-1))
