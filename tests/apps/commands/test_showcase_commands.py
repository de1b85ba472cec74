"""The showcase command: what it writes and says; its scenarios run by name."""

import json

import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.apps.scenario_names import find_scenario
from flocking.papers.showcases.files import TITLES
from flocking.papers.showcases.shipped import showcase
from flocking.papers.showcases.stored_summary import StoredSummary


def test_unknown_showcases_and_bad_sizes_are_bad_input(capsys):
    assert main(["showcase", "obstacle-feild"]) == 2
    assert "Did you mean 'obstacle-field'?" in capsys.readouterr().err
    assert main(["showcase", "obstacle-field", "--agents", "0"]) == 2
    assert "agents must be from 1 to 100000" in capsys.readouterr().err
    assert main(["showcase", "obstacle-field", "--agents", "9", "--until", "-1"]) == 2
    assert "until must be after 0" in capsys.readouterr().err


def test_showcases_are_scenarios_by_name(capsys):
    assert main(["list", "--json"]) == 0
    listed = {row["scenario"] for row in json.loads(capsys.readouterr().out)}
    assert set(TITLES) <= listed
    for name in TITLES:
        made = find_scenario(name, None, None)
        assert made.name == name
        assert (find_scenario(name, 5, None).start.q[0] != made.start.q[0]).all()


def test_a_run_of_another_start_or_engine_is_not_passed_off_as_the_one_that_is_asked_for(tmp_path, capsys):
    chosen = showcase("flock-from-noise")
    small = {"agents": 60, "until": 0.1}
    scenario = chosen.scenario(**small)
    run = chosen.run(tmp_path / "out" / "run", scenario, progress=False, threads=1)
    again = chosen.run(tmp_path / "out" / "run", chosen.scenario(**small), progress=False)
    assert (again.q == run.q).all()
    for other in (chosen.scenario(seed=1, **small), chosen.scenario(agents=60, until=0.05)):
        with pytest.raises(fk.InvalidInput, match="must not contain another run; got 'flock-from-noise with 60 agents"):
            chosen.run(tmp_path / "out" / "run", other, progress=False)
    words = ["showcase", "flock-from-noise", "--agents", "60", "--until", "0.1", "--out", str(tmp_path / "out")]
    assert main([*words, "--engine", "lammps"]) == 2
    assert "until 0.1, by tiles" in capsys.readouterr().err


@pytest.mark.slow
def test_a_small_one_is_run_audited_drawn_and_gone_on_with(capsys, tmp_path):
    words = ["showcase", "flock-from-noise", "--agents", "500", "--until", "6", "--out", str(tmp_path / "out")]
    assert main([*words, "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    assert first["agents"] == 500
    assert first["times"] == [0.0, 5.0, 6.0]
    assert first["audit"]["ledger"][0] == "holds"
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"run", "audit.json", "flock-from-noise.npz", "flock-from-noise.png"}
    assert StoredSummary.read(tmp_path / "out" / "flock-from-noise.npz").facts["hexatic"] == first["hexatic"]
    assert {c["claim"] for c in json.loads((tmp_path / "out" / "audit.json").read_text())["claims"]} >= {"ledger"}
    assert main(words) == 0
    assert "hexatic order" in capsys.readouterr().out
