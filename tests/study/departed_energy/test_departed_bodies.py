"""What bodies do beyond the law: gusts, lags, limits and bodies that are no points, by closed forms and fine sums."""

import math
import warnings

import numpy as np
import pytest

import flocking as fk
from flocking.errors import UnsupportedLaw

FREE = fk.Law(fk.Fixed(2, []), [fk.Consensus(1.0)])
"""Two agents without a link: the law desires nothing of them."""

WORLDS = {
    "exact": {},
    "held": {"control": fk.Held(0.07), "information": fk.Messages(0.1)},
    "messages": {"information": fk.Messages(0.1)},
    "delayed": {"information": fk.Delayed(0.1)},
}


def free(bodies, world, start=None, law=FREE):
    start = start or fk.State([[0.0, 0.0], [3.0, 0.0]], [[1.0, 0.5], [0.0, -1.0]])
    made = fk.Scenario(law, start, t_end=1.0, frames=3, bodies=bodies, energy=fk.Energy("lab"), **WORLDS[world])
    return fk.simulate(made, progress=False)


def others(found, *names):
    """Further shares that are not exactly zero; what is left for ``hold`` is where rounding stays."""
    few = {"hold": 1e-12}
    return [name for name, x in found.causes.items() if np.abs(x).max() > few.get(name, 0.0) and name not in names]


@pytest.mark.parametrize("world", WORLDS)
def test_a_constant_gust_works_along_the_way(world):
    """Mass 2, one gust g for the whole run: from p the way is p t + g t^2/4, and the work g times it."""
    body = fk.Disturbed(fk.PointMass(2.0), 0.8, 2.0, seed=5)
    run = free(body, world)
    gusts = 0.8 * body.gust(0, 2, 2)
    work = float((gusts * (run.scenario.start.p + gusts / 4.0)).sum())
    found = fk.departed_causes(run)
    assert found.causes["disturbance"][-1] == pytest.approx(work, abs=1e-9)
    assert abs(work) > 1e-2
    assert not others(found, "disturbance")
    assert not fk.departed_causes(free(fk.Disturbed(fk.PointMass(2.0), 0.0, 2.0), world)).total.any()


@pytest.mark.parametrize("world", WORLDS)
def test_a_lag_alone_works_by_what_is_left_of_its_force(world):
    """f exp(-t/tau) acts where nothing is desired: the work is the change of |p|^2/2."""
    force, tau = np.array([[0.7, -0.4], [0.2, 0.9]]), 0.3
    start = fk.State([[0.0, 0.0], [3.0, 0.0]], [[1.0, 0.5], [0.0, -1.0]], columns={"applied": force})
    found = fk.departed_causes(free(fk.Lagged(fk.PointMass(), tau), world, start))
    p = start.p + force * tau * (1.0 - math.exp(-1.0 / tau))
    assert found.causes["lag"][-1] == pytest.approx(0.5 * float((p**2).sum() - (start.p**2).sum()), abs=1e-9)
    assert not others(found, "lag")


@pytest.mark.parametrize("world", ["held", "messages", "delayed"])
def test_of_order_1_a_gust_works_by_the_gradient_of_the_energy(world):
    """A constant gust moves the distance vector x of two agents that know each other's start alone.

    With q_i' = K_i - q_i + g_i it relaxes exponentially, and from tick to tick where it is held.
    """
    body = fk.Disturbed(fk.SingleIntegrator(), 0.8, 2.0, seed=5)
    gust = np.diff(0.8 * body.gust(0, 2, 2), axis=0)[0]
    x, law = np.array([1.0, 0.5]), fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
    late = {"held": fk.Messages(1.0), "messages": fk.Messages(1.0), "delayed": fk.Delayed(1.0)}[world]
    made = fk.Scenario(
        law, fk.State([[0.0, 0.0], x]), t_end=1.0, frames=3, bodies=body, information=late,
        **({"control": fk.Held(0.25)} if world == "held" else {}),
    )  # fmt: skip
    found = fk.departed_causes(fk.simulate(made, progress=False))
    if world == "held":
        work = 0.0
        for _ in range(4):
            rate = -np.array([1.0, 0.5]) - x + gust
            work += 0.25 * float(gust @ (x + 0.125 * rate))
            x = x + 0.25 * rate
    else:
        # x' = -x(0) - x + g: x tends to g - x(0).
        work = float(gust @ (gust - x + (2.0 * x - gust) * (1.0 - math.exp(-1.0))))
    assert found.causes["disturbance"][-1] == pytest.approx(work, abs=1e-9)
    assert abs(work) > 1e-2
    assert np.abs(found.remainder).max() < 1e-9
    assert not others(found, "disturbance", "delay", "hold")


