"""Departed energy under continuous control: messages and late knowledge, by closed forms and plain implementations."""

import dataclasses
import math
from itertools import pairwise

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.world.random_numbers import NOT_AN_AGENT

PULL = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])


def attracted(information, t_end=0.5, **parts):
    """Two agents of order 1 at distance 1 that attract each other: with x the distance, H is x^2/2."""
    made = fk.Scenario(
        PULL, fk.State([[0.0], [1.0]]), t_end=t_end, frames=3, agents=fk.SingleIntegrator(), information=information,
        **parts,
    )  # fmt: skip
    return fk.simulate(made, progress=False)


def departed_until(t):
    """Work at x(0) = 1 of x' + 2 x along x, where x' = -1 - x: each knows where the other one began."""
    return 2.0 * (1.0 - math.exp(-2.0 * t)) - 6.0 * (1.0 - math.exp(-t)) + 2.0 * t


def others(found, *names):
    return [name for name, values in found.causes.items() if values.any() and name not in names]


def test_a_constant_delay_of_two_agents_of_order_1_in_closed_form():
    """Until one delay has passed each knows the other one at rest; then, of one delay, x' = -x - x(t - tau)."""
    found = fk.departed_causes(attracted(fk.Delayed(0.5)))
    assert found.causes["delay"][-1] == pytest.approx(departed_until(0.5), abs=1e-9)
    assert not others(found, "delay")
    assert np.abs(found.remainder).max() < 1e-9


def test_messages_of_two_agents_of_order_1_in_closed_form():
    """Without delay each period begins with the truth, at a distance 2 exp(-T) - 1 times that before."""
    found, total, x = fk.departed_causes(attracted(fk.Messages(0.25), t_end=1.0)), 0.0, 1.0
    for _ in range(4):
        total += x * x * departed_until(0.25)
        x *= 2.0 * math.exp(-0.25) - 1.0
    assert found.causes["delay"][-1] == pytest.approx(total, abs=1e-9)
    assert not others(found, "delay")
    assert np.abs(found.remainder).max() < 1e-9


def simpson(values, h):
    return h / 3.0 * float(values[0] + 4.0 * values[1::2].sum() + 2.0 * values[2:-1:2].sum() + values[-1])


def test_noise_loss_and_delay_of_messages_by_plain_queues():
    """Between two arrivals q_i' = K_i - q_i with what i knows of the other one: exponentials, summed by Simpson."""
    period, late, seed, noise = 0.1, 0.03, 7, fk.WhiteNoise(0.2)
    information = fk.Messages(period, delay=late, loss=0.5, noise=noise, seed=seed)
    found = fk.departed_causes(attracted(information, t_end=0.6))
    numbers, agents = np.arange(7), np.array([0, 1])
    lost = {
        (1 - j, int(k)): bool(information.loss.lost(seed, np.array([j]), np.array([1 - j]), np.array([k]))[0])
        for j in agents for k in numbers
    }  # fmt: skip
    errors = np.array([0.2 * noise.normals(seed, agents, np.array([k, k]), 1)[0][:, 0] for k in numbers])
    q, exact, newest = np.array([0.0, 1.0]), np.array([1.0, 0.0]), np.array([1.0, 0.0])
    known = exact.copy()
    samples, works = [], dict.fromkeys(("noise", "loss", "delay"), 0.0)
    times = sorted({*np.round(0.1 * numbers, 9), *np.round(0.1 * numbers + late, 9)})
    for begin, end in pairwise(times):
        if end > 0.6 + 1e-9:
            break
        k = round(begin / period)
        if abs(begin - 0.1 * k) < 1e-9:
            samples.append(q.copy())
        else:
            for i in agents:
                newest[i] = samples[-1][1 - i]
                if not lost[i, len(samples) - 1]:
                    exact[i] = newest[i]
                    known[i] = newest[i] + errors[len(samples) - 1][1 - i]
        s = np.linspace(0.0, end - begin, 101)
        path = known + (q - known) * np.exp(-s)[:, None]
        gradient = path - path[:, ::-1]
        for name, difference in (("noise", known - exact), ("loss", exact - newest), ("delay", newest - path[:, ::-1])):
            works[name] += simpson((gradient * difference).sum(axis=1), s[1])
        q = path[-1]
    assert 2 <= sum(lost.values()) <= 10
    for name, work in works.items():
        assert found.causes[name][-1] == pytest.approx(work, abs=1e-8), name
        assert abs(work) > 1e-3
    assert not others(found, *works)
    assert np.abs(found.remainder).max() < 1e-8


