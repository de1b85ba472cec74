"""Sweeps that go on with another plan: what was stored belongs to other parameters, and is refused."""

import pytest

import flocking as fk
from flocking.errors import StorageError
from flocking.study.claims.claim import Claim, below
from tests.study.sweeps.sweep_cases import make


def run(folder, made=make, **options):
    given = {"measures": {"agents": lambda run: run.n}, "workers": 1, "progress": False, **options}
    return fk.sweep(made, out=folder / "out", **given)


def drawn(ranges, **options):
    return {"sample": fk.Sample("random", 4, ranges, **options)}


PAIRS = {
    "ranges of integers and of floats": (drawn({"speed": (1, 3)}), drawn({"speed": (1.0, 3.0)})),
    "the order of ranges": (drawn({"n": (2, 9), "speed": (1.0, 3.0)}), drawn({"speed": (1.0, 3.0), "n": (2, 9)})),
    "truth values and numbers": ({"grid": {"speed": [True, 2]}}, {"grid": {"speed": [1, 2]}}),
    "integers and floats": ({"grid": {"n": [2, 3]}}, {"grid": {"n": [2.0, 3.0]}}),
    "signs of zero": ({"grid": {"speed": [0.0, 1.0]}}, {"grid": {"speed": [-0.0, 1.0]}}),
}  # fmt: skip


@pytest.mark.parametrize("kind", PAIRS)
def test_another_plan_whose_numbers_compare_equal_is_another_sweep(kind, tmp_path):
    one, other = PAIRS[kind]
    found = run(tmp_path, **one)
    assert run(tmp_path, **one).columns == found.columns
    with pytest.raises(StorageError, match=r"holds another sweep.*\n.*plan\."):
        run(tmp_path, **other)


def test_a_value_that_is_not_equal_to_itself_is_the_same_value(tmp_path):
    given = {"made": lambda gap, seed: make(seed=seed), "grid": {"gap": [float("nan"), 1.0]}}
    assert len(run(tmp_path, **given)) == len(run(tmp_path, **given)) == 2


def claim(size):
    return Claim("slow", "own question", "It is slow.", lambda e: below(size, 2.0, f"it is {size:g}"))


def test_another_conclusion_under_the_key_of_a_claim_is_another_audit(tmp_path):
    first = run(tmp_path, seeds=[0], audit=[claim(1.0)])
    assert first.columns["claim_slow"] == run(tmp_path, seeds=[0], audit=[claim(1.0)]).columns["claim_slow"]
    with pytest.raises(StorageError, match="audit"):
        run(tmp_path, seeds=[0], audit=[claim(3.0)])


@pytest.mark.parametrize("method", ["random", "latin", "sobol"])
def test_points_that_other_versions_drew_are_not_passed_off_as_those_of_the_rows(method, tmp_path, monkeypatch):
    given = {"sample": fk.Sample(method, 20, {"speed": (0.1, 3.0), "n": (2, 9)}, log=["speed"]), "measures": {}}
    points = given["sample"].points()
    run(tmp_path, **given)
    assert fk.read_sweep(tmp_path / "out").plan.drawn == points
    nearly = {name: tuple(x * (1 + 1e-14) for x in column) for name, column in points.items()}
    monkeypatch.setattr(fk.Sample, "points", lambda self: nearly)
    assert len(fk.read_sweep(tmp_path / "out")) == len(run(tmp_path, **given)) == 20
    other = {name: column[1:] + column[:1] for name, column in points.items()}
    monkeypatch.setattr(fk.Sample, "points", lambda self: other)
    for again in (lambda: fk.read_sweep(tmp_path / "out"), lambda: run(tmp_path, **given)):
        with pytest.raises(StorageError, match="points were drawn by other versions"):
            again()
