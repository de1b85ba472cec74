"""Delayed knowledge where neighbours are those in view or of similar headings, written a second time."""

import numpy as np

from tests.engine.delayed.plain_delays import PlainDelays


class PlainDelayedViews(PlainDelays):
    """As `PlainDelays`: an agent is linked to whom it knows within a radius and half an angle of where it looks.

    Parameters
    ----------
    scenario, slope, gain
        As for `PlainDelays`.
    half_angle
        Half the angle of the fields of view.
    along
        Angles along which agents look; None for the velocities that they know to be their own.
    """

    def __init__(self, scenario, slope, gain, half_angle, along=None):
        super().__init__(scenario, slope, gain)
        self.radius = np.broadcast_to(scenario.law.graph.radius, self.n)[:, None]
        self.half_angle, self.along = np.broadcast_to(half_angle, self.n)[:, None], along
        self.links = self.inside(0.0, self.begun(), []) > 0.0

    def angles(self, t, y, solutions):
        """Angles along which agents look, shape (N,)."""
        if self.along is not None:
            return np.asarray(self.along)
        own = [self.past(t - late, solutions) if late else self.split(y) for late in self.delays.diagonal()]
        return np.array([np.arctan2(*p[i][::-1]) for i, (_, p) in enumerate(own)])

    def inside(self, t, y, solutions):
        """How far every agent is inside of what each one has in view, shape (N, N); negative outside."""
        d = self.apart(t, y, solutions)[0]
        off = np.arctan2(d[..., 1], d[..., 0]) - self.angles(t, y, solutions)[:, None]
        off = np.abs(np.arctan2(np.sin(off), np.cos(off)))
        found = np.minimum(self.radius - np.linalg.norm(d, axis=2), self.half_angle - off)
        return np.where(np.eye(self.n, dtype=bool), -1.0, found)

    def gaps(self, t, y, solutions):
        return np.where(self.links, 1.0, -1.0) * self.inside(t, y, solutions)


class PlainDelayedCones(PlainDelayedViews):
    """The same over cones: neighbours within a radius whose headings differ by an opening at most, as rotations."""

    def inside(self, t, y, solutions):
        r = np.linalg.norm(self.apart(t, y, solutions)[0], axis=2)
        alike = 1.0 - np.cos(np.subtract.outer(self.along, self.along)) <= self.half_angle
        return np.where(alike & ~np.eye(self.n, dtype=bool), self.radius - r, -1.0)
