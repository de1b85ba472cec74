"""Seeds of what is drawn during a run: found wherever it is drawn, and left alone where nothing is."""

from dataclasses import dataclass

import numpy as np
import pytest

import flocking as fk
from flocking.model.drawn_during_runs import draws_during_runs, with_seed_of_run
from flocking.model.parts.description import registered_names
from flocking.study.margins.fingerprints import fingerprint
from flocking.study.scenario_files.scenario_file import scenario_to_text

Q = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
P = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]])
POINT = fk.PointMass()

RANDOM = {
    "losses": {"control": fk.Held(0.1), "information": fk.Messages(0.1, loss=0.3)},
    "jitter": {"control": fk.Held(0.1), "information": fk.Messages(0.1, jitter=0.05)},
    "noise": {"control": fk.Held(0.1), "information": fk.Messages(0.1, noise=fk.WhiteNoise(0.0, 0.1))},
    "gusts": {"agents": fk.Disturbed(POINT, 0.1, period=0.05)},
    "gusts inside a limit": {"agents": fk.Limited(fk.Disturbed(POINT, [0.0, 0.1, 0.0], period=0.05), force=1.0)},
    "gusts of one body": {"agents": fk.Mixture((POINT, fk.Disturbed(POINT, 0.1, period=0.05)), [0, 1, 0])},
    "noise of headings": {"agents": fk.Heading(1.0, noise=0.5), "control": fk.Held(0.1)},
    "order of turns": {"agents": fk.Impulsive(update="shuffled"), "control": fk.Held(0.1)},
}
CERTAIN = {
    "nothing": {},
    "exact messages": {"control": fk.Held(0.1), "information": fk.Messages(0.1, loss=0.0, noise=fk.WhiteNoise(0.0))},
    "delays": {"information": fk.Delayed(0.1)},
    "no gusts": {"agents": fk.Disturbed(POINT, 0.0, period=0.05)},
    "headings": {"agents": fk.Heading(1.0), "control": fk.Held(0.1)},
    "turns in order": {"agents": fk.Impulsive(update="sequential"), "control": fk.Held(0.1)},
}
LAW = fk.Law(fk.Fixed.complete(3), [fk.Consensus(1.0, weights=fk.HashedWeights(0.5, 1.0, seed=4))])


def scenario(world):
    return fk.Scenario(LAW, fk.State(Q, P), t_end=1.0, **world)


def seeds_in(value):
    """Every seed of the random parts of a written scenario."""
    import tomllib

    data = tomllib.loads(value)
    waiting, found = [data.get("agents"), data.get("information")], []
    while waiting:
        entry = waiting.pop()
        if isinstance(entry, dict):
            found += [entry["seed"]] if "seed" in entry else []
            waiting += entry.values()
        elif isinstance(entry, list):
            waiting += entry
    return found


@pytest.mark.parametrize("kind", RANDOM)
def test_the_seed_reaches_all_that_is_drawn(kind):
    given = scenario(RANDOM[kind])
    assert draws_during_runs(given)
    other = with_seed_of_run(given, 7)
    assert seeds_in(scenario_to_text(other)) == [7]
    assert fingerprint(with_seed_of_run(other, 0)) == fingerprint(given)
    assert other.law.terms[0].weights.seed == 4


@pytest.mark.parametrize("kind", CERTAIN)
def test_where_nothing_is_drawn_nothing_changes(kind):
    given = scenario(CERTAIN[kind])
    assert not draws_during_runs(given)
    assert with_seed_of_run(given, 7) is given


def test_bodies_and_messages_get_the_seed_together():
    both = scenario({**RANDOM["gusts"], **RANDOM["losses"]})
    assert seeds_in(scenario_to_text(with_seed_of_run(both, 3))) == [3, 3]


def test_a_body_of_ones_own_with_a_seed_is_taken_to_be_random():
    @dataclass(frozen=True, eq=False)
    class Shaken(fk.Body):
        strength: float
        seed: int = 0
        order = 2
        parameters = property(lambda self: {})

        def rates(self, x):
            return {"q": x.p, "p": x.u}

    given = scenario({}).with_(agents=POINT)
    assert not draws_during_runs(given)
    assert with_seed_of_run(given.with_(agents=Shaken(0.1)), 5).agents.seed == 5


def test_margins_draw_gusts_with_the_seed_of_the_run_in_every_world():
    from flocking.study.margins.quantities import quantities
    from flocking.study.margins.worlds import Worlds

    worlds = Worlds(lambda seed: scenario(RANDOM["gusts"]), {"loss": quantities()["loss"]}, 0.1)
    assert seeds_in(scenario_to_text(worlds(world="ideal", seed=4))) == [4]
    assert seeds_in(scenario_to_text(worlds(world="loss=0.5", seed=4))) == [4, 4]
    assert worlds(world="ideal", seed=4).agents.seed == 4


