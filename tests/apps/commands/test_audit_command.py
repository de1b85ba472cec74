"""`flocking audit` on files of samples."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.apps.commands import audit_command
from flocking.study.sample_files.samples import Samples

LAW = """format = 1
[graph]
kind = "proximity"
radius = 4.0
[[terms]]
kind = "consensus"
gain = 1.0
"""


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    law = fk.Law(fk.Proximity(4.0), [fk.Consensus(1.0)])
    begin = fk.start.box(4, side=1.0, speed=1.0, seed=1)
    run = fk.simulate(fk.Scenario(law, begin, t_end=2.0, frames=201), progress=False)
    lines = ["time,bird,East,North"]
    for t, q in zip(run.t, run.q, strict=True):
        lines += [f"{float(t)!r},b{i},{float(x)!r},{float(y)!r}" for i, (x, y) in enumerate(q)]
    (folder / "birds.csv").write_text("\n".join(lines))
    (folder / "law.toml").write_text(LAW)
    (folder / "wrong.toml").write_text(LAW.replace("gain = 1.0", "gain = 2.0"))
    np.savez(folder / "birds.npz", t=run.t, q=run.q, p=run.p)
    return folder


COLUMNS = ["--column", "t=time", "-c", "id=bird", "-c", "x=East", "-c", "y=North"]


def test_a_law_is_held_against_a_table(place, capsys):
    assert main(["audit", str(place / "birds.csv"), *COLUMNS, "--law", str(place / "law.toml"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {c["claim"]: c["verdict"] for c in found["claims"]}["ledger"] == "holds"
    assert "estimated" in found["velocities"]
    assert "at most" in found["velocities"]


def test_a_false_law_fails_with_exit_code_1(place, capsys):
    assert main(["audit", str(place / "birds.csv"), *COLUMNS, "--law", str(place / "wrong.toml")]) == 1
    assert "fails" in capsys.readouterr().out
    assert main(["audit", str(place / "birds.npz"), "--law", str(place / "wrong.toml")]) == 1
    assert "taken as exact" in capsys.readouterr().out.replace("\n", " ")


def test_without_a_law_only_claims_that_need_none_are_judged(place, capsys):
    assert main(["audit", str(place / "birds.npz"), "--radius", "4", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {c["claim"] for c in found["claims"]} == {
        "mean-velocity", "velocities-agree", "distances-settle", "apart", "connected", "neighbours-kept",
    }  # fmt: skip
    assert found["law"].startswith("none declared")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["birds.csv"], "--column t=NAME"),
        (["none.csv"], "folder of a saved run, or a file that ends in .csv"),
        (["law.toml"], "folder of a saved run, or a file that ends in .csv"),
        (["birds.npz", "--column", "t"], "must be t=NAME"),
        (["birds.npz", "--time-step", "1"], "time_step"),
        ([".", "--radius", "1"], "must be absent for a saved run"),
    ],
)
def test_wrong_input_is_one_sentence(place, capsys, monkeypatch, words, message):
    monkeypatch.chdir(place)
    assert main(["audit", *words]) == 2
    shown = capsys.readouterr().err
    assert message in shown
    assert shown.count("\n") == 1


def test_a_law_of_a_paper_is_that_of_the_paper_whatever_lies_in_the_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "zhou-2015").mkdir()
    samples = Samples(np.array([0.0, 1.0]), np.zeros((2, 1, 2)), None, ("0",))
    assert audit_command._law("zhou-2015", samples)[0].name == "zhou-2015"


def test_columns_that_are_not_read_are_named(tmp_path, capsys):
    table = ["t,id,x,y,v_x,\x1b[31mv_y", *(f"{t},{i},{i},{t},0,1" for t in range(9) for i in range(2))]
    (tmp_path / "a.csv").write_text("\n".join(table))
    np.savez(tmp_path / "a.npz", t=np.arange(9.0), q=np.arange(36.0).reshape(9, 2, 2), velocities=np.ones((9, 2, 2)))
    for name, left in (("a.csv", ["v_x", "x1b[31mv_y"]), ("a.npz", ["velocities"])):
        assert main(["audit", str(tmp_path / name)]) in (0, 1)
        printed = capsys.readouterr().out
        assert "not read" in printed
        assert "\x1b" not in printed
        assert main(["audit", str(tmp_path / name), "--json"]) in (0, 1)
        found = json.loads(capsys.readouterr().out)["not read"]
        assert all(part in found for part in left)


def test_of_files_that_are_read_whole_nothing_is_left(place, capsys):
    for name, options in (("birds.csv", COLUMNS), ("birds.npz", [])):
        main(["audit", str(place / name), *options])
        assert "not read" not in capsys.readouterr().out


def test_what_agents_used_is_computed_again(tmp_path, capsys):
    law = fk.Law(fk.Proximity(4.0), [fk.Consensus(1.0)])
    begin = fk.start.box(4, side=1.0, speed=1.0, seed=1)
    world = {"control": fk.Held(0.1), "information": fk.Messages(0.1, delay=0.05, loss=0.2)}
    run = fk.simulate(fk.Scenario(law, begin, t_end=1.0, frames=3, **world), progress=False)
    fk.write_run(run, tmp_path / "right")
    code = main(["audit", str(tmp_path / "right")])
    assert "acts" not in capsys.readouterr().out
    assert main(["audit", str(tmp_path / "right"), "--replay"]) == code
    assert "40 acts with 120 entries computed again: all as declared" in capsys.readouterr().out
    uses = run.log.uses.copy()
    uses[20, 2] += 1
    wrong = dataclasses.replace(run, log=dataclasses.replace(run.log, uses=uses))
    fk.write_run(wrong, tmp_path / "wrong")
    assert main(["audit", str(tmp_path / "wrong"), "--json", "--replay"]) == 1
    assert json.loads(capsys.readouterr().out)["replay"]["wrong"][0]["entry"] == 20
    assert main(["audit", str(tmp_path / "data.csv"), "--replay"]) == 2
    assert "Only saved runs have a log" in capsys.readouterr().err


def test_of_samples_without_a_law_nothing_is_expected_and_no_paper_is_named(tmp_path, capsys):
    t = np.linspace(0.0, 2.0, 21)
    rows = [f"{time},{agent},{time * (agent + time)},0" for time in t for agent in (1, 2)]
    file = tmp_path / "apart.csv"
    file.write_text("\n".join(["t,id,x,y", *rows]))
    main(["audit", str(file), "--json"])
    found = json.loads(capsys.readouterr().out)
    assert found["as_expected"] is True
    assert {claim["origin"] for claim in found["claims"]} == {"own question"}
    assert {claim["expected"] for claim in found["claims"]} == {"observation"}
    assert any(claim["verdict"] == "fails" for claim in found["claims"])
    for words in (("run",), ("plot",), ("animate",), ("certify",)):
        assert main([*words, str(file)]) == 2
        assert "'flocking audit'" in capsys.readouterr().err


def test_a_claim_that_is_asked_of_any_law_is_stated_by_no_paper():
    from flocking.study.claims.claim import Result, Verdict
    from flocking.study.claims.general_claims import GENERAL

    assert {Result(claim, Verdict.HOLDS).as_dict()["origin"] for claim in GENERAL} == {"asked of any law"}
