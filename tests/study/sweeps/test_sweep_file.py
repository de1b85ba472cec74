"""Sweep files: every fault at once, limits, and files that mean harm."""

import time

import numpy as np
import pytest

import flocking as fk
from flocking.model.drawn_during_runs import with_seed_of_run
from flocking.papers.studies.running import run_file
from flocking.papers.studies.shipped import STUDIES, study
from flocking.papers.sweep_scenarios import sweep_scenarios
from flocking.study.sweeps import sweep_file
from flocking.study.sweeps.measures import MEASURES
from flocking.study.sweeps.parametrised_scenarios import path_steps
from flocking.study.sweeps.sweep_file import SweepFileError, parse_sweep, read_sweep_file

FAMILIES = sweep_scenarios()

OF_A_PAPER = """
scenario = "zhou-2015"
seeds = 3
seed = 5
measures = ["connected", "certified_closest"]
audit = true
[options]
duration = 0.5
[grid]
side = [4.0, 6]
gain = {low = 0.1, high = 10.0, count = 3, log = true}
"""

WRITTEN = """
name = "gains"
measures = ["velocity_spread"]
seeds = [1, 2]
[scenario]
t_end = 0.2
frames = 2
terms = [{kind = "consensus", gain = 1.0}]
graph = {kind = "proximity", radius = 3.0}
start = {draw = "box", n = 4, side = 2.0, speed = 1.0, seed = 0}
[grid]
"terms[0].gain" = [0.5, 2.0]
[sample]
method = "sobol"
count = 4
[sample.ranges]
"start.n" = {low = 2, high = 5}
"""


def test_a_file_about_a_papers_scenario_runs_as_it_says():
    file = parse_sweep(OF_A_PAPER, FAMILIES, name="zhou")
    assert file.name == "zhou"
    assert file.plan.grid["side"] == (4.0, 6.0)
    assert file.plan.grid["gain"] == pytest.approx((0.1, 1.0, 10.0))
    assert file.plan.size == 18
    task = file.plan.task(17)
    made = file.make(**task.parameters, seed=task.seed)
    own = fk.papers.zhou_2015.scenario(side=6.0, gain=10.0, duration=0.5, seed=task.seed)
    assert np.array_equal(made.start.q, own.start.q)
    assert made.law == own.law
    assert made.t_end == 0.5


def test_a_scenario_written_in_the_file_varies_at_the_paths(tmp_path):
    path = tmp_path / "gains.toml"
    path.write_text(WRITTEN)
    file = read_sweep_file(path, FAMILIES)
    table = run_file(file, workers=1, progress=False)
    assert table.failures == []
    assert table.dataset.velocity_spread.shape == (2, 4, 2)
    made = file.make(**{"terms[0].gain": 2.0, "start.n": 3}, seed=7)
    assert made.start.n == 3
    assert np.array_equal(made.start.q, fk.start.box(3, side=2.0, speed=1.0, seed=7).q)
    assert made.law.terms[0].gain == 2.0
    # A larger gain aligns sooner.
    low, high = table.dataset.velocity_spread.mean(["sample", "seed"]).values
    assert high < low


FAULTY = """
nam = "x"
scenario = "zhou-2015"
seeds = 0
seed = -1
audit = "yes"
engine = "warp"
measures = ["conected", "flocks", "flocks", 3]
[options]
side = 1.0
lenght = 2
duration = "long"
[grid]
side = [4.0, -1.0]
gian = [1.0]
gain = {low = 2.0, high = 1.0, count = 2}
duration = "x"
[sample]
method = "sobl"
count = 2.5
[sample.ranges]
gain = {low = 0.0, high = 1.0, logg = true}
"""

FAULTS = """
nam: is not known here. Did you mean 'name'?
seeds: must be at least 1; got 0
seed: must be from 0 to 9223372036854775807; got -1
audit: must be true or false; got 'yes'
engine: must be 'auto', 'exact', 'tiles', 'sampled', 'delayed', 'discrete' or 'lammps'; got 'warp'
measures[3]: must be text in quotes; got 3
options.side: must not be fixed and vary at once
options.lenght: is no option of this family
options.duration: must be a number; got 'long'
grid.side[1]: must be from 0.5 to 100; got -1.0
grid.gian: is no option of this family. Did you mean 'gain'?
grid.gain: must have low below high
grid.duration: must be a list or a table; got 'x'
sample.method: must be 'random', 'latin' or 'sobol'; got 'sobl'
sample.count: must be an integer; got 2.5
sample.ranges.gain.logg: is not known here. Did you mean 'log'?
"""