LINKED = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("2*r**2")), fk.Consensus(1.0)])
"""Forces 4 (q_j - q_i) + (p_j - p_i)."""

CHAINS = {
    "limited lag in wind": fk.Limited(fk.Lagged(fk.Disturbed(fk.PointMass(1.5), 0.3, 0.2, 1), 0.2), force=2.0),
    "lag of a noisy limited command": fk.Disturbed(
        fk.Limited(fk.Lagged(fk.PointMass(1.5), 0.2), force=2.0), 0.3, 0.2, 1
    ),
    "limit behind a lag": fk.Lagged(fk.Limited(fk.PointMass(1.5), force=1.0, shape="box"), 0.2),
}


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize(
    "name", [pytest.param(x, marks=pytest.mark.slow) if x == "lag of a noisy limited command" else x for x in CHAINS]
)
def test_parts_of_a_chain_share_what_leaves_them_minus_what_comes_to_them(name, world):
    """Sums by the trapezoidal rule over a fine grid, on which gusts and ticks are; no message arrives until the end."""
    body, count = CHAINS[name], 400
    late = {"delayed": fk.Delayed(1.0), "exact": fk.Instant()}.get(world, fk.Messages(1.0, phase=0.99))
    start = fk.State([[0.0, 0.0], [1.0, 0.5]], [[1.0, 0.5], [0.0, -1.0]])
    if world == "delayed":
        start = fk.State(start.q, np.zeros((2, 2)))
    held = {"control": fk.Held(0.05)} if world == "held" else {}
    made = fk.Scenario(LINKED, start, t_end=0.8, frames=2, bodies=body, information=late, **held,
                       energy=fk.Energy("lab"))  # fmt: skip
    session, states, h = fk.start(made), [], 0.8 / count
    for k in range(count + 1):
        session.advance(min(k * h, 0.8))
        states.append(session.state)
    found = fk.departed_causes(session.run())
    works = {"disturbance": 0.0, "lag": 0.0, "limits": 0.0, "delay": 0.0}
    for k in range(count):
        for end in (k, k + 1):
            at = states[25 * (k // 25) if world == "held" else end]
            known = at if world == "exact" else start
            desired = 4.0 * (known.q[::-1] - at.q) + known.p[::-1] - at.p
            now, chain = desired, body
            shares = {"delay": desired - (4.0 * (at.q[::-1] - at.q) + at.p[::-1] - at.p)}
            while not isinstance(chain, fk.PointMass):
                if isinstance(chain, fk.Lagged):
                    part, out = "lag", states[end].columns["applied"]
                elif isinstance(chain, fk.Disturbed):
                    part, out = "disturbance", now + 0.3 * chain.gust(int((k + 0.5) * h / 0.2), 2, 2)
                elif chain.shape == "box":
                    part, out = "limits", np.clip(now, -1.0, 1.0)
                else:
                    part, out = "limits", now * np.minimum(1.0, 2.0 / np.linalg.norm(now, axis=1, keepdims=True))
                shares[part] = out - now
                now, chain = out, chain.body
            for part, force in shares.items():
                works[part] += 0.5 * h * float((force * states[end].p).sum())
    for part, work in works.items():
        assert found.causes[part][-1] == pytest.approx(work, abs=2e-4), part
    assert abs(works["lag"]) > 1e-2
    assert abs(works["limits"]) > 1e-2
    assert np.abs(found.remainder).max() < 1e-8
    assert found.causes["hold"].any() == (world == "held")


@pytest.mark.parametrize("world", WORLDS)
def test_shares_of_a_run_that_is_cut_are_those_of_the_whole_run(world):
    """The cut is between two frames: what comes after the last one counts as well."""
    whole = free(CHAINS["limit behind a lag"], world, law=LINKED)
    cut = whole.until(0.83)
    assert cut.t[-1] == 0.5
    before, found = fk.departed_causes(whole), fk.departed_causes(cut)
    count = len(found.t)
    assert found.t[-1] > 0.7
    for name, values in found.causes.items():
        assert np.abs(values - before.causes[name][:count]).max() < 1e-12, name
    assert abs(found.causes["lag"][-1] - found.causes["lag"][count // 2]) > 1e-2


@pytest.mark.parametrize("world", ["held", "messages", "delayed"])
def test_a_largest_speed_takes_its_share_from_forces_of_order_1(world):
    """Two agents far apart that move towards each other at the largest speed: x' = -2, and the law wants -2 x."""
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
    held = {"control": fk.Held(0.1)} if world == "held" else {}
    late = {"delayed": fk.Delayed(0.1)}.get(world, fk.Messages(0.1))
    made = fk.Scenario(law, fk.State([[0.0], [9.0]]), t_end=0.5, frames=3, information=late,
                       bodies=fk.Limited(fk.SingleIntegrator(), speed=1.0), **held)  # fmt: skip
    found = fk.departed_causes(fk.simulate(made, progress=False))
    total = -2.0 * (9.0 * 0.5 - 0.25) + 2.0 * (81.0 * 0.5 - 18.0 * 0.25 + 4.0 * 0.125 / 3.0)
    assert found.total[-1] == pytest.approx(total, rel=1e-9)
    t = np.linspace(0.0, 0.5, 50001)
    since = np.floor(t[:-1] / 0.1 + 1e-6) * 0.1
    middle = 0.5 * (t[1:] + t[:-1])
    late_by = {"held": np.zeros(50000), "messages": middle - since, "delayed": np.minimum(middle, 0.1)}[world]
    # Who knows the other one s ago takes it to be s further away, and wants to approach faster by that much.
    delay = float(((9.0 - 2.0 * middle) * -2.0 * late_by).sum()) * 1e-5
    assert found.causes["delay"][-1] == pytest.approx(delay, abs=1e-8)
    assert np.abs(found.remainder).max() < 1e-8
    assert found.causes["hold"].any() == (world == "held")


def test_a_quadrotor_has_a_share_of_its_own_beside_gusts():
    body = fk.Disturbed(fk.Quadrotor(), 0.01, 0.25)
    law = fk.Law(fk.Proximity(3.0), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.1)), fk.Consensus(0.1)])
    start = fk.State([[0.0, 0.0, 0.0], [2.0, 1.0, 0.5]], [[0.3, -0.2, 0.1], [0.0, 0.4, 0.0]])
    made = fk.Scenario(law, start, t_end=0.5, frames=3, bodies=body, control=fk.Held(0.1))
    found = fk.departed_causes(fk.simulate(made, progress=False))
    assert not others(found, "body", "disturbance", "hold")
    assert found.causes["body"].any()


def test_where_switches_are_not_located_two_parts_are_not_separated():
    start = fk.State([[0.0, 0.0], [3.0, 0.0]], [[1.0, 0.5], [0.0, -1.0]])
    made = fk.Scenario(FREE, start, t_end=0.1, frames=2, bodies=CHAINS["limit behind a lag"])
    with pytest.raises(UnsupportedLaw, match="separates limits from lag by forces computed again"):
        fk.departed_causes(fk.simulate(made, engine="tiles", progress=False))


def test_parts_of_bodies_are_separated_in_an_ideal_world_with_links_obstacles_and_leaders():
    """What is computed again adds up to the column of the exact engine, which does not depend on it."""
    leader = fk.Path(["sin(3*t)", "0"])
    avoid = fk.Avoid([fk.Ball([1.0, -1.0], 0.3)], range=1.0, gamma_agents=False, repulsion_gain=0.5)
    gain = fk.Schedule([0.4], [1.0, 2.0])
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("2*(r - 1)**2")), fk.Track(leader, 0.0, gain), avoid])
    start = fk.State([[0.0, 0.0], [1.2, 0.3], [2.8, 1.4]], [[1.5, 0.0], [-0.5, 0.4], [-1.6, -0.6]])
    body = CHAINS["limited lag in wind"]
    made = fk.Scenario(law, start, t_end=1.0, frames=4, bodies=body, energy=fk.Energy("leader", leader))
    run = fk.simulate(made, progress=False)
    assert {"appear", "obstacle"} <= set(run.switches["kind"].tolist())
    found = fk.departed_causes(run)
    assert np.abs(found.remainder).max() < 1e-7
    assert not others(found, "limits", "lag", "disturbance")
    assert min(np.abs(found.causes[name]).max() for name in ("limits", "lag", "disturbance")) > 1e-2


def test_pieces_of_formulas_that_are_not_meant_give_no_warning():
    """A force of zero is within its limit, and the formula beyond it divides by the force."""
    run = free(fk.Lagged(fk.Limited(fk.PointMass(), force=1.0), 0.1), "held")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert fk.departed_causes(run).causes["limits"][-1] == 0.0
