"""How often a gain that is one per cent off is noticed, and how often what is right is called wrong."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.errors import LawNotObeyed, StepTooLarge
from flocking.study.claims.claim import Verdict
from tests.counting import count
from tests.engine.tiles.laws import shi
from tests.engine.tiles.test_law_check import saber, zhou


def smooth(gain=1.0, consensus=1.0):
    psi = fk.Potential("k*(r - 1)**2/2", k=5 * gain)
    return fk.Law(fk.Smooth(1.3, 0.7), [fk.Gradient(psi), fk.Consensus(consensus, weighted=True)])


def hashed(gain=1.0, consensus=1.0):
    weights = fk.HashedWeights(0.2 * consensus, consensus, seed=7)
    track = fk.Track(fk.Path(["sin(t)", "cos(t)"]), position_gain=0.1, velocity_gain=0.5 * gain)
    return fk.Law(fk.Proximity(4.0), [fk.Gradient(shi()), fk.Consensus(1.0, weights=weights), track])


SPACING = {saber: 0.9, zhou: 2.6, smooth: 0.95, hashed: 3.2}


def honest(seed, laws, schemes):
    """A random run: its law, size, start, frame of the energy, precision, scheme and a step up to the automatic one."""
    rng = np.random.default_rng(seed)
    law, precision = laws[rng.integers(len(laws))], ("float64", "float32")[rng.integers(2)]
    scheme = schemes[rng.integers(len(schemes))]
    n = int(10 ** rng.uniform(0.4, 3.3))
    made = law(float(rng.uniform(0.5, 2.0)), float(rng.uniform(0.1, 2.0)))
    start = fk.start.hexagonal(
        n, spacing=SPACING[law], noise=0.03 * SPACING[law], speed=float(rng.uniform(0, 0.4)), seed=seed
    )
    shift = rng.normal(size=2) * 10 ** rng.uniform(-1, 1.5)
    state = fk.State(start.q + shift, start.p + rng.normal(size=2))
    longest = TilesSession(fk.Scenario(made, state, t_end=10.0, frames=1), TilesOptions(scheme=scheme)).step
    step = float(longest * rng.uniform(0.1, 1.0))
    scenario = fk.Scenario(made, state, t_end=step * rng.integers(16, 70), frames=2)
    return scenario, {"step": step, "precision": precision, "scheme": scheme, "engine": "tiles"}


def alarms(seeds, laws, schemes=("verlet",)):
    """What was said of honest runs, where it was more than that the ledger closes; and the largest gap met.

    A step that is too large may be said to be so: with the step that would do nothing more may be said.
    """
    found, worst = [], 0.0
    for seed in seeds:
        scenario, how = honest(seed, laws, schemes)
        try:
            try:
                run = fk.simulate(scenario, progress=False, **how)
            except StepTooLarge as error:
                count("honest runs whose step was too large", 1)
                run = fk.simulate(scenario, progress=False, **{**how, "step": error.would_do})
        except fk.SimulationError as error:
            found.append((seed, str(error)))
            continue
        worst = max(worst, run.provenance["law_gap"] / max(run.provenance["law_gap_allowed"], 1e-300))
        if fk.audit(run)["ledger"].verdict != Verdict.HOLDS:
            found.append((seed, fk.audit(run)["ledger"].note))
    return found, worst


def noticed(seed, size, laws):
    """Whether one wrong gain is noticed: in the forces alone, or in what forces and books are made from."""
    rng = np.random.default_rng(seed)
    law = laws[rng.integers(len(laws))]
    # So little that among a million no pair is next to the barrier at the radius.
    start = fk.start.hexagonal(size, spacing=SPACING[law], noise=0.015 * SPACING[law], speed=0.3, seed=seed)
    scenario = fk.Scenario(law(), start, t_end=0.01, frames=2)
    options = TilesOptions(step=0.0025, precision=("float64", "float32")[rng.integers(2)], keep_frames=False)
    factor = 1.0 + 0.01 * rng.choice([-1, 1])
    gains = [(factor, 1.0), (1.0, factor)][rng.integers(2)]
    plant = law(*gains)
    if rng.integers(2):
        run = TilesSession(scenario, options, plant=plant)
        run.advance(0.01)
        return fk.audit(run.run())["ledger"].verdict == Verdict.FAILS
    session = TilesSession(scenario, options)
    wrong = TilesSession(scenario.with_(law=plant), options)._particles
    session._particles._set_parameters = lambda *_: None
    session._particles.parameters.P = wrong.parameters.P
    try:
        session.advance(0.01)
    except LawNotObeyed:
        return True
    return False


def test_honest_runs_give_no_alarm():
    found, worst = alarms(range(2), [saber, zhou])
    assert not found
    assert worst < 0.5


def test_wrong_gains_are_noticed():
    assert all(noticed(seed, 10 ** int(3 + seed % 2), [saber, zhou]) for seed in range(6))


@pytest.mark.slow
def test_a_thousand_honest_runs_give_no_alarm():
    found, worst = alarms(range(1000), [saber, zhou, smooth, hashed], ("verlet", "damped", "rk4"))
    assert not found, f"{len(found)}: {found[:5]}"
    assert worst < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("size", [10**3, 10**4, 10**5, 10**6])
def test_of_a_hundred_wrong_gains_ninety_nine_are_noticed(size):
    caught = [noticed(seed, size, [saber, zhou, smooth, hashed]) for seed in range(100)]
    assert sum(caught) >= 99, f"missed {np.flatnonzero(~np.array(caught))}"
