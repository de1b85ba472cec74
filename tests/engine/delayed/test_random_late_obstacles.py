"""Obstacles of agents that know themselves late in random worlds, by SciPy with the reference of the forces."""

import numpy as np
import pytest

import flocking as fk
from tests.engine.delayed.plain_delays import PlainDelays
from tests.engine.delayed.plain_messages import PlainMessages

N, STIFFNESS, GAIN = 3, 1.5, 0.8


def random_world(seed, kind):
    """Balls and walls, at rest and moving, gains of the size of those between agents, and late own states."""
    rng = np.random.default_rng(seed)
    order = int(rng.choice([1, 2]))
    solids = []
    for moving in (False, True, bool(rng.integers(2))):
        place = rng.uniform(1.0, 2.5) * (lambda a: np.array([np.cos(a), np.sin(a)]))(rng.uniform(0.0, 2.0 * np.pi))
        where = fk.Velocity(rng.normal(size=2) * 0.5, start=place) if moving else place
        solids.append(fk.Wall(where, -place) if rng.random() < 0.4 else fk.Ball(where, rng.uniform(0.2, 0.4)))
    avoid = fk.Avoid(solids, range=rng.uniform(0.5, 0.9), gamma_agents=False, repulsion_gain=rng.uniform(1.0, 4.0),
                     damping_gain=rng.uniform(0.0, 1.0))  # fmt: skip
    pair = [fk.Gradient(fk.Potential(f"{STIFFNESS}*(r - 1)**2/2")), *([fk.Consensus(GAIN)] if order == 2 else [])]
    law = fk.Law(fk.Hysteresis(2.0, 0.3), [*pair, avoid])
    start = fk.State(rng.uniform(-0.7, 0.7, (N, 2)), 1.2 * rng.normal(size=(N, 2)) if order == 2 else None)
    tau = rng.uniform(0.08, 0.25, (N, N))
    tau[rng.integers(N), rng.integers(N)] = 0.0
    information = {
        "one": fk.Delayed(float(tau[0, 0] or 0.2), self_delayed=True), "pairs": fk.Delayed(tau, self_delayed=True),
        "measured": fk.Messages(
            rng.uniform(0.1, 0.25, N), phase=rng.uniform(0.0, 0.1, N), delay=0.03, self_known="measured",
            predict=bool(rng.integers(2)),
        ),
    }[kind]  # fmt: skip
    bodies = fk.PointMass(rng.uniform(0.8, 1.5, N), damping=0.1) if order == 2 else fk.SingleIntegrator()
    made = fk.Scenario(law, start, t_end=0.9, frames=4, information=information, bodies=bodies, tolerance=1e-10)
    return made, fk.Law(fk.Fixed(N, []), [avoid])


def slope(r):
    return STIFFNESS * (r - 1.0)


class PlainLate(PlainDelays):
    """`PlainDelays` with forces of obstacles where agents were, as the reference on arrays computes them."""

    def rate(self, t, y, solutions):
        self._then = [self.split(y) if d == 0 else self.past(t - d, solutions) for d in self.delays.diagonal()]
        return super().rate(t, y, solutions)

    def moved(self, t, y, u):
        q, p = (np.array([then[part][i] for i, then in enumerate(self._then)]) for part in (0, 1))
        return super().moved(t, y, u + fk.control(self.alone, fk.State(q, p, max(t, 0.0))))


class PlainSamples(PlainMessages):
    """`PlainMessages` with forces of obstacles at own samples, as the reference on arrays computes them."""

    def force(self, t, y):
        q, p = (np.array([own[part] for own in self.own]) for part in (0, 1))
        p = p if self.order == 2 else np.zeros_like(q)
        return super().force(t, y) + fk.control(self.alone, fk.State(q, p, max(t, 0.0)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", ["one", "pairs", "measured"])
def test_random_worlds_agree_with_scipy(kind, seed):
    made, alone = random_world(seed, kind)
    run = fk.simulate(made, progress=False)
    assert run.fidelity.engine == "delayed"
    plain = (PlainSamples if kind == "measured" else PlainLate)(made, slope, GAIN)
    plain.alone = alone
    plain.run(made.t_end)
    q, p = plain.split(plain.end)
    assert np.abs(run.q[-1] - q).max() < 1e-7
    if made.agents.order == 2:
        assert np.abs(run.p[-1] - p).max() < 1e-7
    assert np.abs(run.residual).max() <= 1e-7 * max(1.0, run.turnover)
    found = fk.replay(run)
    assert found.agrees, str(found)
    assert np.abs(fk.departed_causes(run).remainder).max() < 1e-6
    session = fk.start(made)
    session.advance(0.45)
    again = session.moment()()
    again.advance(made.t_end)
    assert np.array_equal(again.run().q, run.q)