@pytest.mark.parametrize("loss", [None, 0.5])
def test_messages_of_leaders_by_plain_queues(loss):
    """One agent of mass 1 under p' = w - p, w the velocity, sin(3 t), of its leader by the newest message."""
    information = fk.Messages(0.1, leader=True, delay=0.05, loss=loss, seed=3)
    law = fk.Law(fk.Fixed(1, []), [fk.Track(fk.Path(["sin(3*t)"]), 0.0, 1.0)])
    made = fk.Scenario(
        law, fk.State([[0.0]], [[1.0]]), t_end=1.0, frames=3, information=information, energy=fk.Energy("lab")
    )
    found = fk.departed_causes(fk.simulate(made, progress=False))
    none, numbers = np.zeros(11, dtype=int), np.arange(11)
    gone = np.zeros(11, dtype=bool)
    if loss is not None:
        gone = information.loss.lost(3, np.full(11, NOT_AN_AGENT), none, numbers)
    p, late, missed = 1.0, 0.0, 0.0
    for step in range(20):
        begun = 0.05 * step
        arrived = [k for k in range(11) if 0.1 * k + 0.05 <= begun + 1e-9]
        newest = max(arrived, default=0)
        used = max((k for k in arrived if not gone[k]), default=0)
        w, best = math.sin(0.3 * used), math.sin(0.3 * newest)
        s = np.linspace(0.0, 0.05, 101)
        path = w + (p - w) * np.exp(-s)
        missed += simpson((w - best) * path, s[1])
        late += simpson((best - np.sin(3.0 * (begun + s))) * path, s[1])
        p = path[-1]
    assert found.causes["delay"][-1] == pytest.approx(late, abs=1e-9)
    assert found.causes["loss"][-1] == pytest.approx(missed, abs=1e-9)
    assert found.causes["loss"].any() == (loss is not None)
    assert abs(late) > 1e-2
    assert not others(found, "delay", "loss")
    assert np.abs(found.remainder).max() < 1e-9


def group(information, graph, **parts):
    """Four agents that pass each other, with links that appear and break."""
    law = fk.Law(graph, [fk.Gradient(fk.Potential("2*(r - 1)**2")), fk.Consensus(0.5)])
    start = fk.State(
        [[0.0, 0.0], [1.2, 0.3], [2.8, -0.2], [0.4, 1.6]], [[1.5, 0.0], [-0.5, 0.4], [-1.6, 0.3], [0.2, -1.2]]
    )
    return fk.Scenario(law, start, t_end=1.0, frames=2, information=information, energy=fk.Energy("lab"), **parts)


def states_on(made, count):
    """Positions, velocities and true links on a grid of the time, shape (count + 1, N, ...) each."""
    session, found = fk.start(made), []
    for k in range(count + 1):
        session.advance(min(made.t_end * k / count, made.t_end))
        state = session.state
        found.append((state.q, state.p, state.links))
    q, p, links = (np.array(x) for x in zip(*found, strict=True))
    return session.run(), q, p, links


def forces(own, known, links):
    """Of the law of `group`, by plain loops; ``known`` is what i takes j to be, shape (N, N, 4)."""
    u = np.zeros((len(own), 2))
    for i, j in np.argwhere(links):
        d = known[i, j] - own[i]
        r = np.linalg.norm(d[:2])
        u[i] += 4.0 * (r - 1.0) * d[:2] / r + 0.5 * d[2:]
    return u


