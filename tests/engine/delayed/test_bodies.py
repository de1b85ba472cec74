"""Bodies under delayed knowledge, against SciPy's integrator on their equations as the literature writes them."""

import numpy as np
import pytest

import flocking as fk
from flocking.errors import UnsupportedLaw
from tests.engine.delayed.plain_delays import PlainDelays
from tests.engine.delayed.test_independent import random_world
from tests.engine.delayed.test_sessions import same


class Own(fk.PointMass):
    """Points with another kinetic energy."""

    def kinetic(self, x, relative):
        return 2 * super().kinetic(x, relative)


LAG, FORCE, RATE, SPEED, OFFSET, GUST = 0.15, 0.8, 3.0, 0.5, 0.2, 0.07


def shortened(v, most):
    """Vectors no longer than ``most``."""
    size = np.linalg.norm(v, axis=1, keepdims=True)
    return v * np.minimum(1.0, most / np.maximum(size, 1e-300))


class PlainBodies(PlainDelays):
    """The agents of `PlainDelays` with an actuator, wheels or gusts, by one name each."""

    def __init__(self, scenario, slope, gain, kind):
        super().__init__(scenario, slope, gain)
        self.kind, self.body = kind, scenario.agents

    def begun(self):
        more = []
        if "lagged" in self.kind:
            more = [np.zeros(self.n * self.m)]
        if self.kind == "unicycle":
            more = [(self.p0 / np.linalg.norm(self.p0, axis=1, keepdims=True)).ravel()]
        return np.concatenate([super().begun(), *more])

    def corners(self, t_end):
        if self.kind != "disturbed":
            return super().corners(t_end)
        # Neighbours know of a gust when their delays have passed.
        late = {0.0, *np.unique(self.delays).tolist()}
        gusts = {k * GUST + d for k in range(1, int(t_end / GUST) + 1) for d in late}
        return super().corners(t_end) | {t for t in gusts if t < t_end}

    def moved(self, t, y, u):
        count, more = self.n * self.m, y[self.order * self.n * self.m :].reshape(-1, self.m)
        if self.kind == "limited":
            return super().moved(t, y, shortened(u, FORCE))
        if self.kind == "limited speed":
            return shortened(u, SPEED).ravel()
        if self.kind == "disturbed":
            return super().moved(t, y, u + 0.3 * self.body.gust(int(t / GUST + 1e-9), self.n, self.m))
        if "lagged" in self.kind:
            change = (u - more) / LAG
            change = shortened(change, RATE) if self.kind == "lagged, limited rate" else change
            inner = more.ravel() if self.order == 1 else super().moved(t, y[: 2 * count], more)
            return np.concatenate([inner, change.ravel()])
        p = self.split(y)[1]
        turn = (more[:, 0] * p[:, 1] - more[:, 1] * p[:, 0]) / OFFSET
        heading = turn[:, None] * np.stack([-more[:, 1], more[:, 0]], axis=1)
        return np.concatenate([super().moved(t, y[: 2 * count], u), heading.ravel()])


def body_of(kind, inner):
    return {
        "limited": lambda: fk.Limited(inner, force=FORCE), "limited speed": lambda: fk.Limited(inner, speed=SPEED),
        "lagged": lambda: fk.Lagged(inner, LAG),
        "lagged, limited rate": lambda: fk.Limited(fk.Lagged(inner, LAG), rate=RATE),
        "disturbed": lambda: fk.Disturbed(inner, 0.3, GUST, seed=4),
        "unicycle": lambda: fk.Unicycle(OFFSET, inner.masses, inner.damping),
    }[kind]()  # fmt: skip


def world(kind, seed, pairs):
    """A random world with a body, its delay, or a delay for every pair."""
    made, _ = random_world(seed)
    rng = np.random.default_rng(seed)
    n = made.start.n
    information = made.information
    if pairs:
        information = fk.Delayed(rng.choice([0.0, 0.11, 0.23], (n, n), p=[0.2, 0.4, 0.4]) * (1.0 - np.eye(n)))
    return made.with_(bodies=body_of(kind, made.agents), t_end=1.2, information=information)


CASES = [
    ("limited", 0, False), ("limited", 1, True), ("limited speed", 2, True), ("lagged", 3, True),
    ("lagged, limited rate", 5, False), ("disturbed", 4, False), ("unicycle", 0, True),
]  # fmt: skip
"""Seeds 0, 1, 4 and 5 make agents of order 2, seeds 2 and 3 of order 1."""


@pytest.mark.parametrize(("kind", "seed", "pairs"), CASES)
def test_bodies_move_as_their_equations_say(kind, seed, pairs):
    made = world(kind, seed, pairs)
    plain = PlainBodies(made, lambda r: 1.5 * (r - 1), 0.8 if made.agents.order == 2 else 0.0, kind)
    run = fk.simulate(made, progress=False)
    assert run.fidelity.engine == "delayed"
    q, p, _ = plain.run(made.t_end)
    assert np.abs(run.q[-1] - q).max() < 1e-8
    assert np.abs(run.p[-1] - p).max() < 1e-8
    more = plain.end[made.agents.order * q.size :]
    columns = [run.columns[name][-1].ravel() for name in made.agents.widths(2)]
    assert np.abs(np.concatenate([*columns, np.zeros(0)]) - more).max(initial=0.0) < 1e-8
    assert np.abs(run.residual).max() <= 3e-9 * max(1.0, run.turnover)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6, 16))
@pytest.mark.parametrize(
    "kind", ["limited", "limited speed", "lagged", "lagged, limited rate", "disturbed", "unicycle"]
)
def test_bodies_in_more_worlds(kind, seed):
    made, _ = random_world(seed)
    if (made.agents.order == 1) == (kind in ("limited", "lagged, limited rate", "unicycle")) or (
        kind == "limited speed" and made.agents.order == 2
    ):
        return
    test_bodies_move_as_their_equations_say(kind, seed, seed % 2 == 0)


