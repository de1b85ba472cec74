"""What a summary counts: runs that failed, runs that are one run, and names that stand for two things."""

import math
import time
import warnings

import numpy as np
import pytest
from scipy.stats import binomtest

import flocking as fk
from flocking.errors import SuspectInput
from tests.study.sweeps.sweep_cases import make


def run(made=make, **options):
    return fk.sweep(made, **{"workers": 1, "progress": False, "measures": {"true": lambda run: True}, **options})


def ends(successes, total):
    found = binomtest(successes, total).proportion_ci(0.95, method="exact")
    return found.low, found.high


def test_runs_that_failed_may_be_those_in_which_a_truth_value_is_false():
    """Fifteen of twenty show it and five failed: the share is between that of 15 and that of 20 of 20."""

    def made(seed):
        if seed < 5:
            raise ValueError("no such start")
        return make(seed=seed)

    found = run(made, seeds=range(20)).summary()
    assert (float(found["true_low"]), float(found["true_high"])) == pytest.approx((ends(15, 20)[0], 1.0))
    assert math.isnan(found["true"])
    assert (int(found["true_count"]), int(found["runs"]), int(found["failed"])) == (15, 20, 5)
    assert "5 unknown as either" in str(found["true_interval"].values)


def test_runs_that_failed_are_left_out_of_means_and_counted():
    def made(seed):
        if seed < 5:
            raise ValueError("no such start")
        return make(seed=seed)

    found = run(made, seeds=range(20), measures={"seed_of_run": lambda run: float(run.scenario.seed)}).summary()
    assert float(found["seed_of_run"]) == np.arange(5, 20).mean()
    assert int(found["seed_of_run_count"]) == 15


@pytest.mark.parametrize("seeds", [20, range(20)])
def test_runs_of_one_scenario_are_one_run(seeds):
    """A family that ignores its seed shows in twenty runs no more than in one."""
    with pytest.warns(SuspectInput, match="20 runs of 1 different scenarios"):
        found = run(lambda seed: make(seed=0), seeds=seeds).summary()
    assert (float(found["true_low"]), float(found["true_high"])) == pytest.approx(ends(1, 1))
    assert (int(found["true_count"]), int(found["runs"]), int(found["different"])) == (1, 20, 1)


