"""Margins: closed forms found by the search, islands, intervals, resumption, and refusals."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binomtest

import flocking as fk
from flocking.apps.cli import main
from flocking.model.world.losses import Bernoulli
from flocking.show.contents import contents
from flocking.show.margin_pictures import margins_figure, place_of
from flocking.study.certificates.beside.margin_lines import MarginLine, common_lines, margin_lines
from flocking.study.claims.claim import Claim, Measure, below
from flocking.study.claims.conclusions.limits import positions_agree, velocities_agree
from flocking.study.evidence import NotResolvable
from flocking.study.margins.brackets import Bracket, Count, between, bracket, islands, open_everywhere, open_from_ideal
from flocking.study.margins.margin_table import Margins, Varied, margins_from
from flocking.study.margins.quantities import Quantity, register_quantity
from flocking.study.sweeps.worker_pool import pool

AGREE = Claim("agree", "here", "All positions become the same.", positions_agree)
SAME = Claim("same", "here", "All velocities become the same.", velocities_agree)


def consensus(period=None, *, t_end=80.0, **messages):
    """Four first-order agents on a line that all see each other: the largest eigenvalue is 4."""
    q = np.random.default_rng(0).normal(size=(4, 1))
    law = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("r**2/2"))])
    world = {"control": fk.Held(period)} if period else {}
    world |= {"information": fk.Messages(period, **messages)} if messages else {}
    return fk.Scenario(law, fk.State(q - q.mean()), t_end=t_end, frames=81, agents=fk.SingleIntegrator(), **world)


def found(scenario, vary, claims=(AGREE,), **options):
    options = {"workers": 1, "progress": False, "seeds": 2, "width": 0.1, **options}
    return fk.margins(scenario, vary, claims=claims, **options)


def test_the_period_of_first_order_consensus_is_bracketed():
    """T lambda_N < 2."""
    margin = found(consensus(), "period", levels={"period": [0.2, 0.8]}).margin("period", "agree")
    assert margin.bracket.lower < 0.5 <= margin.bracket.upper
    assert margin.bracket.width <= 0.1
    assert margin.counts[margin.bracket.lower] == Count(1, 0, 0)  # nothing is random: one run


def test_messages_under_continuous_control_stay_what_they_are():
    """Agents that know themselves bear every period and delay; held forces of a period would not (T lambda_N < 2)."""
    heard = consensus(t_end=20.0).with_(information=fk.Messages(0.2))
    margins = found(heard, ["period", "loss"], levels={"period": [1.0], "loss": [0.5]})
    assert margins.varied[0].world == "messages every 1"
    for name in ("period", "loss"):
        assert margins.margin(name, "agree").bracket.upper is None


def test_the_delay_of_delayed_consensus_is_bracketed():
    """tau lambda_N < pi/2 with everybody delayed (Olfati-Saber and Murray 2004); control stays continuous."""
    late = consensus(t_end=60.0).with_(information=fk.Delayed(0.1, self_delayed=True))
    margins = found(late, ["delay", "loss"], levels={"delay": [0.0, 0.2, 0.8]})
    margin = margins.margin("delay", "agree")
    assert margin.bracket.lower < np.pi / 8 <= margin.bracket.upper * 1.05
    assert margin.bracket.width <= 0.1
    assert margins.varied[0].world == "everybody known 0.8 late"
    assert "loss is a property of messages" in margins.refused["loss"]


def test_the_delay_of_a_leader_that_sends_messages_is_bracketed():
    """p' = c (v - p), v the time of the newest sample: an agent lags by 1/c, the delay and up to a period."""

    def lag(e):
        return below(abs(float(e.run.p[-1, 0, 0]) - float(e.t[-1])), 0.5, "")

    law = fk.Law(fk.Fixed(1, []), [fk.Track(fk.Path(["t", "0"]), 0.0, 10.0)])
    told = fk.Messages(0.05, leader=True)
    made = fk.Scenario(law, fk.State([[0.0, 0.0]]), t_end=1.5, frames=5, information=told)
    near = Claim("near", "here", "The velocity lags by less than 0.5.", lag)
    margins = found(made, "delay", claims=(near,), levels={"delay": [0.2, 0.8]})
    margin = margins.margin("delay", "near")
    assert margin.bracket.lower < 0.5 - 0.1
    assert margin.bracket.upper > 0.5 - 0.1 - 0.05
    assert margin.bracket.width <= 0.1
    assert "leaders known by them too" in margins.varied[0].world


