"""Bodies in discrete time against loops written from their definitions, and against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from flocking.model.world.random_numbers import Purpose, normal_pairs, uniform


def vicsek(n=40, side=3.1, noise=1.0, t_end=20.0, seed=0, **changes):
    body = {"speed": 0.03, "noise": noise, "seed": seed, **changes.pop("body", {})}
    start = fk.start.box(n, side=side, speed=body["speed"], velocities="sphere", seed=seed)
    parts = {
        "agents": fk.Heading(**body), "control": fk.Held(1.0), "space": fk.Periodic([side, side]),
        "frames": int(t_end) + 1, **changes,
    }  # fmt: skip
    return fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.VelocityAverage()]), start, t_end=t_end, **parts)


@pytest.mark.parametrize("update", ["backward", "forward"])
def test_headings_follow_the_rule_of_the_paper(update):
    """x(t + 1) = x(t) + v(t), theta(t + 1) = mean direction within the radius + noise, angle by angle."""
    run = fk.simulate(vicsek(body={"update": update}))
    q, p, side = run.q[0].copy(), run.p[0].copy(), 3.1
    for k in range(21):
        assert np.abs(run.q[k] - q).max() < 1e-12
        assert np.abs(run.p[k] - p).max() < 1e-13
        d = q[None] - q[:, None]
        near = ((d - side * np.round(d / side)) ** 2).sum(axis=2) < 1.0
        angles = np.arctan2(p[:, 1], p[:, 0])
        mean = np.arctan2((near * np.sin(angles)).sum(axis=1), (near * np.cos(angles)).sum(axis=1))
        mean = mean + (uniform(0, Purpose.HEADING, np.arange(40), 0, k) - 0.5)
        new = 0.03 * np.column_stack([np.cos(mean), np.sin(mean)])
        q, p = q + (p if update == "backward" else new), new


def test_vectorial_noise_in_three_dimensions():
    n, side = 30, 4.0
    start = fk.start.box(n, side=side, dimension=3, speed=0.5, velocities="sphere", seed=3)
    body = fk.Heading(0.5, noise=0.4, noise_kind="vectorial", update="forward", seed=7)
    law = fk.Law(fk.Proximity(1.5), [fk.VelocityAverage(2.0)])
    made = fk.Scenario(
        law, start, t_end=5, frames=11, agents=body, control=fk.Held(0.5), space=fk.Periodic([side, side, None])
    )
    run = fk.simulate(made)
    q, p = run.q[0].copy(), run.p[0].copy()
    for k in range(11):
        assert np.abs(run.q[k] - q).max() < 1e-12
        assert np.abs(run.p[k] - p).max() < 1e-13
        d = q[None] - q[:, None]
        d[..., :2] -= side * np.round(d[..., :2] / side)
        near = (d**2).sum(axis=2) < 1.5**2
        mean = near @ p / near.sum(axis=1)[:, None]
        x = np.column_stack([*normal_pairs(7, Purpose.HEADING, np.arange(n), 0, k),
                             normal_pairs(7, Purpose.HEADING, np.arange(n), 1, k)[0]])  # fmt: skip
        wanted = mean / 0.5 + 0.4 * x / np.linalg.norm(x, axis=1)[:, None]
        p = 0.5 * wanted / np.linalg.norm(wanted, axis=1)[:, None]
        q = q + 0.5 * p


LAW = fk.Law(
    fk.Hysteresis(3.0, 0.6),
    [
        fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.VelocityAverage(0.5, over=fk.PerAgentRadii(np.linspace(1, 3, 9))),
        fk.Consensus(0.2), fk.Track(fk.Velocity([0.3, 0.1], [1.0, 1.0]), 0.2, 0.3),
        fk.Avoid([fk.Ball([4.0, 4.0], 0.5)], fk.Velocity([0.3, 0.1], [1.0, 1.0]), range=2.0),
    ],
)  # fmt: skip


@pytest.mark.parametrize("update", ["backward", "forward"])
@pytest.mark.parametrize("together", [True, False])
def test_impulses_follow_the_forces_of_the_law(update, together):
    """A loop over instants with the reference control on NumPy arrays, links by the rules of each graph."""
    n, period, phase = 9, 0.1, np.zeros(9)
    if not together:
        period, phase = np.array([0.1, 0.25, 0.1] * 3), np.linspace(0, 0.08, 9)
    start = fk.start.box(n, side=5, speed=1, seed=5)
    body = fk.Impulsive(np.linspace(1, 2, n), 0.1, force=2.0, speed=1.2, update=update)
    made = fk.Scenario(LAW, start, t_end=3, frames=7, agents=body, control=fk.Held(period, phase))
    run = fk.simulate(made)
    period, q, p = np.broadcast_to(period, n), start.q.copy(), start.p.copy()
    links = LAW.graph.initial(q)
    ticks = sorted({(round((f + k * T) * 1e9), i) for i, (f, T) in enumerate(zip(phase, period, strict=True))
                    for k in range(40)})  # fmt: skip
    waiting, now, frame = {}, 0, 0
    frames = np.round(run.t * 1e9).astype(int)
    masses = np.linspace(1, 2, n)
    for at in sorted({tick for tick, _ in ticks}):
        while frame < len(frames) and frames[frame] < at:
            assert np.abs(run.q[frame] - (q + (frames[frame] - now) * 1e-9 * p)).max() < 1e-10
            frame += 1
        if frame == len(frames):
            break
        q, now = q + (at - now) * 1e-9 * p, at
        acting = [i for tick, i in ticks if tick == at]
        for i in acting:
            p[i] = waiting.pop(i, p[i])
        links = LAW.graph.update(q, links)
        u = fk.control(LAW, fk.State(q, p, at * 1e-9, links), agents=fk.Agents(masses, 0.1))
        for i in acting:
            force = u[i] * min(1.0, 2.0 / np.linalg.norm(u[i]))
            v = p[i] + period[i] * (force - 0.1 * p[i]) / masses[i]
            v = v * min(1.0, 1.2 / np.linalg.norm(v))
            if update == "backward":
                waiting[i] = v
            else:
                p[i] = v
        while frame < len(frames) and frames[frame] == at:
            assert np.abs(run.q[frame] - q).max() < 1e-10
            frame += 1
    assert frame == len(frames)


def test_explicit_and_symplectic_euler_of_a_spring():
    """One mass on a spring: backward is z' = (1 + T A) z, forward the symplectic map of determinant 1."""
    law = fk.Law(fk.Proximity(1.0), [fk.Track(fk.Velocity([0.0], [0.0]), 1.0, 0.0)])
    start = fk.State([[1.0]], [[0.0]])
    for update, step in (("backward", [[1, 0.1], [-0.1, 1]]), ("forward", [[0.99, 0.1], [-0.1, 1]])):
        made = fk.Scenario(law, start, t_end=2, frames=21, agents=fk.Impulsive(update=update), control=fk.Held(0.1))
        run = fk.simulate(made)
        z = np.array([1.0, 0.0])
        for k in range(21):
            # With the forward update the state before a tick has the velocity of the interval that ends.
            assert run.q[k, 0, 0] == pytest.approx(z[0], abs=1e-12)
            assert run.p[k, 0, 0] == pytest.approx(z[1], abs=1e-12)
            z = np.array(step) @ z


