"""Messages under continuous control, written a second time: queues, and SciPy between two events."""

import math

import numpy as np
from scipy.integrate import solve_ivp

from tests.engine.sampled.plain_world import NS, PlainWorld


class PlainMessages(PlainWorld):
    """Point masses or single integrators under gradient and consensus over links with hysteresis, on messages.

    Samples, queues and losses are those of `PlainWorld`; the motion between two instants is integrated under forces
    that follow from the present state of each agent and from what its newest message of every other one states.

    Parameters
    ----------
    scenario
        What is simulated; of its law nothing but the graph is read.
    slope
        Slope of the potential.
    gain
        Gain of the consensus.
    levels
        Distances at which links appear and break; those of the graph when absent.
    """

    def __init__(self, scenario, slope, gain, levels=None):
        self.slope, self.gain, self.info = slope, gain, scenario.information
        graph = scenario.law.graph
        self.enter, self.leave = map(float, levels or (graph.appear_radius, graph.break_radius))
        self.n, self.m = scenario.start.q.shape
        self.order = scenario.agents.order
        self.q = [list(x) for x in scenario.start.q]
        self.p = [list(x) for x in (scenario.start.p if self.order == 2 else np.zeros_like(scenario.start.q))]
        self.lengths = scenario.space.lengths or [math.inf] * self.m
        self.masses = np.broadcast_to(scenario.agents.masses, self.n)[:, None]
        self.damping = np.broadcast_to(scenario.agents.damping, self.n)[:, None]
        each = lambda x: [round(float(v) * NS) for v in np.broadcast_to(x, self.n)]  # noqa: E731
        self.sampling, self.offset = each(self.info.period), each(self.info.phase)
        self.delay, self.jitter = round(self.info.delay * NS), round(self.info.jitter * NS)
        self.expires = None if self.info.expires is None else round(self.info.expires * NS)
        self.known = [[(-1, 0, list(self.q[j]), list(self.p[j])) for j in range(self.n)] for _ in range(self.n)]
        self.queue = [[] for _ in range(self.n)]
        apart = np.array([[math.hypot(*self.away(a, b)) for b in self.q] for a in self.q])
        self.links = (apart < self.leave) & ~np.eye(self.n, dtype=bool)
        self.sample, self.ou, self.switches = [0] * self.n, {}, 0
        self.own = [(list(q), list(p)) for q, p in zip(self.q, self.p, strict=True)]
        self.here = np.ones((self.n, self.n), dtype=bool)

    def split(self, y):
        q = y[: self.n * self.m].reshape(self.n, self.m)
        return q, (y[self.n * self.m :].reshape(self.n, self.m) if self.order == 2 else np.zeros_like(q))

    def apart(self, t, y):
        """Displacements and relative velocities of what agents know of others from what they know of themselves."""
        q, p = self.split(y)
        if self.info.self_known == "measured":
            q = np.array([x for x, _ in self.own])
            p = np.array([x for _, x in self.own]) if self.order == 2 else p
        begun = np.array([[x[1] for x in row] for row in self.known]) / NS
        there = np.array([[x[2] for x in row] for row in self.known])
        speed = np.array([[x[3] for x in row] for row in self.known])
        if self.info.predict:
            there = there + speed * (t - begun)[..., None]
        d = there - q[:, None]
        box = np.array(self.lengths)
        d -= np.where(np.isfinite(box), np.where(np.isfinite(box), box, 1.0) * np.rint(d / box), 0.0)
        return d, (speed - p[:, None] if self.order == 2 else np.zeros_like(d))

    def force(self, t, y):
        d, v = self.apart(t, y)
        r = np.linalg.norm(d, axis=2) + np.eye(self.n)
        acting = ((self.links & self.here) * self.weights(r))[..., None]
        return (acting * (self.slope(r)[..., None] * d / r[..., None] + self.gain * v)).sum(axis=1)

    def weights(self, r):
        """Of neighbours at distances from each agent, shape (N, N)."""
        return 1.0

    def gaps(self, t, y):
        """How far every link is from switching, shape (N, N)."""
        r = np.linalg.norm(self.apart(t, y)[0], axis=2)
        return np.where(self.links, self.leave - r, r - self.enter)

    def followed(self, t, y):
        """Links by what is known at a time."""
        r = np.linalg.norm(self.apart(t, y)[0], axis=2)
        return np.where(self.links, r < self.leave, r < self.enter)

    def rate(self, t, y):
        u = self.force(t, y)
        if self.order == 1:
            return u.ravel()
        p = self.split(y)[1]
        return np.concatenate([p.ravel(), ((u - self.damping * p) / self.masses).ravel()])

    def instants(self, end):
        """The next instant at which something of messages happens, or the end."""
        times = [self.offset[i] + self.sample[i] * self.sampling[i] for i in range(self.n)]
        times += [x[0] for queue in self.queue for x in queue]
        if self.expires is not None:
            pairs = [(i, j) for i in range(self.n) for j in range(self.n) if i != j and self.here[i, j]]
            times += [self.known[i][j][1] + self.expires for i, j in pairs]
        return min([*times, end])

    def take_up(self, t, y):
        """What falls on an instant, in nanoseconds: samples, arrivals, expiry, links."""
        q, p = self.split(y)
        if self.order == 1 and t > 0:
            p = self.force(t / NS, y)
        self.q, self.p = q.tolist(), p.tolist()
        for j in range(self.n):
            if self.offset[j] + self.sample[j] * self.sampling[j] == t:
                self.send(j, t)
        for i in range(self.n):
            for message in sorted(self.queue[i]):
                if message[0] <= t and message[2] > self.known[i][message[1]][0]:
                    self.known[i][message[1]] = message[2:]
            self.queue[i] = [x for x in self.queue[i] if x[0] > t]
        if self.expires is not None:
            self.here = np.array([[t - x[1] < self.expires for x in row] for row in self.known])
        self.links = self.followed(t / NS, y) & self.here & ~np.eye(self.n, dtype=bool)

    def run(self, t_end):
        """Positions and velocities at the end."""
        y = np.concatenate([np.ravel(self.q), np.ravel(self.p)][: self.order]).astype(float)
        end, now = round(t_end * NS), 0
        self.take_up_if_due(0, y)
        while now < end:
            to = self.instants(end)
            y = self.move(now / NS, to / NS, y)
            now = to
            if now < end:
                self.take_up_if_due(now, y)
        self.end = y
        return self.split(y)

    def take_up_if_due(self, t, y):
        if self.instants(2**62) <= t:
            self.take_up(t, y)

    def move(self, t, to, y):
        """The motion from one instant to another, link by link."""
        while t < to:
            idle = 1e3 * (np.eye(self.n) + ~self.here)

            def worst(s, z, idle=idle):
                return (self.gaps(s, z) + idle).min() + 1e-12

            worst.terminal, worst.direction = True, -1
            found = solve_ivp(self.rate, (t, to), y, method="DOP853", rtol=1e-12, atol=1e-13, events=worst,
                              max_step=(to - t) / 4)  # fmt: skip
            t, y = float(found.t[-1]), found.y[:, -1]
            if found.status == 1:
                crossed = (self.gaps(t, y) + idle) < 1e-9
                self.links = self.links ^ crossed
                self.switches += int(crossed.sum())
        return y