@pytest.mark.parametrize(("samples", "bound"), [(1, 1.0), (2, 0.618034)])
def test_a_quantity_of_ones_own_finds_the_bound_of_whole_samples_of_delay(samples, bound):
    """T lambda_N < 2 sin(pi/(2(2d + 1))), the own state delayed too (Levin and May 1976)."""

    def world(scenario, value, _):
        return scenario.with_(control=fk.Held(value, latency=samples * value))

    late = Quantity("late-period", f"period, with {samples} of it from a control to its force", world,
                    lambda scenario, period: (0.12, 0.3))  # fmt: skip
    margin = found(consensus(t_end=120), late).margin("late-period", "agree")
    assert margin.bracket.lower < bound / 4 <= margin.bracket.upper * 1.05  # slow close to the bound
    assert margin.bracket.width <= 0.1


@pytest.mark.parametrize(("alpha", "beta", "bound"), [(1.0, 1.0, 0.5), (3.0, 0.5, 1 / 3)])
def test_the_period_of_second_order_consensus_is_bracketed(alpha, beta, bound):
    """min(2 beta/alpha, 2/(beta lambda_N)): on K4 and on two agents (Cao and Ren 2010)."""
    graph = fk.Fixed.complete(4) if alpha == 1 else fk.Fixed(2, [(0, 1)])
    law = fk.Law(graph, [fk.Gradient(fk.Potential("a*r**2/2", a=alpha)), fk.Consensus(beta)])
    rng = np.random.default_rng(0)
    q, p = rng.normal(size=(2, graph.n, 1))
    scenario = fk.Scenario(law, fk.State(q, p), t_end=150, frames=101)
    margin = found(scenario, "period", (SAME,), levels={"period": [0.1, 0.8]}).margin("period", "same")
    assert margin.bracket.lower < bound <= margin.bracket.upper * 1.05
    assert margin.bracket.width <= 0.1


def test_loss_that_widens_the_bound_of_the_period_is_an_island():
    """On K4 with dropped messages 2/(4(1-p) + 2p) in the mean square: a period of 0.55 wants a loss above 0.18."""
    scenario = consensus(0.55, loss=Bernoulli(0.0, paired=True), expires=0.55)
    table = found(scenario, "loss", levels={"loss": [0.0, 0.45, 0.5, 0.99]}, seeds=4)
    margin = table.margin("loss", "agree")
    assert margin.bracket == Bracket(None, 0.0, (0.45, 0.5))
    assert margin.islands == ((0.45, 0.5),)
    assert "0.45 to 0.5" in str(table)


def test_a_conclusion_that_fails_and_holds_again_is_flagged():
    odd = Claim("odd", "here", "Not between.", lambda e: Measure(
        -1.0 if 0.25 < getattr(e.run.scenario.control, "period", 0.0) < 0.45 else 1.0))  # fmt: skip
    scenario = consensus(t_end=4)
    margin = found(scenario, "period", (odd,), levels={"period": [0.1, 0.3, 0.4, 0.5, 0.6]}).margin("period", "odd")
    assert margin.bracket.lower < 0.25 < margin.bracket.upper
    assert margin.islands == ((0.5, 0.6),)


def test_brackets_of_counts():
    yes, no, some = Count(4), Count(0, 4), Count(3, 0, 1)
    assert bracket({0.0: yes, 1.0: some, 2.0: yes}, 1.0) == Bracket(0.0, 1.0, (2.0,))
    assert bracket({0.0: yes, 1.0: some, 2.0: no}, 0.75) == Bracket(1.0, 2.0)
    assert bracket({0.1: yes}, 1.0) == Bracket(0.1, None)
    assert bracket({10.0: yes, 1.0: no, 0.1: yes}, 1.0, falling=True) == Bracket(10.0, 1.0, (0.1,))
    assert bracket({1.0: Count()}, 0.5) == Bracket(None, 1.0)
    assert between(Bracket(1.0, 4.0)) == 2.0
    assert between(Bracket(0.0, 4.0)) == 2.0
    assert between(Bracket(None, 4.0)) == 1.0
    assert between(Bracket(None, 4.0), falling=True) == 16.0
    assert between(Bracket(None, 0.0)) is None
    levels = [1.0, 2.0, 3.0, 4.0, 5.0]
    assert islands(Bracket(None, 1.0, (2.0, 3.0, 5.0)), levels) == [(2.0, 3.0), (5.0, 5.0)]