@pytest.mark.parametrize("late", ["one delay", "everybody late", "delays of pairs"])
def test_late_links_and_states_by_sums_on_a_grid(late):
    """The past is on the grid; links of what is known follow from its distances, the true ones from the state."""
    tau = np.full((4, 4), 0.1)
    if late == "delays of pairs":
        tau = np.array([[0.0, 0.1, 0.2, 0.05], [0.15, 0.0, 0.1, 0.1], [0.1, 0.05, 0.0, 0.2], [0.2, 0.1, 0.1, 0.0]])
    information = fk.Delayed(tau) if late == "delays of pairs" else fk.Delayed(0.1, self_delayed=late != "one delay")
    count = 1000
    run, q, p, true_links = states_on(group(information, fk.Proximity(1.5)), count)
    found = fk.departed_causes(run)
    state = np.concatenate([q, p], axis=2)

    def ago(k, delay):
        """The state of everybody a delay before point k of the grid."""
        back = k - round(delay * count)
        if back >= 0:
            return state[back]
        return np.concatenate([q[0] + back / count * p[0], p[0]], axis=1)

    power = {"delay": np.zeros(count + 1), "links": np.zeros(count + 1)}
    for k in range(count + 1):
        known = np.array([[ago(k, tau[i, j])[j] for j in range(4)] for i in range(4)])
        own = ago(k, 0.1) if late == "everybody late" else state[k]
        near = np.linalg.norm(known[..., :2] - own[:, None, :2], axis=2) < 1.5
        np.fill_diagonal(near, False)
        now = np.repeat(state[k][None], 4, axis=0)
        used, present = forces(own, known, near), forces(state[k], now, near)
        power["delay"][k] = ((used - present) * p[k]).sum()
        power["links"][k] = ((present - forces(state[k], now, true_links[k])) * p[k]).sum()
    for name, values in power.items():
        work = float((values[1:] + values[:-1]).sum()) * 0.5 / count
        # Links switch within cells of the grid: each misplaces a jump of the power by up to one of them.
        assert found.causes[name][-1] == pytest.approx(work, abs=2e-2 if name == "links" else 1e-2), name
        assert abs(work) > 5e-2
    assert np.abs(found.remainder).max() < 1e-9
    assert not others(found, "delay", "links")


@pytest.mark.parametrize(
    ("information", "names"),
    [
        (fk.Messages(0.1), {"delay", "links"}),
        (fk.Messages(0.1, delay=0.04, jitter=0.03, loss=0.3, expires=0.25, seed=2), {"delay", "loss", "links"}),
        pytest.param(
            fk.Messages(0.1, noise=fk.WhiteNoise(0.05, 0.1), predict=True),
            {"delay", "noise", "links"},
            marks=pytest.mark.slow,
        ),
        (fk.Messages(0.1, resolution=0.2, self_known="measured"), {"delay", "noise", "links"}),
        (fk.Messages(0.1, loss=0.0, noise=fk.WhiteNoise(0.0)), {"delay", "links"}),
    ],
)
def test_shares_add_up_and_what_is_not_in_the_world_has_none(information, names):
    run = fk.simulate(group(information, fk.Hysteresis(1.5, 0.2)), progress=False)
    found = fk.departed_causes(run)
    assert {name for name, values in found.causes.items() if values.any()} == names
    assert np.abs(found.remainder).max() < 1e-8 * max(1.0, np.abs(found.total).max())
    assert np.abs(found.total[-1]) > 1e-2


@pytest.mark.parametrize("information", [fk.Delayed(0.1), fk.Messages(0.1)])
def test_a_ledger_that_does_not_follow_from_the_scenario_is_refused(information):
    run = fk.simulate(group(information, fk.Proximity(1.5)), progress=False)
    trace = run.trace.copy()
    trace["departed"] *= 1.001
    with pytest.raises(InvalidInput, match="departed_causes: run must have a ledger that follows from its scenario"):
        fk.departed_causes(dataclasses.replace(run, trace=trace))


def test_changed_runs_of_late_knowledge_are_refused_by_name():
    session = fk.start(group(fk.Delayed(0.1), fk.Proximity(1.5)))
    session.advance(0.3)
    session.replace(state=fk.State(session.state.q + 0.1, session.state.p, session.time))
    session.advance(1.0)
    with pytest.raises(UnsupportedLaw, match="departed_causes computes again runs of one world and law"):
        fk.departed_causes(session.run())


@pytest.mark.parametrize("frame", ["leader", "centre of mass"])
@pytest.mark.parametrize("information", [fk.Delayed(0.2), fk.Messages(0.2, leader=True, delay=0.05, predict=True)])
def test_of_order_1_energy_that_leaders_change_is_no_share(information, frame):
    """The energy of a position gain changes with the leader alone, too: that is supplied and departs from nothing."""
    leader = fk.Path(["sin(3*t)", "1"])
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**4/4")), fk.Track(leader, 2.0, 0.0)])
    energy = fk.Energy(frame, leader if frame == "leader" else None)
    start = fk.State([[0.0, 0.0], [1.0, 0.3], [0.2, 0.9]])
    bodies = fk.SingleIntegrator()
    made = fk.Scenario(law, start, t_end=0.5, frames=3, bodies=bodies, information=information, energy=energy)
    found = fk.departed_causes(fk.simulate(made, progress=False))
    assert np.abs(found.remainder).max() < 1e-8
    assert abs(found.total[-1]) > 1e-2
    assert not others(found, "delay")
