"""Sweeps: which runs there are, what becomes of them, and what is kept."""

import json
import threading

import numpy as np
import pytest

import flocking as fk
from flocking.errors import StorageError
from flocking.study.sweeps.measures import MEASURES
from flocking.study.sweeps.plan import make_plan
from tests.study.sweeps.sweep_cases import make, make_or_fail, noting

SPEEDS = [0.5, 1.0, 2.0]


def run(**arguments):
    return fk.sweep(**{"make": make, "workers": 1, "progress": False, **arguments})


def test_every_combination_runs_with_every_seed_and_gives_what_simulate_gives():
    table = run(grid={"speed": SPEEDS, "n": [2, 3]}, seeds=[7, 8], measures=["velocity_spread", "flocks"])
    data = table.dataset
    assert data.velocity_spread.dims == ("speed", "n", "seed")
    assert data.sizes == {"speed": 3, "n": 2, "seed": 2}
    alone = fk.simulate(make(speed=1.0, n=2, seed=8), progress=False)
    spread = np.linalg.norm(alone.p[-1] - alone.p[-1].mean(axis=0), axis=1).max()
    assert float(data.velocity_spread.sel(speed=1.0, n=2, seed=8)) == spread
    assert table.complete
    assert table.status == "finished"
    assert (data.status == "ok").all()
    assert json.loads(data.attrs["provenance"])["plan"]["seeds"] == [7, 8]


def test_speeds_and_velocities_spread_apart_from_each_other():
    table = run(seeds=[7], grid={"speed": [1.0], "n": [3]}, measures=["speed_spread", "velocity_spread"])
    alone = fk.simulate(make(speed=1.0, n=3, seed=7), progress=False)
    speeds = np.linalg.norm(alone.p[-1], axis=1)
    assert float(table.values("speed_spread").item()) == pytest.approx(speeds.max() - speeds.min(), rel=1e-14)
    assert table.values("speed_spread").item() != table.values("velocity_spread").item()


def test_seeds_depend_on_the_place_of_a_run_alone():
    plan = make_plan({"speed": SPEEDS}, None, 4, 0, 100)
    seeds = [plan.task(k).seed for k in range(plan.size)]
    assert len(set(seeds)) == 12
    assert [plan.task(k).seed for k in reversed(range(12))] == seeds[::-1]
    expected = np.random.SeedSequence(0, spawn_key=(2, 3)).generate_state(1, np.uint64)[0] >> np.uint64(1)
    assert seeds[-1] == int(expected)
    assert make_plan({"speed": SPEEDS}, None, 4, 1, 100).task(0).seed != seeds[0]


@pytest.mark.parametrize("method", ["random", "latin", "sobol"])
def test_points_are_drawn_from_their_ranges(method):
    sample = fk.Sample(method, 64, {"speed": (0.01, 10.0), "n": (2, 5)}, log=["speed"], seed=3)
    points = sample.points()
    assert points == fk.Sample(method, 64, {"speed": (0.01, 10.0), "n": (2, 5)}, log=["speed"], seed=3).points()
    assert points != fk.Sample(method, 64, {"speed": (0.01, 10.0), "n": (2, 5)}, log=["speed"], seed=4).points()
    speed, n = np.array(points["speed"]), np.array(points["n"])
    assert ((speed >= 0.01) & (speed <= 10.0)).all()
    assert set(points["n"]) == {2, 3, 4, 5}
    # The logarithm is even: half of the values lie below its middle. Independent draws may stray by 4 sigma.
    assert abs((speed < 10**-0.5).sum() - 32) <= (16 if method == "random" else 1)
    if method != "random":
        slices = np.floor(64 * np.log(speed / 0.01) / np.log(1000)).astype(int)
        assert sorted(np.clip(slices, 0, 63)) == list(range(64))
    assert all((n == k).sum() >= 6 for k in (2, 3, 4, 5))


def test_drawn_points_are_crossed_with_the_grid():
    sample = fk.Sample("sobol", 4, {"speed": (0.1, 1.0)})
    table = run(grid={"n": [2, 3]}, sample=sample, seeds=2, measures=["velocity_spread"])
    assert table.dataset.velocity_spread.dims == ("n", "sample", "replicate")
    assert list(table.dataset.speed.values) == list(sample.points()["speed"])
    assert table.summary().velocity_spread.shape == (2, 4)


