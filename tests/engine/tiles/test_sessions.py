"""Running under the tiled engine: order, threads, resuming, rebuilds, stops."""

import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.neighbours.listed_pairs import listed_pairs
from flocking.engine.tiles.particles import displacement, particle_arrays
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import LawNotObeyed, LinkLost, NotFinite, StepTooLarge, TooCrowded, UnsupportedLaw
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.terms.avoidance import Avoid
from tests.engine.tiles.laws import saber, states, structural, zhou


def smooth_scenario(**changes):
    """A motion without switches: everybody sees everybody, and forces have no kink."""
    law = fk.Law(fk.Proximity(50.0), [fk.Gradient(structural()), fk.Consensus(0.3)])
    start = fk.start.box(12, side=4, speed=1, seed=3)
    return fk.Scenario(law, start, t_end=1.0, frames=3, tolerance=1e-12, **changes)


@pytest.fixture(scope="module")
def truth():
    return fk.simulate(smooth_scenario(), progress=False)


@pytest.mark.parametrize(("scheme", "order", "step"), [("verlet", 1, 0.01), ("damped", 1, 0.01), ("rk4", 4, 0.05)])
def test_order_of_convergence(truth, scheme, order, step):
    errors = []
    for h in (step, step / 2, step / 4):
        run = fk.simulate(smooth_scenario(), engine="tiles", step=h, scheme=scheme, progress=False)
        assert run.t == pytest.approx(truth.t, abs=1e-14)
        errors.append(max(np.abs(run.q - truth.q).max(), np.abs(run.p - truth.p).max()))
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert rates == pytest.approx([order, order], abs=0.25)


def test_the_ledger_of_runge_kutta_closes_to_its_order():
    """Smooth motion: order 4. Links that switch at steps: still order 4, for they are held during a step."""
    begin = fk.start.hexagonal(100, spacing=0.9, noise=0.05, speed=1.0, seed=1)
    switching = fk.Scenario(saber(), begin, t_end=1.0, frames=5)
    for scenario, step in ((smooth_scenario(), 0.05), (switching, 0.02)):
        left = []
        for h in (step, step / 2, step / 4):
            run = fk.simulate(scenario, engine="tiles", step=h, scheme="rk4", progress=False)
            left.append(np.abs(run.residual).max())
        assert np.log2(left[0] / left[2]) / 2 == pytest.approx(4, abs=0.6)
        assert left[0] < 1e-3 * run.turnover


def test_verlet_has_order_two_without_damping():
    law = fk.Law(fk.Proximity(50.0), [fk.Gradient(structural()), fk.Consensus(0.0)])
    scenario = smooth_scenario().with_(law=law)
    exact = fk.simulate(scenario, progress=False)
    errors = [
        np.abs(fk.simulate(scenario, engine="tiles", step=h, progress=False).p - exact.p).max()
        for h in (0.004, 0.002, 0.001)
    ]
    assert np.log2(np.array(errors[:-1]) / np.array(errors[1:])) == pytest.approx([2, 2], abs=0.2)


def test_damped_scheme_survives_strong_damping():
    law = fk.Law(fk.Proximity(50.0), [fk.Gradient(structural()), fk.Consensus(300.0)])
    scenario = smooth_scenario().with_(law=law)
    run = fk.simulate(scenario, engine="tiles", step=0.02, scheme="damped", ledger=False, progress=False)
    spread = np.abs(run.p[-1] - run.p[-1].mean(axis=0)).max()
    assert spread < 1e-2
    with pytest.raises(fk.SimulationError):
        fk.simulate(scenario, engine="tiles", step=0.02, progress=False)


def crowd_scenario(n=3000, dimension=2, t_end=0.6, law=None, seed=1, **changes):
    start = states(n, dimension, seed=seed, side=0.8)["random"]
    return fk.Scenario(law or saber(), start, t_end=t_end, frames=4, **changes)


@pytest.mark.parametrize("ledger", [False, True])
def test_threads_change_nothing(ledger):
    runs = [
        fk.simulate(crowd_scenario(), engine="tiles", step=0.01, threads=k, ledger=ledger, observe=True, progress=False)
        for k in (1, 2, 5)
    ]
    for other in runs[1:]:
        assert (runs[0].q == other.q).all()
        assert (runs[0].p == other.p).all()
        assert (runs[0].trace == other.trace).all()
        assert (runs[0].observables == other.observables).all()
    assert runs[0].provenance["rebuilds"] > 2