def test_the_order_at_full_noise_is_that_of_independent_headings():
    """At noise 2 pi headings are independent and even: the mean of N v_a^2 is 1, its variance (1 - 1/N) a tick."""
    run = fk.simulate(vicsek(noise=2 * np.pi, t_end=1000.0))
    squares = 40 * (np.linalg.norm(run.p[1:].mean(axis=1), axis=1) / 0.03) ** 2
    assert abs(squares.mean() - 1.0) < 5 * np.sqrt((1 - 1 / 40) / len(squares))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([2, 3]), st.booleans())
def test_without_noise_headings_stay_within_their_cone(seed, m, forward):
    """Averages of unit vectors within a half-space stay within their cone: no component along an axis falls."""
    rng = np.random.default_rng(seed)
    q = rng.random((12, m)) * 3
    p = rng.normal(size=(12, m))
    p[:, 0] = np.abs(p[:, 0]) + 0.05
    p /= np.linalg.norm(p, axis=1)[:, None]
    body = fk.Heading(1.0, update="forward" if forward else "backward")
    law = fk.Law(fk.Proximity(1.0), [fk.VelocityAverage(10.0)])
    made = fk.Scenario(law, fk.State(q, p), t_end=2, frames=21, agents=body, control=fk.Held(0.1))
    run = fk.simulate(made)
    least = (run.p[:, :, 0]).min(axis=1)
    assert (np.diff(least) > -1e-12).all()
    assert np.abs(np.linalg.norm(run.p, axis=2) - 1.0).max() < 1e-12


def test_many_agents_move_as_few_do():
    """Neighbours from the cell list are those of the comparison of all pairs, at 4,000 agents."""
    made = vicsek(n=4000, side=20.0, t_end=3.0)
    run = fk.simulate(made)
    q, p = run.q[0].copy(), run.p[0].copy()
    for k in range(3):
        mean = np.empty_like(p)
        for i in range(0, 4000, 500):
            d = q[None] - q[i : i + 500, None]
            near = ((d - 20 * np.round(d / 20)) ** 2).sum(axis=2) < 1.0
            mean[i : i + 500] = near @ p
        angle = np.arctan2(mean[:, 1], mean[:, 0]) + uniform(0, Purpose.HEADING, np.arange(4000), 0, k) - 0.5
        q, p = q + p, 0.03 * np.column_stack([np.cos(angle), np.sin(angle)])
        assert np.abs(run.p[k + 1] - p).max() < 1e-12
        assert np.abs(run.q[k + 1] - q).max() < 1e-12
