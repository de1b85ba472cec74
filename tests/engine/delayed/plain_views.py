"""Messages under continuous control where neighbours depend on headings, written a second time."""

import math

import numpy as np

from tests.engine.delayed.plain_messages import PlainMessages


class PlainViews(PlainMessages):
    """As `PlainMessages`, over fields of view: an agent is linked to what it knows within a radius and an angle.

    Parameters
    ----------
    scenario, slope, gain
        As for `PlainMessages`.
    half_angle
        Half the angle of the fields of view.
    """

    def __init__(self, scenario, slope, gain, half_angle):
        self.half_angle, self.turned = np.broadcast_to(half_angle, scenario.start.n), scenario.agents.headings
        self.radius = np.broadcast_to(scenario.law.graph.radius, scenario.start.n)
        super().__init__(scenario, slope, gain, levels=(0.0, 0.0))
        self.links = self.inside(0.0, self.packed()) > 0.0

    def packed(self):
        return np.concatenate([np.ravel(self.q), np.ravel(self.p)][: self.order]).astype(float)

    def inside(self, t, y):
        """How far every agent is inside of what each one has in view, shape (N, N); negative outside."""
        d = self.apart(t, y)[0]
        r = np.linalg.norm(d, axis=2)
        off = np.arctan2(d[..., 1], d[..., 0]) - np.asarray(self.turned)[:, None]
        off = np.abs(np.arctan2(np.sin(off), np.cos(off)))
        found = np.minimum(self.radius[:, None] - r, self.half_angle[:, None] - off)
        return np.where(np.eye(self.n, dtype=bool), -1.0, found)

    def gaps(self, t, y):
        return np.where(self.links, 1.0, -1.0) * self.inside(t, y)

    def followed(self, t, y):
        return self.inside(t, y) > 0.0


class PlainCones(PlainViews):
    """The same over cones: neighbours within a radius whose headings differ little; of smooth ones with a weight.

    Parameters
    ----------
    scenario, slope, gain
        As for `PlainMessages`.
    opening, measure
        How much headings may differ, and how that is measured.
    onset
        Of a smooth cone; None for links that count alike.
    """

    def __init__(self, scenario, slope, gain, opening, measure, onset=None):
        headings = np.asarray(scenario.agents.headings)
        gap = headings[None] - headings[:, None]
        turn = (gap + math.pi) % (2 * math.pi) - math.pi
        self.gap = {"real": np.abs(gap), "wrapped": np.abs(turn), "rotation": 1.0 - np.cos(gap)}[measure]
        self.opening, self.onset = np.broadcast_to(opening, scenario.start.n)[:, None], onset
        super().__init__(scenario, slope, gain, 0.0)

    def inside(self, t, y):
        r = np.linalg.norm(self.apart(t, y)[0], axis=2)
        found = np.where(self.gap <= self.opening, self.radius[:, None] - r, -1.0)
        return np.where(np.eye(self.n, dtype=bool), -1.0, found)

    def bump(self, z):
        """Olfati-Saber's: 1, then half a cosine."""
        half = 0.5 * (1.0 + np.cos(np.pi * (z - self.onset) / (1.0 - self.onset)))
        return np.where(z < self.onset, 1.0, np.where(z < 1.0, half, 0.0))

    def weights(self, r):
        return 1.0 if self.onset is None else self.bump(r / self.radius[:, None]) * self.bump(self.gap / self.opening)