def test_a_scenario_that_few_seeds_change_counts_as_often_as_it_changes(tmp_path):
    given = {"made": lambda seed: make(seed=seed // 4), "seeds": range(20), "out": tmp_path / "out"}
    spread = {"spread": "velocity_spread", "slow": lambda run: bool(run.scenario.seed < 2)}
    found = run(**given, measures=spread).summary()
    plain = run(seeds=range(5), measures=spread).summary()
    for name in ("spread", "spread_low", "spread_high", "slow", "slow_low", "slow_high"):
        assert float(found[name]) == pytest.approx(float(plain[name]), rel=1e-12, nan_ok=True)
    assert int(found["different"]) == 5
    assert fk.read_sweep(tmp_path / "out").summary().equals(found)


def world(seed, loss):
    """Two agents that hear each other by messages, of which some are lost."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]])
    heard = fk.Messages(0.1, loss=fk.Bernoulli(loss) if loss else None, seed=seed)
    return fk.Scenario(law, start, t_end=0.2, frames=2, control=fk.Held(0.1), information=heard, seed=seed)


@pytest.mark.parametrize(("loss", "different"), [(0.0, 1), (0.01, 6)])
def test_seeds_that_draw_nothing_make_no_other_run_and_draws_without_effect_do(loss, different):
    """With a loss of 1 % hardly anything is lost in three messages; the runs are equal and still independent."""
    found = run(lambda seed: world(seed, loss), seeds=range(6)).summary()
    assert int(found["different"]) == different
    assert float(found["true_low"]) == pytest.approx(ends(different, different)[0])


def test_whole_numbers_that_no_column_holds_are_refused_before_they_are_stored(tmp_path):
    given = {"seeds": [0, 1], "measures": {"count": lambda run: 10**20}, "out": tmp_path / "out"}
    table = run(**given)
    assert [row["status"] for row in table.rows.values()] == ["failed"] * 2
    assert "whole numbers of at most 9007199254740992" in table.failures[0]["message"]
    assert len(fk.read_sweep(tmp_path / "out")) == 2
    assert run(seeds=[0], measures={"count": lambda run: 2**53}).values("count") == 2**53


@pytest.mark.parametrize("names", [("a", "a_low"), ("a", "a_count"), ("a_interval", "a"), ("claim_a",)])
def test_measures_have_no_name_of_another_column(names):
    with pytest.raises(fk.InvalidInput, match="measures must"):
        run(measures={name: lambda run: 1.0 for name in names})


def test_parameters_have_no_name_of_another_column():
    for name in ("true_high", "claim_a"):
        with pytest.raises(fk.InvalidInput, match=name):
            run(lambda seed, **given: make(seed=seed), grid={name: [1, 2]})


@pytest.mark.parametrize("given", [
    {"grid": {"kind": {"a", "b"}}}, {"seeds": {1, 2}}, {"seeds": frozenset((1, 2))},
])  # fmt: skip
def test_values_without_an_order_are_refused(given):
    """The seeds of runs follow from the places of values, and the order of a set of texts differs between processes."""
    with pytest.raises(fk.InvalidInput, match="must be in an order"):
        run(lambda kind, seed: make(seed=seed), **given)


def test_seeds_that_no_table_holds_are_refused():
    assert run(seeds=[2**63 - 1]).columns["seed"] == [2**63 - 1]
    with pytest.raises(fk.InvalidInput, match="seeds must be at most 9223372036854775807"):
        run(seeds=[1, 2**63])


@pytest.mark.parametrize(("values", "told"), [
    ([1, 2], [1, 2]), ([True, False], [True, False]), (["a", "b"], ["a", "b"]), ([1, 0.5], [1, 0.5]),
    ([True, 2, 0.5], ["true", "2", "0.5"]), ([1, 1.0], ["1", "1.0"]), ([2**70, 1], [str(2**70), "1"]),
    ([2**53 + 1, 0.5], [str(2**53 + 1), "0.5"]), ([0.0, -0.0], ["0.0", "-0.0"]), ([2**62, 1], [2**62, 1]),
])  # fmt: skip
def test_values_that_a_column_would_merge_or_round_are_told_by_their_texts(values, told, tmp_path):
    from pyarrow import parquet

    table = run(lambda kind, seed: make(seed=seed), grid={"kind": values})
    assert list(table.columns["kind"]) == table.dataset.kind.values.tolist() == told
    assert [type(x) for x in table.columns["kind"]] == [type(x) for x in told]
    assert parquet.read_table(table.to_parquet(tmp_path / "a.parquet")).column("kind").to_pylist() == told


@pytest.mark.parametrize(("seeds", "found"), [(range(3), ("name", "size")), (3, ())])
def test_parameters_that_change_nothing_are_named_where_seeds_are_equal(seeds, found):
    """A parameter that ``make`` forgets gives columns of equal runs; with other seeds for each point nobody sees it."""
    grid = {"speed": [0.5, 1.0], "size": [1, 2], "name": ["a", "b"], "single": [1]}

    def forgetful(speed, size, name, single, seed):
        return make(speed, seed=seed).with_(name=name)

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        table = run(forgetful, grid=grid, seeds=seeds)
    assert sorted(table.without_effect) == sorted(found)
    told = [str(each.message) for each in caught if each.category is SuspectInput]
    assert len(told) == len(found)
    assert all(any(repr(name) in text for text in told) for name in found)
    assert run(lambda speed, seed: make(speed * (seed != 1), seed=seed), grid={"speed": [0.5, 1.0]},
               seeds=range(3)).without_effect == ()  # fmt: skip


def test_means_of_the_largest_numbers_are_between_their_ends():
    sizes = [1e308, 1.2e308, 1.1e308, -1e308, 1.3e308, 1e308, 1.2e308, 1.4e308]
    found = run(seeds=range(8), measures={"size": lambda run: sizes[run.scenario.seed]}).summary()
    assert float(found["size"]) == pytest.approx(sum(x / 8 for x in sizes))
    assert float(found["size_low"]) < float(found["size"]) < float(found["size_high"])


def test_texts_that_no_file_encodes_are_written_as_escapes(tmp_path):
    from pyarrow import parquet

    def failing(kind, seed):
        raise ValueError("no file \udcff")

    table = run(failing, grid={"kind": ["a", "\udcfe"]}, out=tmp_path / "out")
    assert len(fk.read_sweep(tmp_path / "out")) == 2
    text = table.to_csv(tmp_path / "runs.csv").read_text(encoding="utf-8")
    assert "\\udcff" in text
    assert "\\udcfe" in text
    assert parquet.read_table(table.to_parquet(tmp_path / "a.parquet")).column("kind").to_pylist() == ["a", "\\udcfe"]


def test_messages_that_are_cut_off_say_so():
    def failing(seed):
        raise ValueError("x" * 600)

    (row,) = run(failing, seeds=[0]).rows.values()
    assert len(row["message"]) == 500
    assert row["message"].endswith("x ...")


def test_a_value_twice_among_many_is_found_soon():
    begin = time.process_time()
    with pytest.raises(fk.InvalidInput, match="must not hold a value twice; got '59999'"):
        run(grid={"speed": [*range(60_000), 59_999]})
    assert time.process_time() - begin < 10


def test_groups_beyond_a_size_are_not_compared():
    from flocking.study.sweeps.equal_scenarios import run_digest

    few = make(n=5)
    assert run_digest(few) == run_digest(few, most_agents=5) != ""
    assert run_digest(few, most_agents=4) == ""