@pytest.mark.parametrize(("held", "total"), [(0, 5), (5, 5), (3, 8), (19, 20)])
def test_intervals_are_those_of_clopper_and_pearson(held, total):
    theirs = binomtest(held, total).proportion_ci(0.95, method="exact")
    ours = Count(held, 0, total - held).interval(0.95)
    assert (ours.low, ours.high) == pytest.approx((theirs.low, theirs.high), rel=1e-9)


def open_beyond_ideal(e):
    """Shown in the ideal world, and left open wherever control is held."""
    if getattr(e.run.scenario.control, "period", 0.0):
        raise NotResolvable("nobody knows")
    return Measure(1.0)


def test_a_conclusion_that_is_open_at_every_level_is_no_failure_and_costs_no_bisection():
    claim = Claim("unknown", "here", "Nobody knows.", open_beyond_ideal)
    levels = {"period": [0.1, 0.2]}
    table = found(consensus(t_end=4), "period", (claim, AGREE), levels=levels, most_runs=3)
    assert table.status == "finished"
    assert table.runs == 3  # the ideal world and the two levels: neither conclusion asks for more
    (row,) = [cells for cells in table.cells if cells[1] == "unknown"]
    assert row[2:] == ("not known", "", "", "open at all tried", "2 open", "")
    (data,) = [one for one in table.as_dict()["margins"] if one["conclusion"] == "unknown"]
    assert (data["open"], data["shown_to"], data["not_at"]) == (True, None, None)
    assert not open_everywhere({0.1: Count(0, 0, 2), 0.2: Count(0, 1, 1)})
    assert not open_everywhere({0.1: Count(1, 0, 2)})


def open_until_refuted(e):
    """Left open at short periods, refuted at long ones."""
    period = getattr(e.run.scenario.control, "period", 0.0)
    if 0.0 < period < 0.3:
        raise NotResolvable("nobody knows")
    return Measure(1.0 if period == 0.0 else -1.0)


def test_a_conclusion_that_is_open_before_it_is_refuted_is_not_sought_nearer_to_the_ideal_world():
    """Before, levels four times nearer to the ideal world were tried ten times, and "ideal" stood as its margin."""
    claim = Claim("late", "here", "Nobody knows early.", open_until_refuted)
    table = found(consensus(t_end=4), "period", (claim,), levels={"period": [0.1, 0.2, 0.4]}, most_runs=50)
    assert (table.runs, table.status) == (4, "finished")
    (row,) = table.cells
    assert row[2:] == ("not known, open at 0.1", "1 open", "", "0.4", "1 refute it", "")
    (data,) = table.as_dict()["margins"]
    assert (data["open"], data["shown_to"], data["not_at"]) == (True, None, 0.4)
    refuted_first = {0.1: Count(0, 1), 0.2: Count(0, 0, 1)}
    assert not open_from_ideal(refuted_first, bracket(refuted_first, 1.0))


def test_levels_are_told_in_full_and_intervals_are_rounded_outwards():
    # 20 of 30 runs: Clopper and Pearson's interval at 95 % is 0.4719 to 0.8271, and a level of 1/3 was tried, no other.
    level = 1.0 / 3.0
    counts = {level: Count(20, 10, 0), 0.5: Count(1, 29, 0)}
    period = Varied("period", "seconds", "held", {"agree": counts}, False)
    table = Margins("four", {"agree": ""}, {"agree": Count(30)}, (period,), {}, 0.6, 0.1, 0.95, (1,), 90, "finished")
    (row,) = table.cells
    assert row[2:7] == ("0.3333333333333333", "20/30", "0.47 to 0.83", "0.5", "1 show it, 29 refute it")