@pytest.mark.parametrize("scheme", ["verlet", "rk4"])
@pytest.mark.parametrize("law", [saber(), zhou(1.2, 0.1)], ids=["proximity", "hysteresis"])
def test_resumed_run_is_bit_equal(scheme, law):
    start = fk.start.hexagonal(200, spacing=0.9, noise=0.01, speed=0.3, seed=2)
    scenario = fk.Scenario(law, start, t_end=0.5, frames=11)
    options = TilesOptions(step=0.002, scheme=scheme, threads=2)
    whole = TilesSession(scenario, options)
    whole.advance(0.5)
    first = TilesSession(scenario, options)
    first.advance(0.2011)
    looked = first.state
    kept = first.snapshot()
    first.advance(0.37)
    second = TilesSession.resume(kept, threads=1)
    assert (second.state.q == looked.q).all()
    second.advance(0.5)
    one, two = whole.run(), second.run()
    assert (one.q == two.q).all()
    assert (one.p == two.p).all()
    assert (one.trace == two.trace).all()
    assert whole.rebuilds == second.rebuilds > 1


def brute_pairs(q, radius):
    d = np.linalg.norm(q[:, None] - q[None], axis=-1)
    np.fill_diagonal(d, np.inf)
    return set(zip(*np.nonzero(d < radius), strict=True))


def missing_pairs(session, radius, t_end):
    """Pairs within the radius that the lists in use do not hold, summed over all steps."""
    particles, missing = session._particles, 0
    while session.time < t_end - 1e-9:
        session.advance(session.time + session.step / 2)
        if not particles.usable():
            continue
        i, j = listed_pairs(particles.lists[0], particles.n)
        held = set(zip(particles.ids[i].tolist(), particles.ids[j].tolist(), strict=True))
        q = particles.in_order(particles.X[: particles.m])
        missing += len({(int(a), int(b)) for a, b in brute_pairs(q, radius)} - held)
    return missing


def fast_scenario():
    """Free flight in all directions: agents keep meeting others they have never been near."""
    start = states(250, 2, seed=6, side=0.7)["random"]
    law = fk.Law(fk.Proximity(1.2), [fk.Consensus(0.0)])
    return fk.Scenario(law, fk.State(start.q, 4 * start.p + [30.0, 0.0]), t_end=1.0, frames=2)


@pytest.mark.parametrize("skin", [None, 0.05, 1.0])
def test_no_neighbour_is_ever_missed(skin):
    session = TilesSession(fast_scenario(), TilesOptions(step=0.005, skin=skin, ledger=False))
    assert missing_pairs(session, 1.2, 1.0) == 0
    assert session.rebuilds > 3


def test_lists_are_rebuilt_no_earlier_than_needed():
    """A flock that drifts as one needs no rebuild, however far it flies."""
    start = fk.start.hexagonal(100, spacing=1.0, seed=0)
    law = fk.Law(fk.Proximity(1.2), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.State(start.q, np.full_like(start.q, 25.0)), t_end=1, frames=2)
    session = TilesSession(scenario, TilesOptions(step=0.01, ledger=False))
    session.advance(1.0)
    assert session.rebuilds == 1


def test_a_late_rebuild_would_be_seen(monkeypatch):
    """The same test on an engine that lets agents use up three times the skin finds missing neighbours."""
    monkeypatch.setattr(displacement, "CERTAIN", 3.0)
    session = TilesSession(fast_scenario(), TilesOptions(step=0.005, skin=0.3, ledger=False))
    assert missing_pairs(session, 1.2, 1.0) > 0


def test_link_memory_survives_rebuilds():
    """Links of a hysteresis graph against the rule applied to all pairs at every step."""
    law = fk.Law(fk.Hysteresis(radius=1.2, gap=0.4), [fk.Consensus(0.05)])
    start = states(300, 2, seed=11, side=0.7)["random"]
    scenario = fk.Scenario(law, fk.State(start.q, 1.5 * start.p), t_end=1.0, frames=2)
    session = TilesSession(scenario, TilesOptions(step=0.01, ledger=False))
    links = law.graph.initial(scenario.start.q)
    differs = 0
    while session.time < 1.0 - 1e-9:
        session.advance(session.time + 0.005)
        state = session.state
        links = law.graph.update(state.q, links)
        assert (state.links == links).all()
        differs += int((links != (law.graph.initial(state.q))).sum())
    assert session.rebuilds > 4
    assert differs > 100