def test_every_fault_is_named_at_once_with_its_place():
    with pytest.raises(SweepFileError) as caught:
        parse_sweep(FAULTY, FAMILIES, source="faulty.toml")
    found = [line.strip() for line in str(caught.value).splitlines()]
    expected = FAULTS.strip().splitlines()
    assert found[0] == f"faulty.toml: {len(expected)} faults in the sweep"
    for line in expected:
        assert any(text.startswith(line) for text in found[1:]), (line, found)
    assert len(found) == 1 + len(expected)


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ('"zhou-2015"', '"zhou-2016"',
         "scenario: must be a family of scenarios; got 'zhou-2016'. Did you mean 'zhou-2015'?"),
        ('"zhou-2015"', "3", "scenario: must be text in quotes or a table"),
        ('scenario = "zhou-2015"', "", "scenario: must be given"),
        ("seeds = 3", "seeds = [1, 1]", "seeds: must not hold a seed twice"),
        ("seeds = 3", "seeds = 20000", "grid: must make at most 100000 runs; got 120000. Pass most_runs=120000"),
        ("seeds = 3", "seeds = 9" + "9" * 30, "grid: must make at most 100000 runs"),
        ("side = [4.0, 6]", "side = []", "grid.side: "),
        ("side = [4.0, 6]", "side = [4.0, 4.0]", "grid.side: must not hold a value twice"),
        ("side = [4.0, 6]", "side = [nan]", "grid.side[0]: must be from 0.5 to 100; got nan"),
        ("side = [4.0, 6]", "side = [true]", "grid.side[0]: must be a number; got True"),
        ("count = 3", "count = 1000000", "grid.gain.count: must be from 2 to 10000"),
        ("low = 0.1", "low = inf", "grid.gain.low: must be finite"),
        ("low = 0.1", "low = -1.0", "grid.gain: must have low below high, and above 0 where log is true"),
        ('"connected", ', '"conected", ', "measures[0]: is not known; got 'conected'. Did you mean 'connected'?"),
        ('"connected", ', '"connected", "connected", ', "measures[1]: must not be named twice"),
        ("audit = true", 'audit = true\nname = "../../etc"', "name: must be letters, digits, - and _"),
        ("audit = true", "audit = true\nformat = 2", "format: must be 1"),
        ("[grid]", "[grid]\nseed = [1]", "grid.seed: is no option of this family"),
        ("seeds = 3", "seeds = 3\n[[", "file: is not TOML"),
    ],
)  # fmt: skip
def test_single_faults(old, new, place):
    assert old in OF_A_PAPER
    message = refusal(OF_A_PAPER.replace(old, new, 1))
    assert message is not None
    assert place in message, message


@pytest.mark.parametrize(
    ("old", "new", "place"),
    [
        ("gain = 1.0", "gian = 1.0", "scenario.terms[0].gian: is not known here"),
        ("terms[0].gain", "terms[1].gain", "grid.terms[1].gain: must be the path of a value in [scenario]"),
        ("terms[0].gain", "terms[0].gian", "grid.terms[0].gian[0]: scenario.terms[0].gian: is not known here"),
        ("terms[0].gain", "terms[0]..gain", "must be the path of a value, such as terms[1].gain"),
        ("[0.5, 2.0]", '[0.5, "x"]', "grid.terms[0].gain[1]: scenario.terms[0].gain: must be a number"),
        ("[0.5, 2.0]", "[0.5, nan]", "grid.terms[0].gain[1]: must be finite"),
        ("high = 5", "high = 2000000", "scenario.start.n: must be at most 1000000 agents"),
        ("seeds = [1, 2]", "options = {a = 1}", "options: is for families of scenarios"),
        ('draw = "box", n = 4, side = 2.0, speed = 1.0, seed = 0', "q = [[0.0, 0.0], [1.0, 0.0]]",
         "seeds: must be left out: nothing in [scenario] is drawn at random"),
    ],
)  # fmt: skip
def test_faults_of_a_scenario_in_the_file(old, new, place):
    assert old in WRITTEN
    message = refusal(WRITTEN.replace(old, new, 1))
    assert message is not None
    assert place in message, message


@pytest.mark.parametrize("later", ['"terms" = [[{kind = "consensus", gain = 3.0}]]', '"terms[00].gain" = [3.0]',
                                   '"terms[0]" = [{kind = "consensus", gain = 3.0}]'])  # fmt: skip