def test_the_rounds_of_a_search_share_one_pool(monkeypatch):
    opened = []

    def counted(workers, cluster):
        opened.append(workers)
        return pool(workers, cluster)

    monkeypatch.setattr("flocking.study.sweeps.worker_pool.pool", counted)
    monkeypatch.setattr("flocking.study.sweeps.sweep.pool", counted)
    table = found(consensus(), "period", levels={"period": [0.2, 0.8]})
    assert table.runs > 4
    assert opened == [1]


def test_margins_are_drawn(tmp_path):
    counts = {
        "agree": {0.1: Count(4), 0.2: Count(4), 0.4: Count(0, 4), 0.8: Count(0, 0, 4), 1.6: Count(4)},
        "unknown": {0.1: Count(0, 0, 4), 1.6: Count(0, 0, 4)},
        "never": {0.1: Count(0, 4)},
    }  # fmt: skip
    one = Varied("period", "how long", "held", counts)
    ideal = {"agree": Count(1), "unknown": Count(1), "never": Count(0, 1)}
    table = Margins("four", dict.fromkeys(counts, "."), ideal, (one, replace(one, name="delay")), {}, 1.0, 0.1, 0.95,
                    (0, 1, 2, 3), 20, "finished")  # fmt: skip
    first, second = contents(margins_figure(table))
    assert (first.horizontal, second.horizontal) == ("period", "delay")
    (bar,) = first.of("bar agree")
    assert bar.points.tolist() == [[0.0, 0.0], [2.0, 0.0]]
    places = {state: [x for mark in first.of(f"{state} agree") for x in mark.points[:, 0]] for state in
              ("shown", "refuted", "open")}  # fmt: skip
    assert places == {"shown": [1.0, 2.0, 5.0], "refuted": [3.0], "open": [4.0]}
    assert [mark.points[:, 0].tolist() for mark in first.of("open unknown")] == [[1.0, 5.0]]
    assert first.of("shown unknown") == first.of("bar never") == []
    assert margins_figure(replace(table, ideal={"never": Count(0, 1)})) is None


def test_what_is_proven_is_a_line_beside_the_margins():
    """Halfway between the levels .2 and .4, which stand at 2 and 3; beyond all levels, half a level out."""
    one = Varied("period", "how long", "held", {"agree": {0.1: Count(4), 0.2: Count(4), 0.4: Count(0, 4)}})
    table = Margins("four", {"agree": "."}, {"agree": Count(1)}, (one,), {}, 1.0, 0.1, 0.95, (0,), 20, "finished")
    lines = (MarginLine(0.3, "agreement is stable below", "control_period"), MarginLine(9.0, "far", "far"))
    (drawn,) = contents(margins_figure(table, {"period": lines}))
    (mark,) = drawn.of("proven control_period")
    assert mark.points[:, 0].tolist() == pytest.approx([2.5, 2.5])
    assert drawn.of("proven far")[0].points[:, 0].tolist() == [3.5, 3.5]
    (plain,) = contents(margins_figure(table))
    assert plain.of("proven control_period") == []
    # Of limits the ideal one is infinite: 4 lies between none and 2, and 1 between 2 and 0.5.
    assert place_of(4.0, (2.0, 0.5), falling=True) == pytest.approx(0.5)
    assert place_of(1.0, (2.0, 0.5), falling=True) == pytest.approx(1 + 1 / 3)


def test_lines_of_several_seeds_are_at_the_safest_value():
    law = fk.Law(fk.Proximity(9.0), [fk.Gradient(fk.Potential("1/r + r**2"))])
    starts = [fk.State([[0.0, 0], [1, 0], [0, y]], [[0.0, 0], [0, 0], [0, 0.5]]) for y in (1.0, 2.0)]
    made = [fk.Scenario(law, start, t_end=1.0) for start in starts]
    (line,) = common_lines(made, "limit")
    each = [margin_lines(scenario, "limit")[0].value for scenario in made]
    assert line.value == max(each) > min(each)
    assert common_lines(made, "delay") == common_lines([], "limit") == ()