def test_a_straggler_and_flocks_far_apart_cost_little():
    state = states(2000, 2, seed=1)["straggler"]
    session = TilesSession(fk.Scenario(saber(), state, t_end=1, frames=1), TilesOptions(step=0.01))
    session.advance(0.1)
    assert session._particles.search.sorter.grid.cells <= 2 * 2000 + 9
    assert session.memory_in_use < 400 * 2000


def test_everybody_in_one_spot_is_refused_with_the_state_kept():
    rng = np.random.default_rng(0)
    q = rng.normal(size=(20_000, 2)) * 1e-3
    with pytest.raises(TooCrowded, match="memory_limit"):
        fk.simulate(fk.Scenario(saber(), fk.State(q), t_end=1, frames=1), engine="tiles", step=0.01, memory_limit=1e7)
    implosion = fk.Law(fk.Proximity(0.5), [fk.Track(fk.Sink([0.0, 0.0]), position_gain=1.0, velocity_gain=0.0)])
    start = fk.start.box(3000, side=60, seed=1, corner=(-30, -30))
    with pytest.raises(TooCrowded) as caught:
        fk.simulate(
            fk.Scenario(implosion, start, t_end=2, frames=21),
            engine="tiles",
            step=0.01,
            memory_limit=4e6,
            progress=False,
        )
    run = caught.value.run
    assert 5 < len(run.t) < 21
    assert np.isfinite(run.q).all()


def test_lists_grow_without_a_word():
    """A crowd that contracts has ever longer lists; forces stay right."""
    law = fk.Law(
        fk.Proximity(1.0), [fk.Track(fk.Sink([0.0, 0.0]), position_gain=1.0, velocity_gain=0.0), fk.Consensus(1e-4)]
    )
    start = fk.start.box(1000, side=40, seed=1, corner=(-20, -20))
    session = TilesSession(fk.Scenario(law, start, t_end=1.4, frames=2), TilesOptions(step=0.01, ledger=False))
    session.advance(1.4)
    state = session.state
    expected = fk.evaluate(law, state)
    error = np.linalg.norm(session.accelerations() - expected.u, axis=1)
    scale = expected.pair_force_sum + np.linalg.norm(expected.u, axis=1)
    assert expected.pair_force_sum.max() > 0
    # Verlet's forces see the velocities half a step back.
    assert (error <= 0.05 * scale + 1e-9).all()
    assert session._particles.lists[0].count.max() > 60


def test_bad_numbers_are_caught_with_the_agent_named():
    session = TilesSession(crowd_scenario(500), TilesOptions(step=0.01, ledger=False))
    session.advance(0.05)
    for bad in (np.nan, np.inf):
        other = TilesSession.resume(session.snapshot())
        particles = other._particles
        place = int(np.flatnonzero(particles.ids[:500] == 321)[0])
        particles.X[2, place] = bad
        steps = other.steps
        with pytest.raises(NotFinite) as caught:
            other.advance(0.5)
        assert 321 in caught.value.agents
        assert other.steps - steps <= 1


def test_a_nan_from_the_formula_is_caught():
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("sqrt(r - 0.5)"))])
    start = fk.State([[0.0, 0.0], [0.9, 0.0]], [[0.5, 0.0], [-0.5, 0.0]])
    with pytest.raises(fk.SimulationError) as caught:
        fk.simulate(fk.Scenario(law, start, t_end=2, frames=3), engine="tiles", step=0.01, progress=False)
    assert caught.value.run is not None
    assert np.isfinite(caught.value.run.q).all()


def test_a_broken_barrier_stops_the_run():
    start = fk.State([[0.0, 0.0], [3.9, 0.0], [0.0, 2.0]], [[-30.0, 0.0], [30.0, 0.0], [0.0, 0.0]])
    with pytest.raises(LinkLost, match="step") as caught:
        fk.simulate(fk.Scenario(zhou(), start, t_end=1), engine="tiles", step=0.05, ledger=False, progress=False)
    assert set(caught.value.agents) == {0, 1}