def test_a_limit_that_never_acts_and_a_hand_point_change_nothing():
    """What departs is what late knowledge does, as for points; a lag departs beyond it."""
    made = world("limited", 1, False)
    points = made.with_(bodies=made.agents.body)
    ideal = fk.simulate(points, progress=False)
    for body, off in ((fk.Limited(points.agents, force=1e3), 1e-12),
                      (fk.Unicycle(0.1, points.agents.masses, points.agents.damping), 1e-7)):  # fmt: skip
        run = fk.simulate(points.with_(bodies=body), progress=False)
        assert np.abs(run.q - ideal.q).max() < off
        assert abs(run.trace["departed"][-1] - ideal.trace["departed"][-1]) < 10 * off
    lagged = fk.simulate(points.with_(bodies=fk.Lagged(points.agents, 0.05)), progress=False)
    assert abs(lagged.trace["departed"][-1] - ideal.trace["departed"][-1]) > 1e-3


def test_a_limit_that_acts_where_the_force_vanishes_at_once_ends():
    """The last link of agent 0 breaks while its force is limited: nothing is left to be scaled."""
    law = fk.Law(fk.Proximity(2.0), [fk.Gradient(fk.Potential("-2*r"))])
    start = fk.State([[0.0, 0.0], [1.5, 0.0]], [[-0.5, 0.0], [0.5, 0.0]])
    made = fk.Scenario(law, start, t_end=1.5, frames=4, bodies=fk.Limited(fk.PointMass(), force=0.5),
                       information=fk.Delayed([[0.0, 0.2], [0.1, 0.0]]))  # fmt: skip
    session = fk.start(made)
    session.advance(1.5)
    assert not session.known_links.any()
    # Each is pushed off with the largest force until it knows the other to be 2 away, then drifts.
    assert (session.accelerations() == 0.0).all()
    assert np.abs(session.run().residual).max() < 1e-9


@pytest.mark.parametrize("body", [
    fk.Limited(fk.Lagged(fk.PointMass(), 0.1), force=0.8, rate=3.0), fk.Disturbed(fk.PointMass(), 0.3, 0.07, seed=1),
    fk.Mixture((fk.PointMass(), fk.Unicycle(0.1)), [0, 1, 1, 0]),
])  # fmt: skip
def test_pieces_moments_and_stored_runs_give_the_same_bits(body, tmp_path):
    law = fk.Law(fk.Hysteresis(2.5, 0.3), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(1.0)])
    start = fk.start.box(4, side=3, speed=1, seed=3)
    made = fk.Scenario(law, start, t_end=0.6, frames=7, bodies=body, information=fk.Delayed(0.08))
    whole = fk.simulate(made, progress=False)
    found = [] if body.ideal else [body.summary]
    assert whole.provenance["world"] == "; ".join([*found, "neighbours known 0.08 late"])
    for at in (0.0, 0.07, 0.2345):
        early = fk.start(made)
        early.advance(at)
        again = early.moment()()
        again.advance(0.6)
        found = again.run()
        assert same(found, whole)
        assert all((found.columns[name] == whole.columns[name]).all() for name in whole.columns)
    stored = fk.simulate(made, save=tmp_path / "run", progress=False)
    assert same(fk.read_run(tmp_path / "run"), stored)
    fk.write_scenario(made, tmp_path / "world.toml")
    assert same(fk.simulate(fk.read_scenario(tmp_path / "world.toml"), progress=False), whole)


@pytest.mark.parametrize("body", [
    fk.Lagged(fk.Limited(fk.PointMass(), force=0.9), 0.2),
    fk.Limited(fk.PointMass(damping=0.1), speed=0.7), fk.Quadrotor(),
    pytest.param(fk.Mixture((fk.PointMass(), fk.Lagged(fk.PointMass(), 0.2)), [0, 1]), marks=pytest.mark.slow),
])  # fmt: skip
def test_where_nobody_looks_at_others_bodies_move_as_in_the_ideal_world(body):
    """The exact engine judges bodies that follow a leader alone, among them quadrotors."""
    leader = fk.Path(["cos(t)", "sin(t)", "t/2"])
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("0*r")), fk.Track(leader, 1.0, 1.0)])
    start = fk.State(
        [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]], [[0.3, 0.1, 0.0], [0.0, 0.5, 0.0]] if body.order == 2 else None
    )
    ideal = fk.Scenario(law, start, t_end=1.5, frames=4, bodies=body)
    late = fk.simulate(ideal.with_(information=fk.Delayed([[0.0, 0.1], [0.3, 0.0]])), progress=False)
    plain = fk.simulate(ideal, progress=False)
    assert (late.fidelity.engine, plain.fidelity.engine) == ("delayed", "exact")
    assert np.abs(late.q - plain.q).max() < 1e-8
    assert all(np.abs(late.columns[name] - plain.columns[name]).max() < 1e-6 for name in plain.columns)
    assert late.trace["departed"][-1] == pytest.approx(plain.trace["departed"][-1], abs=1e-7)
    assert np.abs(late.residual).max() < 1e-7


def test_bodies_that_are_not_known_are_refused_by_name():
    made = fk.Scenario(fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)]), fk.State(np.eye(3)), t_end=0.1,
                       information=fk.Delayed(0.1))  # fmt: skip
    with pytest.raises(UnsupportedLaw, match="moves no Own agents, whose kinetic energy is another one"):
        fk.start(made.with_(bodies=Own()), "delayed")