@pytest.mark.parametrize("order", [1, 2])
def test_gusts_within_gusts_stay_independent_with_the_seed_of_the_run(order):
    """Two of intensity 1: the variance of what they add up to in a time t is 2 t, and 4 t where both are the same."""
    n = 400
    inner = fk.SingleIntegrator() if order == 1 else POINT
    body = fk.Disturbed(fk.Disturbed(inner, 1.0, 0.1, seed=1), 1.0, 0.1, seed=2)
    law = fk.Law(fk.Fixed(n, ()), [fk.Gradient(fk.Potential("r**2/2"))])
    start = fk.State(np.zeros((n, 3)) + np.arange(n)[:, None])
    made = fk.Scenario(law, start, t_end=1.0, frames=2, bodies=body, control=fk.Held(0.5))
    run = fk.simulate(with_seed_of_run(made, 7), progress=False)
    found = run.q[-1] - run.q[0] if order == 1 else run.p[-1]
    # Of 1200 numbers the variance has an error of 1/24 of itself.
    assert np.var(found) == pytest.approx(2.0, rel=5 / 24)


def test_the_outermost_of_parts_within_each_other_has_the_seed_of_the_run():
    inner = fk.Disturbed(POINT, 1.0, 0.1, seed=1)
    agents = with_seed_of_run(scenario({"agents": fk.Disturbed(fk.Lagged(inner, 0.1), 1.0, 0.1, seed=2)}), 7).agents
    assert agents.seed == 7
    assert agents.body.body.seed not in range(1000)
    beside = fk.Mixture((inner, fk.Disturbed(POINT, 2.0, 0.1)), [0, 1, 0])
    assert [x.seed for x in with_seed_of_run(scenario({"agents": beside}), 7).agents.bodies] == [7, 7]


def test_gusts_within_gusts_of_one_seed_are_warned_of():
    inner = fk.Lagged(fk.Disturbed(POINT, 1.0, 0.1), 0.2)
    with pytest.warns(fk.errors.SuspectInput, match="seed 0 is also that of gusts inside it"):
        fk.Disturbed(inner, 0.5, 0.2)
    with pytest.warns(fk.errors.SuspectInput, match="seed 0 is also"):
        fk.Disturbed(fk.Mixture((POINT, inner), [0, 1, 0]), 0.5, 0.2)
    fk.Disturbed(inner, 0.5, 0.2, seed=1)
    fk.Disturbed(inner, 0.0, 0.2)
    fk.Disturbed(fk.Disturbed(POINT, 0.0, 0.1), 0.5, 0.2)


SEEDED = {
    "HashedWeights": lambda seed: fk.HashedWeights(0.1, 1.0, seed),
    "Heading": lambda seed: fk.Heading(0.03, seed=seed),
    "Impulsive": lambda seed: fk.Impulsive(seed=seed),
    "Disturbed": lambda seed: fk.Disturbed(fk.PointMass(), 0.1, 0.1, seed),
    "VelocityUnit": lambda seed: fk.VelocityUnit(0.1, seed=seed),
    "Messages": lambda seed: fk.Messages(0.1, seed=seed),
    "Fixes": lambda seed: fk.Fixes(0.1, seed=seed),
}  # fmt: skip
"""Parts whose draws are functions of their seed."""


def test_all_parts_with_a_seed_are_tried():
    library = {name for name, kind in registered_names().items() if kind.builds.__module__.startswith("flocking.")}
    assert {name for name in library if "seed" in registered_names()[name].fields} == {*SEEDED, "Scenario"}


@pytest.mark.parametrize("part", SEEDED)
def test_seeds_that_draw_nothing_of_their_own_are_refused(part):
    """Above 2^63 - 1 no file holds them, and some draw what another one does; others ended a run with a traceback."""
    made = SEEDED[part]
    assert [made(seed).seed for seed in (0, np.int64(7), 2**63 - 1)] == [0, 7, 2**63 - 1]
    for seed, rule in ((3.5, "an integer"), (True, "an integer"), ("a", "an integer"), (None, "an integer"),
                       (-1, "at least 0"), (2**63, "at most 9223372036854775807"), (2**64, "at most")):  # fmt: skip
        with pytest.raises(fk.InvalidInput, match=f"seed must be {rule}"):
            made(seed)
