"""A second implementation of delayed knowledge: SciPy's integrator over one delay after the other, events for links."""

import numpy as np
from scipy.integrate import solve_ivp


class PlainDelays:
    """Point masses or single integrators with an attraction and a consensus over links with hysteresis.

    Delays may differ between ordered pairs; steps end at multiples of the least one.

    Parameters
    ----------
    scenario
        What is simulated; of its law nothing but the graph is read.
    slope
        Slope of the potential.
    gain
        Gain of the consensus.
    """

    def __init__(self, scenario, slope, gain):
        self.q0, self.p0 = scenario.start.q, scenario.start.p
        self.n, self.m = self.q0.shape
        self.order, self.slope, self.gain = scenario.agents.order, slope, gain
        self.masses = np.broadcast_to(scenario.agents.masses, self.n)[:, None]
        self.damping = np.broadcast_to(scenario.agents.damping, self.n)[:, None]
        graph = scenario.law.graph
        radii = graph.appear_radius, graph.break_radius
        self.enter, self.leave = (np.broadcast_to(x, self.n)[:, None] for x in radii)
        tau, late = scenario.information.tau, scenario.information.self_delayed
        everybody = np.full((self.n, self.n), 1.0) - (0.0 if late else np.eye(self.n))
        self.delays = tau * everybody if np.ndim(tau) == 0 else np.array(tau)
        self.parts = 8
        self.step = self.delays[self.delays > 0].min()
        true = np.linalg.norm(self.q0[:, None] - self.q0, axis=2)
        apart = np.linalg.norm(self.apart(0.0, np.concatenate([self.q0.ravel(), self.p0.ravel()]), [])[0], axis=2)
        self.links = np.where(true < self.leave, apart < self.leave, apart < self.enter) & ~np.eye(self.n, dtype=bool)

    def past(self, t, solutions):
        """Positions and velocities at a time, from pieces (begin, end, solution)."""
        if t <= 0.0:
            p = self.p0 if self.order == 2 else np.zeros_like(self.p0)
            return self.q0 + t * p, p
        y = next((found for _, end, found in solutions if t <= end), solutions[-1][2])(t)
        return self.split(y)

    def split(self, y):
        count = self.n * self.m
        q = y[:count].reshape(self.n, self.m)
        return q, (y[count : 2 * count].reshape(self.n, self.m) if self.order == 2 else np.zeros_like(q))

    def apart(self, t, y, solutions):
        """Displacements of what agents know of others from themselves, shape (N, N, m)."""
        q, p = np.empty((self.n, self.n, self.m)), np.empty((self.n, self.n, self.m))
        for delay in np.unique(self.delays):
            then = self.past(t - delay, solutions) if delay else self.split(y)
            i, j = np.nonzero(self.delays == delay)
            q[i, j], p[i, j] = then[0][j], then[1][j]
        i = np.arange(self.n)
        return q - q[i, i][:, None], p - p[i, i][:, None]

    def rate(self, t, y, solutions):
        d, v = self.apart(t, y, solutions)
        r = np.linalg.norm(d, axis=2) + np.eye(self.n)
        u = (self.links[..., None] * (self.slope(r)[..., None] * d / r[..., None] + self.gain * v)).sum(axis=1)
        return self.moved(t, y, u)

    def moved(self, t, y, u):
        """Rates of all numbers under forces."""
        if self.order == 1:
            return u.ravel()
        p = self.split(y)[1]
        return np.concatenate([p.ravel(), ((u - self.damping * p) / self.masses).ravel()])

    def gaps(self, t, y, solutions):
        """How far every pair is from where its link switches, shape (N, N); negative beyond."""
        r = np.linalg.norm(self.apart(t, y, solutions)[0], axis=2)
        return np.where(self.links, self.leave - r, r - self.enter)

    def begun(self):
        """All numbers at the start."""
        return np.concatenate([self.q0.ravel(), self.p0.ravel()][: self.order])

    def corners(self, t_end):
        """Times at which steps end."""
        return {k * self.step for k in range(1, int(t_end / self.step) + 1)} | {t_end}

    def run(self, t_end):
        """Positions and velocities at the end, and how often a known link switched."""
        y = self.begun()
        t, solutions, switches = 0.0, [], 0
        for corner in sorted(self.corners(t_end)):
            while t < corner:

                def worst(s, z, solutions=tuple(solutions)):
                    return (self.gaps(s, z, solutions) + 1e3 * np.eye(self.n)).min() + 1e-12

                worst.terminal, worst.direction = True, -1
                known = tuple(solutions)
                found = solve_ivp(
                    lambda s, z, known=known: self.rate(s, z, known), (t, corner), y, method="RK45", rtol=1e-11,
                    atol=1e-12, dense_output=True, events=worst, max_step=self.step / self.parts,
                )  # fmt: skip
                end = float(found.t[-1])
                if end > t:
                    solutions.append((t, end, found.sol))
                t, y = end, found.y[:, -1]
                if found.status == 1:
                    crossed = (self.gaps(t, y, solutions) < 1e-9) & ~np.eye(self.n, dtype=bool)
                    self.links = self.links ^ crossed
                    switches += int(crossed.sum())
        self.end = y
        return *self.split(y), switches