@pytest.mark.parametrize("frames", [2, (0.01,)])
def test_a_barrier_broken_by_the_very_last_step_is_told(frames):
    start = fk.State([[0.0, 0.0], [3.9, 0.0], [0.0, 2.0]], [[-30.0, 0.0], [30.0, 0.0], [0.0, 0.0]])
    scenario = fk.Scenario(zhou(), start, t_end=0.01, frames=frames)
    with pytest.raises(LinkLost, match="step"):
        fk.simulate(scenario, engine="tiles", step=0.01, ledger=False, progress=False)


def test_a_step_too_large_for_a_collision_says_which_would_do():
    start = fk.State([[0.0, 0.0], [2.0, 0.0]], [[4.0, 0.0], [-4.0, 0.0]])
    scenario = fk.Scenario(zhou(), start, t_end=0.5, frames=3)
    with pytest.raises(StepTooLarge, match="would do") as caught:
        fk.simulate(scenario, engine="tiles", step=0.05, ledger=False, progress=False)
    run = fk.simulate(scenario, engine="tiles", step=caught.value.would_do / 2, ledger=False, progress=False)
    assert run.finished


def test_a_step_too_large_for_the_ledger_says_which_would_do():
    law = fk.Law(fk.Proximity(5.0), [fk.Gradient(fk.Potential("k*(r - 1)**2", k=200.0)), fk.Consensus(0.5)])
    start = fk.State([[0.0, 0.0], [1.3, 0.0], [0.5, 0.9]])
    scenario = fk.Scenario(law, start, t_end=3.0, frames=7)
    with pytest.raises(StepTooLarge) as caught:
        fk.simulate(scenario, engine="tiles", step=0.1, progress=False)
    assert fk.simulate(scenario, engine="tiles", step=caught.value.would_do, progress=False).finished
    assert fk.simulate(scenario, engine="tiles", progress=False).finished


def test_replacing_the_law_and_the_state():
    session = TilesSession(crowd_scenario(400), TilesOptions(step=0.01))
    session.advance(0.2)
    before = session.state
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(structural(1.1)), fk.Consensus(2.0)])
    session.replace(law=law)
    after = session.state
    assert (after.q == before.q).all()
    assert after.p == pytest.approx(before.p, abs=1e-14)
    expected = fk.evaluate(law, after)
    assert np.abs(session.accelerations() - expected.u).max() < 1e-11 * expected.pair_force_sum.max()
    session.advance(0.4)
    run = session.run()
    assert abs(run.residual[-1]) < 0.05 * run.turnover
    # Its links are those of another radius.
    with pytest.raises(UnsupportedLaw, match="takes the links of Proximity from the graph"):
        session.replace(state=before)
    session.replace(state=dataclasses.replace(before, links=None))
    assert (session.state.q == before.q).all()


def test_observables_against_the_model():
    from flocking.model import observables

    scenario = crowd_scenario(600, t_end=0.2)
    run = fk.simulate(scenario, engine="tiles", step=0.01, observe=True, progress=False)
    state = run.state(-1)
    seen = run.observables[-1]
    links = saber().graph.initial(state.q)
    assert seen["order"] == pytest.approx(observables.order(state), rel=1e-12)
    assert seen["flocks"] == observables.flocks(links)
    assert seen["density"] == observables.density(links)
    assert seen["closest"] == pytest.approx(observables.closest_pair(state)[0], rel=1e-12)
    assert seen["neighbours"] == links.sum() / 600
    assert (run.links[-1] == links).all()


def test_large_runs_keep_no_matrices_and_refuse_endless_frames():
    run = fk.simulate(crowd_scenario(3000, t_end=0.05), engine="tiles", step=0.01, progress=False)
    assert run.links.shape[1:] == (0, 0)
    assert run.state(0).links is None
    with pytest.raises(fk.InvalidInput, match="keep_frames"):
        fk.simulate(crowd_scenario(3000).with_(frames=200_000), engine="tiles", step=0.01)
    quiet = fk.simulate(
        crowd_scenario(3000, t_end=0.05), engine="tiles", step=0.01, keep_frames=False, observe=True, progress=False
    )
    assert len(quiet.t) == 0
    assert len(quiet.observables) == 4