class Interrupted:
    """A family that is interrupted at its n-th call."""

    def __init__(self, calls):
        self.left = calls

    def __call__(self, seed):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt
        return drawn(seed)


def drawn(seed):
    start = fk.start.box(4, side=2.0, speed=1.0, seed=seed)
    law = fk.Law(fk.Fixed.complete(4), [fk.Gradient(fk.Potential("(r - 1)**2/2")), fk.Consensus(1.0)])
    return fk.Scenario(law, start, t_end=30, frames=61, seed=seed, name="four")


OPTIONS = {"levels": {"period": [0.3, 1.2], "loss": [0.0, 0.5]}, "period": 0.4, "seeds": 3, "width": 0.5}


def test_what_was_interrupted_goes_on_to_the_same_result(tmp_path):
    whole = found(drawn, ["period", "loss"], (SAME,), **OPTIONS)
    assert whole.status == "finished"
    assert whole.ideal["same"] == Count(3)
    partly = found(Interrupted(25), ["period", "loss"], (SAME,), out=tmp_path / "out", **OPTIONS)
    assert partly.status == "interrupted"
    assert 0 < partly.runs < whole.runs
    again = found(drawn, ["period", "loss"], (SAME,), out=tmp_path / "out", **OPTIONS)
    assert again.as_dict() == whole.as_dict()
    assert margins_from(json.loads(json.dumps(again.as_dict()))).as_dict() == whole.as_dict()
    with pytest.raises(fk.StorageError, match="period"):
        found(drawn, ["period", "loss"], (SAME,), out=tmp_path / "out", **{**OPTIONS, "period": 0.2})


def test_the_number_of_workers_changes_nothing():
    one, two = (
        found(drawn, "loss", (SAME,), workers=k, period=0.4, levels={"loss": [0.0, 0.9]}, width=0.95) for k in (1, 2)
    )
    assert one.as_dict() == two.as_dict()


def test_too_few_runs_leave_brackets_wide_and_say_so():
    table = found(consensus(), "period", levels={"period": [0.2, 0.8]}, most_runs=3)
    assert table.status == "3 runs did not suffice"
    assert "may be wider" in str(table)
    assert table.margin("period", "agree").bracket == Bracket(0.2, 0.8)


def test_what_cannot_be_varied_is_refused_by_name_and_the_others_go_on():
    table = found(consensus(t_end=4), ["period", "limit"], levels={"period": [0.1]})
    assert "no obstacles" not in table.refused["limit"]
    assert "of order 1" in table.refused["limit"]
    assert [one.name for one in table.varied] == ["period"]


def test_the_limit_of_forces_is_varied_downwards():
    table = found(drawn, "limit", (SAME,), levels={"limit": [10.0, 1e-4]}, seeds=1, width=0.9)
    bracket_found = table.margin("limit", "same").bracket
    assert bracket_found.lower > bracket_found.upper >= 1e-4
    assert "force at most 0.0001" in table.varied[0].world


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"vary": "weather"}, "vary must be among period"),
        ({"seeds": 0}, "seeds"),
        ({"seeds": [1, 1]}, "twice"),
        ({"width": 1.0}, "width must be below 1"),
        ({"share": 1.5}, "share must be at most 1"),
        ({"levels": {"loss": [0.1]}}, "levels must be of what is varied"),
        ({"levels": {"period": []}}, "at least one"),
        ({"levels": {"period": [-1.0]}}, "period"),
        ({"scenario": "no-such"}, "scenario must be one of"),
    ],
)
def test_wrong_input_is_named(options, words):
    given = {"scenario": consensus(t_end=1), "vary": "period", **options}
    with pytest.raises(fk.InvalidInput, match=words):
        found(given.pop("scenario"), given.pop("vary"), **given)


def test_only_quantities_are_registered():
    with pytest.raises(fk.InvalidInput, match="must be a Quantity"):
        register_quantity("loss")


FILE = """
t_end = 12.0
frames = 61
terms = [{kind = "consensus", gain = 1.0}]
graph = {kind = "fixed", n = 4, edges = [[0, 1], [1, 2], [2, 3]]}
start = {draw = "box", n = 4, side = 2.0, speed = 1.0, seed = 0}
"""


