"""A leader that sends messages, written a second time: its motion by hand, and one queue for each receiver."""

import math

import numpy as np

import flocking as fk
from flocking.model.world.random_numbers import Purpose, uniform
from tests.engine.sampled.plain_world import NS

LEADER = fk.Path(["cos(w*t)", "0.5 - 0.3*t"], start=[0.2, 1.0], w=1.7)
GAINS = (0.9, 0.6, 0.7)


def moved(t):
    """Position, velocity and acceleration of the leader, by hand."""
    w = 1.7
    return (
        (0.2 + math.sin(w * t) / w, 1.0 + 0.5 * t - 0.15 * t * t),
        (math.cos(w * t), 0.5 - 0.3 * t),
        (-w * math.sin(w * t), -0.3),
    )


class PlainLeaderMail:
    """What every agent knows of the leader.

    Parameters
    ----------
    scenario
        Its information are messages; of its law nothing is read.
    """

    def __init__(self, scenario):
        self.info, n = scenario.information, scenario.start.n
        self.moved = moved
        period, phase, jitter, delay = (
            round(x * NS) for x in (self.info.period, self.info.phase, self.info.jitter, self.info.delay)
        )
        sender = 2**32 - 1
        self.mail, self.told = [[] for _ in range(n)], [(-1, 0)] * n
        for k in range(int(scenario.t_end * NS) // period + 1):
            for i in range(n):
                words = np.array([sender]), np.array([i]), np.array([k])
                if self.info.loss is not None and self.info.loss.lost(self.info.seed, *words)[0]:
                    continue
                late = round(float(uniform(self.info.seed, Purpose.JITTER, *words)[0]) * jitter) if jitter else 0
                self.mail[i].append((phase + k * period + delay + late, k, phase + k * period))

    def hear(self, i, t):
        """Let agent i have what has arrived by a time in nanoseconds."""
        for arrives, k, taken in self.mail[i]:
            if arrives <= t and k > self.told[i][0]:
                self.told[i] = (k, taken)

    def believed(self, i, seconds):
        """Position, velocity and acceleration of the leader as agent i takes them to be."""
        taken = self.told[i][1] / NS
        x, v, a = self.moved(taken)
        if self.info.predict:
            s = seconds - taken
            x = [b + s * c + s * s * d / 2 for b, c, d in zip(x, v, a, strict=True)]
            v = [c + s * d for c, d in zip(v, a, strict=True)]
        return x, v, a
