"""What margins say of their runs, and what they refuse."""

import pytest

import flocking as fk
from flocking.study.claims.claim import Claim, below
from flocking.study.margins.quantities import default_levels, quantities

LAW = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
ONE_RUN = "Seeds whose scenarios are equal in a world are one run there."


def make(seed):
    return fk.Scenario(LAW, fk.start.box(3, side=2, speed=1, seed=seed), t_end=0.5, frames=3)


def slow(limit):
    return Claim("slow", "own question", "It is slow.", lambda e: below(float(e.speeds[-1]), limit, "speed"))


def margins(scenario=make, vary="period", **options):
    given = {"seeds": 3, "levels": {"period": [0.1, 0.2]}, "width": 0.9, "workers": 1, "progress": False}
    return fk.margins(scenario, vary, **{**given, **options})


def test_runs_of_equal_scenarios_are_said_to_be_one():
    alone, several = margins(make(0), claims=[slow(9.0)]), margins(claims=[slow(9.0)])
    assert (alone.runs, several.runs) == (3, 9)
    assert ONE_RUN in alone.notes
    assert ONE_RUN not in several.notes


@pytest.mark.parametrize(("options", "words"), [
    ({"claims": [slow(9.0), slow(-1.0)]}, "margins: claims must have different keys.* got 'slow'"),
    ({"claims": [3]}, "margins: claims must be claims; got 3"),
    ({"claims": "slow"}, "margins: claims must be claims"),
    ({"most_runs": 8}, "margins: most_runs must be at least 9, the runs of the ideal world and of the first levels"),
    ({"confidence": 2}, "margins: confidence must be below 1; got 2"),
])  # fmt: skip
def test_what_cannot_be_told_apart_is_refused(options, words):
    with pytest.raises(fk.InvalidInput, match=words):
        margins(**options)


@pytest.mark.parametrize("t_end", [0.0, 1e-300, 1e-10])
def test_a_run_without_time_for_controls_is_refused(t_end):
    with pytest.raises(fk.InvalidInput, match=r"margins: t_end must be at least .* after the start"):
        margins(lambda seed: fk.Scenario(make(seed).law, make(seed).start, t_end=t_end), "loss", levels=None)


def test_claims_of_one_key_are_refused_wherever_verdicts_are_kept_by_keys():
    run = fk.simulate(make(0), progress=False)
    with pytest.raises(fk.InvalidInput, match="audit: claims must have different keys"):
        fk.audit(run, [slow(9.0), slow(-1.0)])
    with pytest.raises(fk.InvalidInput, match="sweep: audit must have different keys"):
        fk.sweep(make, audit=[slow(9.0), slow(-1.0)], workers=1, progress=False)


def test_default_levels_are_those_that_are_simulated():
    """Times are whole nanoseconds: half a nanosecond would be none."""
    short = fk.Scenario(fk.Law(fk.Fixed.complete(3), [fk.Consensus(1e8)]), make(0).start, t_end=1e-6, frames=3)
    for name in ("period", "delay", "latency"):
        levels = default_levels(quantities()[name], short, 1e-9)
        assert levels
        assert all(round(level * 1e9) == pytest.approx(level * 1e9, rel=1e-9) for level in levels), name
    tiny = short.with_(t_end=1e-9)
    with pytest.raises(fk.InvalidInput, match="must be given: of the default grid none is a whole multiple of 1e-09"):
        default_levels(quantities()["period"], tiny, 1e-9)
