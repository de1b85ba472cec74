"""Steps too large for what agents meet, with and without a ledger; books in the frame of the centre of mass."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.fixed_step.passing_pairs import check_passing, singular_reach
from flocking.engine.fixed_step.step_checks import STRIDE
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import StepTooLarge
from tests.engine.tiles.laws import saber, states

COULOMB = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("1/r + r")), fk.Consensus(1e-6)])


@pytest.mark.parametrize("ledger", [True, False])
def test_a_pair_that_would_pass_through_a_whole_radius_in_one_step_is_told(ledger):
    for offset, met in ((0.0, True), (0.9, True), (1.1, False)):
        start = fk.State([[0.0, 0.0], [3.0, offset]], [[30.0, 0.0], [-30.0, 0.0]])
        scenario = fk.Scenario(COULOMB, start, t_end=0.5, frames=2)
        if not met:
            assert fk.simulate(scenario, engine="tiles", step=0.1, ledger=ledger, progress=False).finished
            continue
        with pytest.raises(StepTooLarge, match="a pair at distance") as caught:
            fk.simulate(scenario, engine="tiles", step=0.1, ledger=ledger, progress=False)
        assert caught.value.agents == (0, 1)
        assert TilesSession(scenario, TilesOptions(ledger=ledger)).step <= 0.5 * STRIDE * 1.0 / 60.0


def test_every_pair_that_meets_is_found_among_many():
    """Against a look at all pairs at many times within the step."""
    rng = np.random.default_rng(5)
    found = 0
    for seed in range(60):
        n = 30
        q = rng.uniform(0, 14, (n, 2))
        moved = rng.normal(size=(n, 2)) * 0.02
        moved[seed % n] = rng.normal(size=2) * rng.choice([0.3, 2.0, 9.0])
        i, j = np.triu_indices(n, 1)
        way = np.linspace(0, 1, 2001)[:, None, None]
        apart = np.linalg.norm((q[j] - q[i]) + way * (moved[j] - moved[i]), axis=2)
        share = np.linalg.norm(moved[j] - moved[i], axis=1) / apart[0]
        wrong = (apart[0] >= 1.0) & (apart.min(axis=0) < 1.0 - 1e-3) & (share > STRIDE)
        if wrong.any():
            found += 1
            with pytest.raises(StepTooLarge):
                check_passing(q, moved, 1.0, 0.1, time=0.0)
        elif not ((apart[0] >= 1.0) & (apart.min(axis=0) < 1.0 + 1e-3) & (share > STRIDE)).any():
            check_passing(q, moved, 1.0, 0.1, time=0.0)
    assert 5 < found < 55


def test_two_that_each_move_less_than_the_share_are_found_together():
    """Head on from 1.2: by 0.35 relative to each other, 0.175 each, which is less than a quarter of the radius."""
    q, others = np.array([[0.0, 0.0], [1.2, 0.0]]), np.array([[9.0, 9.0], [-9.0, 9.0]])
    toward = np.array([[0.175, 0.0], [-0.175, 0.0]])
    with pytest.raises(StepTooLarge, match=r"moved 0\.35 in one step"):
        check_passing(np.vstack([q, others]), np.vstack([toward, 0.0 * others]), 1.0, 0.1, time=0.0)
    check_passing(q, 0.8 * toward, 1.0, 0.1, time=0.0)


def test_only_potentials_that_diverge_have_a_reach_that_counts():
    assert singular_reach(COULOMB) == 1.0
    assert singular_reach(saber()) == np.inf


@pytest.mark.parametrize("step", [0.2, 0.5, 0.8])
def test_an_unstable_step_shows_without_a_ledger(step):
    start = fk.start.hexagonal(200, spacing=0.95, noise=0.05, speed=1.0, seed=1)
    scenario = fk.Scenario(saber(), start, t_end=200 * step, frames=2)
    with pytest.raises(StepTooLarge) as caught:
        fk.simulate(scenario, engine="tiles", step=step, ledger=False, progress=False)
    assert 0 < caught.value.would_do < 0.2 * step + 1e-9


def test_motion_that_calms_down_to_rounding_is_not_unstable():
    lattice = fk.start.hexagonal(60, spacing=1.0, noise=0.0, speed=0.0, seed=1)
    for precision in ("float64", "float32"):
        scenario = fk.Scenario(saber(), lattice, t_end=12.0, frames=2)
        assert fk.simulate(
            scenario, engine="tiles", step=0.02, ledger=False, precision=precision, progress=False
        ).finished


def test_what_is_watched_survives_a_snapshot():
    start = fk.start.hexagonal(60, spacing=0.95, noise=0.05, speed=1.0, seed=1)
    session = TilesSession(fk.Scenario(saber(), start, t_end=8.0, frames=2), TilesOptions(step=0.1, ledger=False))
    session.advance(0.7)
    kept, before = session.snapshot(), session.instability.copy()
    assert before.compared == 6
    session.advance(1.5)
    again = TilesSession.resume(kept)
    assert again.instability.compared == before.compared
    again.advance(1.5)
    assert again.instability.products == session.instability.products


def test_kinetic_energy_in_the_frame_of_the_centre_of_mass_is_that_of_whole_velocities():
    """A pull of all agents alike moves the mean by much within half a step."""
    start = states(40, 2, seed=3)["random"]
    law = fk.Law(fk.Proximity(1.2), [fk.Consensus(1.0), fk.Track(fk.Velocity([100.0, 0.0]), velocity_gain=5.0)])
    agents = fk.Agents(masses=np.random.default_rng(1).uniform(0.5, 2.0, 40))
    scenario = fk.Scenario(law, start, t_end=0.1, frames=11, agents=agents, energy=fk.Energy("centre of mass"))
    run = fk.simulate(scenario, engine="tiles", step=0.01, progress=False)
    masses = np.asarray(agents.masses)
    for t, p in zip(run.t, run.p, strict=True):
        mean = masses @ p / masses.sum()
        kinetic = run.trace["kinetic"][np.argmin(np.abs(run.trace["time"] - t))]
        assert kinetic == pytest.approx(0.5 * (masses[:, None] * (p - mean) ** 2).sum(), rel=1e-10)


def test_many_frames_do_not_spoil_the_books_of_a_flock_with_a_leader():
    from flocking.papers import paper

    scenario = paper("olfati-saber-2003").scenarios()["olfati-saber-2003"](0).with_(t_end=0.1, frames=21)
    run = fk.simulate(scenario, engine="tiles", progress=False)
    assert run.finished
    assert np.abs(run.residual).max() < 0.01 * run.turnover