def test_a_path_that_replaces_another_one_is_refused(later):
    """The table would name values that no run had."""
    path, value = later.split(" = ", 1)
    message = refusal(WRITTEN.replace("[0.5, 2.0]", f"[0.5, 2.0]\n{later}"))
    assert message is not None
    assert f"{path.strip(chr(34))}: must not replace terms[0].gain" in message
    before = WRITTEN.replace('"terms[0].gain"', f'{path} = {value}\n"terms[0].gain"')
    assert ("must not replace" in str(refusal(before))) == ("00" in path)


def test_limits_give_way_to_an_explicit_word():
    text = OF_A_PAPER.replace("seeds = 3", "seeds = 20000")
    assert parse_sweep(text, FAMILIES, most_runs=120_000).plan.size == 120_000
    many = WRITTEN.replace("high = 5", "high = 20")
    assert "at most 10 agents" in str(refusal(many, most_agents=10))
    assert refusal(many, most_agents=20) is None


def test_paths_are_read_and_everything_else_is_refused():
    assert path_steps("terms[1].gain") == ("terms", 1, "gain")
    assert path_steps("graphs.far.radius") == ("graphs", "far", "radius")
    for odd in ("", ".a", "a.", "a[", "a[-1]", "a[1]b", "[1]", "a b", "a..b", "a" * 300, ".".join("a" * 30)):
        with pytest.raises(ValueError, match="path of a value"):
            path_steps(odd)


def test_files_that_cannot_be_read_are_told(tmp_path):
    (tmp_path / "large.toml").write_text("#" * (2**20 + 1))
    (tmp_path / "latin.toml").write_bytes(b'name = "\xff"')
    for name in ("large.toml", "latin.toml", "absent.toml", ".", "a\0b"):
        with pytest.raises(fk.InvalidInput):
            read_sweep_file(tmp_path / name, FAMILIES)


@pytest.mark.parametrize("name", STUDIES)
def test_every_shipped_study_is_a_sound_sweep(name):
    """Its first point runs, and each of its measures measures."""
    file = study(name).plan()
    assert file.name == name
    if name == "tanner-connectivity":
        assert file.plan.size == 1000
    task = file.plan.task(0)
    made = file.make(**task.parameters, seed=task.seed)
    assert made.name.startswith(name.split("-")[0])
    assert {*file.measures} <= {*MEASURES, *file.more_measures}


def test_an_unknown_study_is_told():
    with pytest.raises(fk.InvalidInput, match="Did you mean 'zhou-bound'"):
        study("zhou-bond")


def refusal(text, **limits):
    """The message of a file that is refused; anything but a refusal goes through."""
    try:
        file = parse_sweep(text, FAMILIES, **limits)
    except SweepFileError as error:
        return str(error)
    assert 1 <= file.plan.size <= limits.get("most_runs", 100_000)
    assert file.measures
    return None


def test_a_file_with_endless_faults_is_refused_soon_and_briefly():
    begin = time.monotonic()
    axes = "\n".join(f"a{k} = {{low = -5.0, high = -1.0, count = 10000}}" for k in range(50))
    message = refusal(f'scenario = "zhou-2015"\n[grid]\n{axes}\n')
    assert message.startswith("sweep: 50 faults")
    assert "grid.a49: is no option of this family" in message
    values = ", ".join(str(-k) for k in range(1, 9001))
    message = refusal(f'scenario = "zhou-2015"\n[grid]\nside = [{values}]\n')
    assert message.startswith("sweep: 9000 faults")
    assert message.endswith("... and 8800 more")
    assert len(message) < 20_000
    names = ", ".join(f'"x{k}"' for k in range(50))
    message = refusal(f'scenario = "zhou-2015"\nmeasures = [{names}]\n')
    assert "measures[49]: is not known" in message
    assert message.count("Known here") == 1
    assert time.monotonic() - begin < 20


def test_the_ends_of_a_spaced_axis_are_checked():
    message = refusal(OF_A_PAPER.replace("high = 10.0", "high = 1e9"))
    assert "grid.gain.high: must be from 0 to 1000; got 1000000000.0" in message


def test_a_fault_that_does_not_vary_is_told_once_and_trying_ends(monkeypatch):
    wrong = WRITTEN.replace("[0.5, 2.0]", "[0.5, 1.0, 2.0, 4.0]").replace("speed = 1.0", 'speed = "fast"')
    assert refusal(wrong).count("scenario.start.speed") == 1
    late = WRITTEN.replace("[0.5, 2.0]", '[0.5, "x"]')
    assert "must be a number" in refusal(late)
    monkeypatch.setattr(sweep_file, "TRYING_SECONDS", 0.0)
    # What there was no time to try is met when its run is made.
    assert refusal(late) is None
    assert "must be a number" in refusal(WRITTEN.replace("[0.5, 2.0]", '["x", 0.5]'))


