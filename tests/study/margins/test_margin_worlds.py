"""Margins reuse only runs of equal scenarios, keep bodies in discrete time at their ticks, and go on past refusals."""

import functools
from dataclasses import dataclass, replace

import numpy as np
import pytest

import flocking as fk
from flocking.errors import StorageError, UnsupportedLaw
from flocking.study.claims.claim import Claim, Measure
from flocking.study.margins.fingerprints import fingerprint
from flocking.study.margins.margin_table import margins_from
from flocking.study.margins.quantities import Quantity, quantity_named
from flocking.study.sweeps.recorded_content import code_of

LAW = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2"))])
SHORT = Claim("short", "here", "The run ends early.", lambda e: Measure(5.0 - float(e.t[-1])))


def scenario(seed, t_end=2.0, **world):
    """Three agents of order 1."""
    start = fk.start.box(3, side=2, speed=0, seed=seed)
    return fk.Scenario(LAW, start, t_end=t_end, frames=5, bodies=fk.SingleIntegrator(), **world)


def longer_for_one(seed):
    """The same, but for one seed."""
    return scenario(seed, t_end=2.0 if seed == 0 else 8.0)


def table(make, vary="loss", **options):
    chosen = {"claims": (SHORT,), "period": 0.5, "seeds": 2, "workers": 1, "progress": False, **options}
    return fk.margins(make, vary, **chosen)


def test_runs_of_another_scenario_of_any_seed_are_not_reused(tmp_path):
    levels = {"loss": [0.0, 0.3]}
    first = table(scenario, levels=levels, out=tmp_path)
    assert table(scenario, levels=levels, out=tmp_path).cells == first.cells
    with pytest.raises(StorageError, match="seed 1: stored"):
        table(longer_for_one, levels=levels, out=tmp_path)
    fresh = table(longer_for_one, levels=levels)
    assert fresh.ideal["short"].held == 1
    assert first.ideal["short"].held == 2


def test_a_run_that_stands_for_other_seeds_is_not_reused_once_these_differ(tmp_path):
    same = functools.partial(as_seed_0, scenario)
    first = table(same, "period", levels={"period": [0.5]}, out=tmp_path)
    assert first.ideal["short"].total == 1
    with pytest.raises(StorageError, match="stored"):
        table(longer_for_one, "period", levels={"period": [0.5]}, out=tmp_path)


def test_a_seed_whose_ideal_run_is_that_of_another_seed_meets_the_hypothesis_as_that_one_does():
    early = replace(SHORT, hypothesis=SHORT.conclusion)
    margins = table(one_of_two, claims=(early,), levels={"loss": [0.3]}, seeds=4)
    assert margins.ideal["short"].total == 1  # seeds 0 and 2 are one run, 1 and 3 do not meet the hypothesis
    assert margins.margin("loss", "short").counts[0.3].total == 2


def one_of_two(seed):
    """A short scenario for even seeds, a long one for odd ones."""
    return scenario(0, t_end=8.0 if seed % 2 else 2.0)


def as_seed_0(make, seed):
    """The scenario of seed 0, whatever the seed."""
    return make(0)


def test_foreign_parts_are_told_apart_by_their_numbers_and_their_code():
    def body(drag, sign):
        @dataclass(frozen=True, eq=False)
        class Dragged(fk.Body):
            drag: object
            order = 1
            parameters = property(lambda self: {"drag": self.drag})

            def rates(self, x):
                return {"q": [u * x.parameter("drag") for u in x.u]}

        @dataclass(frozen=True, eq=False)
        class Driven(Dragged):
            def rates(self, x):
                return {"q": [-u * x.parameter("drag") for u in x.u]}

        Driven.__qualname__ = Dragged.__qualname__
        return (Dragged if sign > 0 else Driven)(drag)

    def print_of(drag, sign=1):
        return fingerprint(replace(scenario(0), agents=body(drag, sign)))

    assert print_of(0.5) == print_of(0.5)
    assert len({print_of(0.5), print_of(0.6), print_of(np.array([0.5, 0.5, 0.6])), print_of(0.5, -1)}) == 4


def test_code_of_callables_that_are_no_functions_tells_them_apart():
    class Maker:
        def __init__(self, gain):
            self.gain = gain

        def __call__(self, seed):
            return self.gain

    class Other(Maker):
        def __call__(self, seed):
            return -self.gain

    Other.__qualname__ = Maker.__qualname__

    def plain(gain, seed):
        return gain

    def other(gain, seed):
        return -gain

    other.__qualname__ = plain.__qualname__
    made = [
        Maker(1), Maker(2), Other(1), Maker(1).__call__, Maker(2).__call__, functools.partial(plain, 1),
        functools.partial(plain, 2), functools.partial(other, 1), plain, other,
    ]  # fmt: skip
    assert len({code_of(one) for one in made}) == len(made)
    assert code_of(Maker(1)) == code_of(Maker(1))
    assert code_of(functools.partial(plain, 1)) == code_of(made[5])