def test_the_ledger_books_what_links_bring():
    """Links that appear and break carry energy; the books close, and would not without them."""
    start = fk.start.hexagonal(60, spacing=1.1, noise=0.05, speed=0.6, seed=0)
    scenario = fk.Scenario(saber(), start, t_end=1.0, frames=3, energy=fk.Energy(unlinked=0.01))
    exact = fk.simulate(scenario, progress=False)
    run = fk.simulate(scenario, engine="tiles", step=0.004, scheme="rk4", progress=False)
    assert abs(exact.trace["jumped"][-1]) > 100 * abs(run.residual[-1])
    assert run.trace["jumped"][-1] == pytest.approx(exact.trace["jumped"][-1], rel=0.05)
    assert run.trace["energy"][0] == pytest.approx(exact.trace["energy"][0], rel=1e-12)


def test_energy_ledger_sees_a_wrong_kernel(monkeypatch):
    """A run whose kicks are half too strong does not balance its books."""
    original = particle_arrays.ParticleArrays.move

    def too_strong(self, t, **how):
        if how["drift"] != 0:
            how["kick"] *= 1.5
        original(self, t, **how)

    monkeypatch.setattr(particle_arrays.ParticleArrays, "move", too_strong)
    # No shorter step would do.
    with pytest.raises(LawNotObeyed):
        fk.simulate(crowd_scenario(300, t_end=2.0), engine="tiles", step=0.005, progress=False)


def test_options_are_checked():
    for wrong in ({"scheme": "leapfrog"}, {"precision": "half"}, {"step": -1.0}, {"memory_limit": 0.0}):
        with pytest.raises(fk.InvalidInput):
            TilesOptions(**wrong)
    assert dataclasses.is_dataclass(TilesOptions)


def test_flight_through_obstacles_against_the_exact_engine():
    leader = fk.Velocity([4.0, 0.0])
    obstacles = [Ball([3.0, 0.4], 0.8), Ball([5.0, -1.0], 0.6)]
    law = fk.Law(
        fk.Proximity(1.2),
        [
            fk.Gradient(structural()),
            fk.Consensus(1.0),
            fk.Track(leader, velocity_gain=2.0),
            Avoid(obstacles, leader, range=0.7, attraction=structural(1.0), repulsion_gain=20.0),
        ],
    )
    scenario = fk.Scenario(law, fk.start.hexagonal(20, spacing=0.95, noise=0.02, seed=4), t_end=1.6, frames=6)
    exact = fk.simulate(scenario, progress=False)
    run = fk.simulate(scenario, engine="tiles", step=0.001, progress=False)
    assert np.abs(run.q - exact.q).max() < 0.03
    assert abs(run.residual[-1]) < 0.02 * run.turnover
    free = fk.simulate(
        scenario.with_(law=fk.Law(law.graph, law.terms[:3])), engine="tiles", step=0.001, ledger=False, progress=False
    )
    assert np.abs(run.q - free.q).max() > 0.3


MOST_ATTRIBUTES = 20
"""Attributes of the arrays of a group: more belong into an object of their own."""


def test_the_arrays_of_a_group_are_put_together_from_few_parts():
    particles = TilesSession(smooth_scenario(), TilesOptions(step=0.01))._particles
    assert type(particles).__name__ == "ParticleArrays"
    assert len(vars(particles)) <= MOST_ATTRIBUTES, sorted(vars(particles))


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("scheme", ["verlet", "damped", "rk4"])
def test_accelerations_are_those_of_the_velocities_of_now(scheme, precision):
    """Half-step-velocity Verlet stores those of half a step before; asking changes no bit of the motion."""
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(0.7)])
    agents = fk.PointMass(np.linspace(0.5, 2.0, 200), 0.4)
    made = fk.Scenario(law, fk.start.box(200, side=9.0, speed=1.0, seed=3), t_end=2.0, agents=agents)
    how = TilesOptions(step=0.01, scheme=scheme, precision=precision)
    session, untouched = TilesSession(made, how), TilesSession(made, how)
    for t in (0.0, 0.4, 1.1):
        session.advance(t)
        untouched.advance(t)
        state = session.state
        found = session.accelerations() * agents.masses[:, None]
        expected = fk.evaluate(law, fk.State(state.q, state.p), agents=agents).u - 0.4 * state.p
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11 if precision == "float64" else 1e-4)
    session.advance(2.0)
    untouched.advance(2.0)
    assert (session.run().q == untouched.run().q).all()
