"""Held control with messages, written a second time as plainly as can be: lists, queues, and own formulas."""

from __future__ import annotations

import math

import numpy as np

NS = 10**9


class PlainWorld:
    """N double integrators under gradient and consensus over links with hysteresis, on what messages tell.

    Every message is put into its receiver's queue when it is sent, with its time of arrival, or left out when lost.
    """

    def __init__(self, scenario, slope, gain, enter, leave):
        self.slope, self.gain, self.enter, self.leave = slope, gain, enter, leave
        held, info = scenario.control, scenario.information
        self.info = info
        self.q, self.p = [list(x) for x in scenario.start.q], [list(x) for x in scenario.start.p]
        self.n, self.m = scenario.start.q.shape
        self.lengths = scenario.space.lengths or [math.inf] * self.m
        self.pieces = []
        self.mass = np.broadcast_to(scenario.agents.masses, self.n).tolist()
        self.most = np.broadcast_to(getattr(scenario.agents, "force", math.inf), self.n).tolist()
        each = lambda x: [round(float(v) * NS) for v in np.broadcast_to(x, self.n)]  # noqa: E731
        self.period, self.phase, self.latency = each(held.period), each(held.phase), each(held.latency)
        self.sampling, self.offset = each(info.period), each(info.phase)
        self.delay, self.jitter = round(info.delay * NS), round(info.jitter * NS)
        self.u = [[0.0] * self.m for _ in range(self.n)]
        self.known = [[(-1, 0, list(self.q[j]), list(self.p[j])) for j in range(self.n)] for _ in range(self.n)]
        self.queue = [[] for _ in range(self.n)]
        self.links = [
            [i != j and math.hypot(*self.away(self.q[i], self.q[j])) < leave for j in range(self.n)]
            for i in range(self.n)
        ]
        self.sample, self.tick, self.pending, self.now = [0] * self.n, [0] * self.n, [], 0
        self.used = [[-1] * self.n for _ in range(self.n)]
        self.own, self.ou = [(list(q), list(p)) for q, p in zip(self.q, self.p, strict=True)], {}

    def away(self, here, there):
        """The vector to the nearest image."""
        gaps = [b - a for a, b in zip(here, there, strict=True)]
        return [d - x * round(d / x) if math.isfinite(x) else d for d, x in zip(gaps, self.lengths, strict=True)]

    def move(self, to):
        s = (to - self.now) / NS
        self.pieces.append(
            (self.now / NS, s, np.array([self.q, self.p, np.array(self.u) / np.array(self.mass)[:, None]]))
        )
        for i in range(self.n):
            for k in range(self.m):
                a = self.u[i][k] / self.mass[i]
                self.q[i][k] += self.p[i][k] * s + 0.5 * a * s * s
                self.p[i][k] += a * s
        self.now = to

    def run(self, end):
        end = round(end * NS)
        while True:
            times = [self.offset[i] + self.sample[i] * self.sampling[i] for i in range(self.n)]
            times += [self.phase[i] + self.tick[i] * self.period[i] for i in range(self.n)]
            times += [t for t, _, _ in self.pending]
            t = min(times)
            if t >= end:
                self.move(end)
                return
            self.move(t)
            for j in range(self.n):
                if self.offset[j] + self.sample[j] * self.sampling[j] == t:
                    self.send(j, t)
            for i in range(self.n):
                for message in sorted(self.queue[i]):
                    if message[0] <= t and message[2] > self.known[i][message[1]][0]:
                        self.known[i][message[1]] = message[2:]
                self.queue[i] = [x for x in self.queue[i] if x[0] > t]
            acting = [i for i in range(self.n) if self.phase[i] + self.tick[i] * self.period[i] == t]
            wanted = [(i, self.act(i, t)) for i in acting]
            for i, u in wanted:
                self.tick[i] += 1
                self.pending.append((t + self.latency[i], i, u))
            for time, i, u in list(self.pending):
                if time == t:
                    # What was computed is held, and then limited.
                    most, size = self.most[i], math.hypot(*u)
                    self.u[i] = [x * most / size for x in u] if size > most else u
                    self.pending.remove((time, i, u))

    def send(self, j, t):
        from flocking.model.world.random_numbers import Purpose, uniform

        info, k = self.info, self.sample[j]
        self.sample[j] += 1
        q, p = list(self.q[j]), list(self.p[j])
        if info.noise is not None:
            a, b = info.noise.normals(info.seed, np.array([j]), np.array([k]), self.m)
            new = np.concatenate([a[0], b[0]])
            if j in self.ou:
                rho = info.noise.memory(self.sampling[j] / NS)
                new = rho * self.ou[j] + math.sqrt(1 - rho * rho) * new
            self.ou[j] = new
            q = [x + info.noise.position * e for x, e in zip(q, new[: self.m], strict=True)]
            p = [x + info.noise.velocity * e for x, e in zip(p, new[self.m :], strict=True)]
        if info.resolution:
            q = [round(x / info.resolution) * info.resolution for x in q]
        if info.velocity_resolution:
            p = [round(x / info.velocity_resolution) * info.velocity_resolution for x in p]
        self.own[j] = (q, p)
        for i in range(self.n):
            if i == j:
                continue
            if info.loss is not None:
                r = np.array([math.hypot(*self.away(self.q[i], self.q[j]))])
                if info.loss.lost(info.seed, np.array([j]), np.array([i]), np.array([k]), r)[0]:
                    continue
            late = round(float(uniform(info.seed, Purpose.JITTER, j, i, k)) * self.jitter) if self.jitter else 0
            self.queue[i].append((t + self.delay + late, j, k, t, q, p))

    def act(self, i, t):
        info = self.info
        self.used[i] = [k[0] for k in self.known[i]]
        q, p = (self.q[i], self.p[i]) if info.self_known == "true" else self.own[i]
        u = [0.0] * self.m
        for j in range(self.n):
            if j == i:
                continue
            _, begun, there, speed = self.known[i][j]
            gone = info.expires is not None and t - begun >= round(info.expires * NS)
            place = [x + v * (t - begun) / NS for x, v in zip(there, speed, strict=True)] if info.predict else there
            away = self.away(q, place)
            r = math.hypot(*away)
            self.links[i][j] = not gone and r < (self.leave if self.links[i][j] else self.enter)
            if self.links[i][j]:
                for k in range(self.m):
                    u[k] += self.slope(r) * away[k] / r + self.gain * (speed[k] - p[k])
        return u