def test_a_failure_is_a_row_with_its_message_and_all_others_run():
    table = run(make=make_or_fail, grid={"speed": SPEEDS}, seeds=[0, 1], measures=["flocks"])
    assert table.complete
    assert [f["speed"] for f in table.failures] == [2.0, 2.0]
    assert table.failures[0]["message"] == "ValueError: no such speed"
    assert np.isnan(table.values("flocks")[2]).all()
    assert np.isfinite(table.values("flocks")[:2]).all()
    assert table.summary().failed.values.tolist() == [0, 0, 2]


def test_a_measure_that_fails_names_itself():
    table = run(measures={"odd": lambda run: run.q})
    assert table.failures[0]["message"].startswith("odd: sweep: measures['odd'] must give one number")


def test_measures_are_names_functions_or_both():
    def fastest(run):
        return np.float64(np.abs(run.p).max())

    assert run(measures=["order", fastest]).measures == ("order", "fastest")
    table = run(measures={"two": lambda run: run.n == 3, "spread": "velocity_spread"}, seeds=3)
    assert table.is_share("two")
    assert table.values("two").tolist() == [[1.0, 1.0, 1.0]]
    with pytest.raises(fk.InvalidInput, match="must have names"):
        run(measures=[lambda run: 1.0])
    with pytest.raises(fk.InvalidInput, match="Did you mean 'flocks'"):
        run(measures=["floks"])


def test_every_named_measure_measures(tmp_path):
    leader = fk.Track(fk.Velocity([1.0, 0.0]), velocity_gain=2.0)
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0), leader])
    start = fk.start.box(4, side=2.0, speed=1.0, seed=0)
    table = run(
        make=lambda seed: fk.Scenario(law, start, t_end=6.0, frames=61), measures=list(MEASURES), audit=True
    )  # fmt: skip
    row = table.rows[0]
    assert row["status"] == "ok", row["message"]
    assert set(row["values"]) == set(MEASURES)
    values = row["values"]
    assert values["flocks"] == 1
    assert values["density"] == 1.0
    assert values["connected"] is True
    assert values["following"] is True
    # Differences from the leader's velocity decay at least as fast as exp(-2 t): a hundredth after log(100)/2.
    assert values["following_time"] <= np.log(100) / 2 + 0.1
    assert values["energy_most"] >= values["energy"]
    assert row["verdicts"]["ledger"] == "holds"


def test_convergence_times_are_the_first_moment_after_which_it_stays_so():
    from types import SimpleNamespace

    from flocking.study.sweeps.measures import convergence_time

    def found(*spread):
        evidence = SimpleNamespace(
            spread_times=np.arange(len(spread)), velocity_spread=np.array(spread), spread_rounding=0.0,
            spread_error=0.0, spread_errors=np.zeros(len(spread)), need_end=lambda last, share: None,
        )  # fmt: skip
        return convergence_time(evidence)

    assert found(1.0, 0.5, 0.001, 0.001) == 2
    assert found(1.0, 0.001, 0.5, 0.001) == 3
    assert np.isnan(found(1.0, 0.001, 0.001, 0.5))
    assert found(0.0, 0.0) == 0


def test_the_same_call_again_makes_only_what_is_missing_whatever_the_number_of_workers(tmp_path):
    notes = tmp_path / "notes"
    notes.mkdir()
    arguments = {"make": noting(notes), "grid": {"speed": SPEEDS}, "seeds": 4, "out": tmp_path / "out"}
    first = run(**arguments)
    assert len(list(notes.iterdir())) == 12
    chunks = sorted((tmp_path / "out" / "rows").iterdir())
    assert len(chunks) > 1
    lost = [row for chunk in chunks[1:] for row in json.loads(json.loads(chunk.read_text())["body"])["rows"]]
    for chunk in chunks[1:]:
        chunk.unlink()
    again = run(**arguments, workers=2)
    assert len(list(notes.iterdir())) == 12 + len(lost)
    assert len({path.name.rsplit("-", 2)[1] for path in notes.iterdir()}) > 1
    assert np.array_equal(first.values("velocity_spread"), again.values("velocity_spread"))
    assert first.columns["seed"] == again.columns["seed"]
    assert run(**arguments).complete
    assert len(list(notes.iterdir())) == 12 + len(lost)
    stored = fk.read_sweep(tmp_path / "out")
    assert stored.complete
    assert stored.dataset.velocity_spread.equals(first.dataset.velocity_spread)


