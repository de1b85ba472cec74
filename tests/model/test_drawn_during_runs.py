"""Seeds of what is drawn during a run: found wherever it is drawn, and left alone where nothing is."""

from dataclasses import dataclass

import numpy as np
import pytest

import flocking as fk
from flocking.model.drawn_during_runs import draws_during_runs, with_seed_of_run
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