def test_the_command_prints_a_table_and_writes_its_data(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "four.toml").write_text(FILE, encoding="utf-8-sig")
    words = ["margins", "four.toml", "--vary", "period", "--levels", "period=0.1,2", "--seeds", "2", "--workers", "1"]
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert "velocities-agree" in shown
    assert "the same at all" in shown
    stored = (tmp_path / "out" / "margins" / "four" / "margins.json").read_bytes()
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(stored)
    assert (tmp_path / "out" / "margins" / "four" / "margins.svg").stat().st_size > 1000
    assert main(["margins", "four.toml", "--levels", "period"]) == 2
    assert "name=value,value" in capsys.readouterr().err


def test_runs_that_hardly_advance_are_given_up():
    """Zhou's potential is infinite at R: forces of at most 5 let two agents press against it, in ever shorter steps."""
    table = found("zhou-2015", "limit", levels={"limit": [5.0]}, seeds=1, most_runs=2)
    counts = table.margin("limit", "agree").counts if "agree" in table.shown_ideally else None
    assert (table.runs, table.status) == (2, "finished")
    assert counts is None or counts[5.0] == Count(0, 0, 1)


def test_a_conclusion_that_only_the_ideal_world_keeps_is_sought_three_times():
    """Levels of .4, .1, .025 and .00625, then no more; before, twelve rounds."""
    never = Claim("never", "here", "Nobody acts at ticks.", lambda e: Measure(
        -1.0 if getattr(e.run.scenario.control, "period", 0.0) else 1.0))  # fmt: skip
    table = found(consensus(t_end=1), "period", (never,), levels={"period": [0.4]})
    assert (table.runs, table.status) == (5, "finished")
    assert table.varied[0].levels == (0.00625, 0.025, 0.1, 0.4)
    assert table.cells[0][2:6] == ("ideal", "1/1", "one run", "0.00625")


def test_what_the_base_world_breaks_is_not_blamed_on_the_quantity():
    """Losses are varied in a world of ticks and messages: one claim fails there without a loss, one at losses alone."""
    ticks = Claim("ticks", "here", "Nobody acts at ticks.", lambda e: Measure(
        -1.0 if getattr(e.run.scenario.control, "period", 0.0) else 1.0))  # fmt: skip
    heard = Claim("heard", "here", "Nothing is lost.", lambda e: Measure(
        -1.0 if getattr(e.run.scenario.information, "loss", None) else 1.0))  # fmt: skip
    table = found(consensus(t_end=1), "loss", (ticks, heard), levels={"loss": [0.4]}, seeds=1)
    # Towards a base world that keeps a conclusion as far as towards the ideal one: 0.4 / 64, and no further.
    assert (table.varied[0].levels[:2], table.varied[0].levels[-1]) == ((0.0, 0.00625), 0.4)
    assert (table.margin("loss", "ticks").bracket.lower, table.margin("loss", "ticks").bracket.upper) == (None, 0.0)
    assert (table.margin("loss", "heard").bracket.lower, table.margin("loss", "heard").bracket.upper) == (0.0, 0.00625)
    assert table.cells[0][2:6] == ("ideal", "1/1", "one run", "0")
    (note,) = [note for note in table.notes if "at 0 already" in note]
    assert "refuted at 0 already, where nothing of it is varied: ticks." in note
    assert "messages every 0.001; control held for 0.001" in note
    assert margins_from(table.as_dict()) == table


@pytest.mark.parametrize("levels", [[2.0], [0.0, 0.5, 1.5]])
def test_levels_of_which_no_world_is_made_are_named(levels):
    """A probability of 2: the user gave a level, and no part of that name."""
    law = fk.Law(fk.Fixed.complete(2), [fk.Gradient(fk.Potential("r**2/2"))])
    made = fk.Scenario(law, fk.State([[0.0], [1.0]]), t_end=1.0, bodies=fk.SingleIntegrator())
    with pytest.raises(fk.InvalidInput, match=r"margins: levels\['loss'\] .* from 0 to 1") as error:
        fk.margins(made, ["loss"], levels={"loss": levels})
    assert error.value.value == levels[-1]