def test_another_sweep_in_the_folder_is_refused_with_every_difference(tmp_path):
    arguments = {"grid": {"speed": SPEEDS}, "seeds": 2, "measures": ["flocks"], "out": tmp_path / "out"}
    run(**arguments)
    with pytest.raises(StorageError) as caught:
        run(**{**arguments, "grid": {"sped": [1.0]}, "make": lambda sped, seed: make(sped, seed=seed), "seeds": 3})
    for text in ("plan.grid.speed: stored [0.5, 1.0, 2.0], asked for nothing", "plan.grid.sped: stored nothing",
                 "plan.seeds: stored 2, asked for 3", "make: stored"):  # fmt: skip
        assert text in str(caught.value)
    with pytest.raises(StorageError, match=r"measures.order: stored nothing"):
        run(**{**arguments, "measures": ["flocks", "order"]})
    with pytest.raises(StorageError, match=r"plan.seed: stored 0, asked for 1"):
        run(**arguments, seed=1)
    with pytest.raises(StorageError, match="audit"):
        run(**arguments, audit=True)


def test_the_order_of_the_grid_is_kept_and_another_order_is_another_sweep(tmp_path):
    arguments = {"seeds": [3, 4], "measures": ["velocity_spread", "flocks"], "out": tmp_path / "out"}
    table = run(grid={"speed": SPEEDS, "n": [2, 3]}, **arguments)
    stored = fk.read_sweep(tmp_path / "out")
    assert stored.dataset.velocity_spread.equals(table.dataset.velocity_spread)
    assert stored.measures == ("velocity_spread", "flocks")
    alone = run(grid={"speed": [2.0], "n": [3]}, seeds=[4], measures=["velocity_spread"])
    assert stored.dataset.velocity_spread.sel(speed=2.0, n=3, seed=4) == alone.values("velocity_spread")[0, 0]
    with pytest.raises(StorageError, match=r"plan.dimensions"):
        run(grid={"n": [2, 3], "speed": SPEEDS}, **arguments)


def test_a_changed_function_is_noticed_and_a_moved_one_is_not(tmp_path):
    from flocking.study.sweeps.recorded_content import code_of

    one, same, other = (eval(f"{' ' * k}lambda run: {value}") for k, value in ((0, 1.0), (0, 1.0), (0, 2.0)))
    assert code_of(one) == code_of(same) != code_of(other)

    def holding(x):
        return lambda run: x

    held = [holding(x) for x in (1, 1, 2)]
    assert code_of(held[0]) == code_of(held[1]) != code_of(held[2])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"grid": {"sped": [1.0]}}, "unexpected keyword argument 'sped'"),
        ({"grid": {"speed": []}}, "at least one value"),
        ({"grid": {"speed": 1.0}}, "must be a list of values"),
        ({"grid": {"speed": [1.0, 1.0]}}, "must not hold a value twice"),
        ({"grid": {"seed": [1]}}, "which the results use"),
        ({"grid": {"speed": [1.0]}, "sample": fk.Sample("latin", 2, {"speed": (0, 1)})}, "must not draw a parameter"),
        ({"seeds": 0}, "at least 1"),
        ({"seeds": []}, "at least one seed"),
        ({"seeds": [1, 1]}, "seed twice"),
        ({"seeds": "abc"}, "must be a number of runs"),
        ({"seeds": [-1]}, "at least 0"),
        ({"seeds": 200, "most_runs": 100}, "at most 100 runs"),
        ({"seeds": iter(int, 1), "most_runs": 100}, "at most 100 values"),
        ({"measures": [3]}, "must be names, or functions"),
        ({"measures": ["flocks", "flocks"]}, "different names"),
        ({"audit": 3}, "must be true or false"),
        ({"engine": "warp"}, "must be one of"),
        ({"make": 3}, "must be a function"),
        ({"workers": 0}, "at least 1"),
        ({"workers": 2, "cluster": "tcp://127.0.0.1:1"}, "must be left out with a cluster"),
    ],
)
def test_what_is_asked_wrongly_is_refused_before_any_run(arguments, message):
    with pytest.raises(fk.InvalidInput, match=message):
        run(**{"workers": 1, **arguments})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("sobl", 4, {"a": (0, 1)}), "must be one of random"),
        (("sobol", 0, {"a": (0, 1)}), "at least 1"),
        (("sobol", 4, {}), "at least one parameter"),
        (("sobol", 4, {"a": (1, 0)}), "lower end first"),
        (("sobol", 4, {"a": 3}), "lowest and a highest"),
        (("sobol", 4, {"a": (0, 1)}, ["a"]), "above 0"),
        (("sobol", 4, {"a": (0, 1)}, ["b"]), "must be among a"),
    ],
)
def test_samples_that_make_no_sense_are_refused(arguments, message):
    with pytest.raises(fk.InvalidInput, match=message):
        fk.Sample(*arguments)