SEEDED = """
seeds = [3, 4]
measures = ["velocity_spread"]
[scenario]
t_end = 0.2
frames = 2
terms = [{kind = "consensus", gain = 1.0}]
graph = {kind = "proximity", radius = 3.0}
control = {kind = "held", period = 0.1}
information = {kind = "messages", period = 0.1, loss = 0.3, seed = 5}
agents = {kind = "disturbed", body = {kind = "point-mass"}, sigma = 0.1, period = 0.1}
start = {q = [[0.0, 0.0], [1.0, 0.0]], p = [[0.0, 0.0], [0.0, 1.0]]}
[grid]
"terms[0].gain" = [0.5, 2.0]
"""


def test_a_seed_draws_whatever_is_random_in_the_scenario():
    """Losses and gusts too: runs of different seeds are independent, as intervals suppose."""
    file = parse_sweep(SEEDED, FAMILIES)
    for seed in (3, 4):
        made = file.make(**{"terms[0].gain": 2.0}, seed=seed)
        assert (made.information.seed, made.agents.seed, made.seed) == (seed, seed, seed)
    assert file.record["seeded"] == ["agents.seed", "information.seed"]
    assert "seeded" not in parse_sweep(WRITTEN, FAMILIES).record  # Folders of earlier versions go on.


def test_gusts_within_gusts_are_drawn_apart():
    """With one seed both would draw the same numbers, which add up along one line and not as squares."""
    inner = '{kind = "disturbed", body = {kind = "point-mass"}, sigma = 0.1, period = 0.1}'
    body = f'{{kind = "lagged", time_constant = 0.1, body = {inner}}}'
    text = SEEDED.replace('body = {kind = "point-mass"}', f"body = {body}", 1)
    file = parse_sweep(text, FAMILIES)
    made = [file.make(**{"terms[0].gain": 2.0}, seed=seed) for seed in (0, 3, 2**63 - 1)]
    seeds = [(each.agents.seed, each.agents.body.body.seed, each.information.seed) for each in made]
    assert [(outer, heard) for outer, _, heard in seeds] == [(0, 0), (3, 3), (2**63 - 1, 2**63 - 1)]
    for each, (_, within, _) in zip(made, seeds, strict=True):
        assert within == with_seed_of_run(each, each.seed).agents.body.body.seed
    assert len({seed for outer, within, _ in seeds for seed in (outer, within)}) == 6
    assert file.record["nested"] == {"agents.body.body.seed": 1}
    assert "nested" not in parse_sweep(SEEDED, FAMILIES).record


def test_a_seed_that_is_varied_stays_what_the_axis_says():
    text = WRITTEN.replace('"terms[0].gain" = [0.5, 2.0]', '"start.seed" = [11, 12]')
    text = text.replace(
        "speed = 1.0, seed = 0}", 'speed = 1.0, seed = 0}\ninformation = {kind = "messages", period = 0.1, loss = 0.3}'
    )
    file = parse_sweep(text, FAMILIES)
    made = file.make(**{"start.seed": 12, "start.n": 3}, seed=7)
    assert np.array_equal(made.start.q, fk.start.box(3, side=2.0, speed=1.0, seed=12).q)
    assert made.information.seed == 7
    assert file.record["seeded"] == ["information.seed"]


def test_seeds_of_runs_are_refused_where_no_part_takes_them():
    text = WRITTEN.replace('"terms[0].gain" = [0.5, 2.0]', '"start.seed" = [11, 12]')
    with pytest.raises(SweepFileError, match=r"seeds: must be left out: every seed in \[scenario\] is varied"):
        parse_sweep(text, FAMILIES)


OTHER_VALUES = {
    "speed": (1.0, 2.0), "complete": (False, True), "start_radius": (1.5, 2.5), "side": (4.0, 6.0), "gain": (1.0, 2.0),
    "duration": (10.0, 20.0), "length": (100.0, 200.0), "tracking": ("agent", "shared"), "tracking_gain": (1.0, 2.0),
    "gamma_agents": (True, False), "agents": (20, 30), "informed": (3, 5), "compact": (False, True),
}  # fmt: skip


@pytest.mark.parametrize("family", FAMILIES)
def test_every_option_of_a_family_changes_its_scenario(family):
    """An axis that changes nothing would be a table of equal rows with different names."""
    from flocking.study.sweeps.equal_scenarios import run_digest

    made = FAMILIES[family]
    for option in made.options:
        one, other = (run_digest(made.make(seed=1, **{option: value})) for value in OTHER_VALUES[option])
        assert "" != one != other, option
