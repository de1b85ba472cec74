"""The second implementation of delayed knowledge, with laws and states that are replaced on the way."""

import numpy as np

from tests.engine.delayed.plain_delays import PlainDelays


class ReplacedPlainDelays(PlainDelays):
    """As `PlainDelays`, until something is replaced; the past stays what it was.

    Parameters
    ----------
    scenario, slope, gain
        As for `PlainDelays`.
    """

    def __init__(self, scenario, slope, gain):
        self.jumps, self.middle = [], 0.0
        super().__init__(scenario, slope, gain)
        self.solutions = []

    def past(self, t, solutions):
        """The piece is one on the side of each jump on which the middle of the step lies."""
        delay = self.now - t
        after = max((j for j in self.jumps if j < self.middle - delay), default=-np.inf)
        before = min((j for j in self.jumps if j > self.middle - delay), default=np.inf)
        if (t <= 0.0 or before <= 0.0) and after < 0.0:
            p = self.p0 if self.order == 2 else np.zeros_like(self.p0)
            return self.q0 + t * p, p
        allowed = [x for x in solutions if x[0] >= after and x[1] <= before]
        return self.split(next((found for _, end, found in allowed if t <= end), allowed[-1][2])(t))

    def apart(self, t, y, solutions):
        self.now = t
        return super().apart(t, y, solutions)

    def on(self, begin, end):
        """Go on from the state at ``begin``, with steps that end where something jumped a delay or two before."""
        corners = {end}
        for j in (0.0, *self.jumps):
            for delay in np.unique(self.delays[self.delays > 0]):
                corners |= {j + k * delay for k in (1, 2, 3)}
        corners |= {begin + k * self.step for k in range(1, int((end - begin) / self.step) + 1)}
        y, t = self.end, begin
        for corner in sorted(c for c in corners if begin + 1e-9 < c <= end):
            if corner - t < 1e-9 and corner < end:
                continue
            self.middle = 0.5 * (t + corner)
            if any(abs(j + d - t) < 1e-9 for j in self.jumps for d in np.unique(self.delays)):
                self.follow(t, y)
            y = self.between(t, corner, y)
            t = corner
        self.end = y

    def follow(self, t, y):
        """Links by the distances that are known at a time."""
        apart = np.linalg.norm(self.apart(t, y, self.solutions)[0], axis=2)
        self.links = np.where(self.links, apart < self.leave, apart < self.enter) & ~np.eye(self.n, dtype=bool)

    def between(self, t, corner, y):
        """The state vector at a corner, from that at the one before."""
        from scipy.integrate import solve_ivp

        while t < corner:
            levels, side = np.where(self.links, self.leave, self.enter), np.where(self.links, 1.0, -1.0)
            known = tuple(self.solutions)

            def worst(s, z, levels=levels, side=side, known=known):
                r = np.linalg.norm(self.apart(s, z, known)[0], axis=2)
                return (side * (levels - r) + 1e3 * np.eye(self.n)).min() + 1e-12

            worst.terminal, worst.direction = True, -1
            found = solve_ivp(
                lambda s, z, known=known: self.rate(s, z, known), (t, corner), y, method="DOP853", rtol=1e-11,
                atol=1e-12, dense_output=True, events=worst, max_step=self.step / 4,
            )  # fmt: skip
            if found.t[-1] > t:
                self.solutions.append((t, float(found.t[-1]), found.sol))
            t, y = float(found.t[-1]), found.y[:, -1]
            if found.status == 1:
                r = np.linalg.norm(self.apart(t, y, self.solutions)[0], axis=2)
                self.links = self.links ^ ((side * (levels - r) < 1e-9) & ~np.eye(self.n, dtype=bool))
        return y

    def replace(self, t, *, slope=None, gain=None, radii=None, state=None):
        """Another law or another state from a time on.

        Parameters
        ----------
        slope, gain
            Slope of the potential, and gain of the consensus.
        radii
            Distances at which links appear and break, of another graph, whose links are those of a start.
        state
            Positions and velocities.
        """
        self.slope, self.gain = slope or self.slope, self.gain if gain is None else gain
        if state is not None:
            self.end = np.concatenate([x.ravel() for x in state][: self.order])
            self.jumps.append(t)
        self.middle = t + 1e-7
        if radii is not None:
            self.enter, self.leave = radii
            q = self.split(self.end)[0]
            self.links = np.linalg.norm(q[:, None] - q, axis=2) < self.leave
        self.follow(t, self.end)