def test_ctrl_c_keeps_what_was_finished(tmp_path):
    def interrupting(speed, seed):
        if speed == 2.0 and seed == 1:
            raise KeyboardInterrupt
        return make(speed, seed=seed)

    table = run(make=interrupting, grid={"speed": SPEEDS}, seeds=[0, 1], out=tmp_path / "out", measures=["flocks"])
    assert table.status == "interrupted"
    assert not table.complete
    kept = len(table)
    assert 1 <= kept <= 5
    assert len(fk.read_sweep(tmp_path / "out")) == kept
    assert (table.dataset.status == "missing").sum() == 6 - kept


def test_two_writers_never_share_a_folder(tmp_path):
    inside, message = threading.Event(), []
    go_on = threading.Event()

    def waiting(seed):
        inside.set()
        go_on.wait(20)
        return make(seed=seed)

    first = threading.Thread(target=lambda: run(make=waiting, out=tmp_path / "out"))
    first.start()
    assert inside.wait(20)
    with pytest.raises(StorageError, match="another process is writing"):
        run(make=waiting, out=tmp_path / "out")
    go_on.set()
    first.join(20)
    assert message == []
    assert fk.read_sweep(tmp_path / "out").complete


def test_results_open_as_parquet_csv_and_dataset(tmp_path):
    from pyarrow import parquet

    table = run(
        make=make_or_fail, grid={"speed": SPEEDS}, seeds=[0, 1], measures={"flocks": "flocks", "ok": lambda run: True},
        audit=True,
    )  # fmt: skip
    found = parquet.read_table(table.to_parquet(tmp_path / "runs.parquet"))
    assert found.column("speed").to_pylist() == [0.5, 0.5, 1.0, 1.0, 2.0, 2.0]
    assert found.column("ok").to_pylist() == [True, True, True, True, None, None]
    assert found.column("claim_ledger").to_pylist() == ["holds"] * 4 + [None] * 2
    assert b"flocking" in found.schema.metadata
    lines = table.to_csv(tmp_path / "runs.csv").read_text().splitlines()
    assert len(lines) == 7
    assert lines[0].startswith("run,speed,seed,status,message,seconds,tries,flocks,ok,claim_")
    table.dataset.to_zarr(tmp_path / "runs.zarr")
    import xarray

    with xarray.open_zarr(tmp_path / "runs.zarr") as again:
        assert again.flocks.equals(table.dataset.flocks)
    assert (table.dataset["claim_ledger"].sel(speed=0.5) == "holds").all()


def test_values_that_are_not_numbers_label_their_axis():
    boxes = [((0, 1), 2), ((0, 2), 3)]
    table = run(make=lambda box, seed: make(seed=seed), grid={"box": boxes}, measures=["flocks"])
    assert list(table.dataset.box.values) == ["[[0, 1], 2]", "[[0, 2], 3]"]


def test_the_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(StorageError, match="holds other files already"):
        run(out=tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError):
        run(out=tmp_path / "file")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "thesis.tex"]


def test_a_full_disk_is_told_and_what_was_committed_stays(tmp_path, monkeypatch):
    import errno

    from flocking.engine.storage import atomic_files

    arguments = {"grid": {"speed": SPEEDS}, "seeds": range(4), "out": tmp_path / "out", "measures": ["flocks"]}
    put, calls = atomic_files.put, []

    def filling(path, data, **options):
        calls.append(path)
        if len(calls) > 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        put(path, data, **options)

    monkeypatch.setattr(atomic_files, "put", filling)
    with pytest.raises(StorageError, match="no space left"):
        run(**arguments)
    kept = len(fk.read_sweep(tmp_path / "out"))
    assert 1 <= kept < 12
    monkeypatch.setattr(atomic_files, "put", put)
    assert run(**arguments).complete