def test_bodies_in_discrete_time_keep_their_ticks_in_the_ideal_world():
    law = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    start = fk.start.box(3, side=2, speed=1, seed=0)
    made = fk.Scenario(law, start, 2.0, frames=5, bodies=fk.Impulsive(), control=fk.Held(0.1))
    found = table(made, ["period", "limit"], levels={"period": [0.1, 0.5]}, seeds=1)
    assert found.ideal["short"].held == 1
    assert found.margin("period", "short").counts[0.5].held == 1
    assert "limit" in found.refused


def picky(error):
    """A quantity that cannot have some of its values."""

    def world(made, value, _):
        if 0.2 < value < 0.6:
            raise error
        return made.with_(t_end=2.0 + 4.0 * value)

    return Quantity("picky", "further time", world, lambda made, period: (0.0, 0.1, 0.5, 1.0))


@pytest.mark.parametrize(
    ("error", "words"),
    [(UnsupportedLaw("no such thing"), "no such thing"), (RuntimeError("boom"), "RuntimeError: boom")],
)
def test_levels_that_are_refused_midway_leave_the_rest_of_the_table(error, words):
    found = table(scenario, picky(error), seeds=1)
    margin = found.margin("picky", "short")
    assert sorted(margin.counts) == [0.0, 0.1, 1.0]
    assert (margin.bracket.lower, margin.bracket.upper) == (0.1, 1.0)
    assert set(found.refused_levels["picky"]) >= {0.5}
    assert set(found.refused_levels["picky"].values()) == {words}
    assert f"picky was refused at 0.3162, 0.5, where nothing is known: {words}" in found.notes
    assert margins_from(found.as_dict()).refused_levels == found.refused_levels


def test_runs_that_fail_are_told_with_their_message():
    def world(made, value, _):
        law = fk.Law(LAW.graphs[0], [fk.Gradient(fk.Potential("(r - 9)**1.5"))])
        return made.with_(law=law) if value == 1.0 else made

    broken = Quantity("broken", "a force without value", world, lambda made, period: (0.0, 1.0, 2.0))
    found = table(scenario, broken, seeds=1, width=0.9)
    assert found.margin("broken", "short").counts[1.0].left_open == 1
    assert list(found.failures) == ["broken=1.0"]
    assert "finite" in found.failures["broken=1.0"]
    assert any("the first of broken=1.0: " in note for note in found.notes)
    assert margins_from(found.as_dict()).failures == found.failures


def test_levels_of_times_are_whole_nanoseconds():
    delay = quantity_named("delay")
    assert [delay.resolved(x) for x in (4.4e-10, 1.4e-9, 0.1, 2.5e-8)] == [0.0, 1e-9, 0.1, 2.5e-8]
    assert quantity_named("loss").resolved(4.4e-10) == 4.4e-10
    for level in (4e-10, 1.4e-9):
        with pytest.raises(fk.InvalidInput, match="whole multiples of 1e-09"):
            table(scenario, "delay", levels={"delay": [0.0, level]}, seeds=1)
    late = Claim("at-once", "here", "Nothing is late.", lambda e: Measure(
        1.0 if getattr(e.run.scenario.information, "delay", 0.0) == 0.0 else -1.0))  # fmt: skip
    found = table(scenario, "delay", claims=(late,), levels={"delay": [2e-9, 1.0]}, seeds=1)
    counts = found.margin("delay", "at-once").counts
    assert sorted(counts)[:2] == [0.0, 1e-9]  # nothing between: half a nanosecond is none
    bracket = found.margin("delay", "at-once").bracket
    assert (bracket.lower, bracket.upper) == (0.0, 1e-9)


@pytest.mark.parametrize("own", [fk.OrnsteinUhlenbeck(0.1, 0.2, time_constant=3.0), fk.WhiteNoise(0.1, 0.2)])
def test_noise_of_ones_own_keeps_its_kind_and_what_is_not_varied(own):
    given = scenario(0, control=fk.Held(0.5), information=fk.Messages(0.5, noise=own))
    varied = {
        name: quantity_named(name).world(given, 0.7, 0.5).information.noise for name in ("noise", "velocity-noise")
    }
    assert varied == {"noise": replace(own, position=0.7), "velocity-noise": replace(own, velocity=0.7)}
    assert quantity_named("velocity-noise").world(scenario(0), 0.7, 0.5).information.noise == fk.WhiteNoise(0.0, 0.7)


def test_a_seed_whose_ideal_run_leaves_the_hypothesis_open_is_not_counted():
    def doubtful(e):
        return Measure(1.0, np.inf if e.run.t[-1] > 5.0 else 0.0)

    margins = table(one_of_two, claims=(replace(SHORT, hypothesis=doubtful),), levels={"loss": [0.3]}, seeds=2)
    assert margins.ideal["short"].total == 1
    assert margins.margin("loss", "short").counts[0.3].total == 1
