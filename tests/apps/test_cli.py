"""The command line: exit codes, messages, JSON and tables."""

from __future__ import annotations

import io
import json
import math
import os
import re
import resource
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

import flocking as fk
from flocking.apps import cli
from flocking.apps.commands import audit_command
from flocking.apps.json_output import print_json
from flocking.apps.reproduction import reproduce as reproduction
from flocking.apps.reproduction.reproduce import Reproduction
from flocking.papers import ALL_KEYS, KEYS
from flocking.study.claims.claim import Measure
from flocking.study.claims.general_claims import GENERAL

QUICK = """
name = "quick"
t_end = 1
frames = 5
terms = [{kind = "gradient", formula = "1/r + 1/(R - r)", parameters = {R = 4}}, {kind = "consensus"}]
graph = {kind = "hysteresis", radius = 4, gap = 0.1}
start = {draw = "box", n = 6, side = 4, speed = 2, seed = 5, connected = true}
"""
FALL = """
t_end = 100
graph = {kind = "proximity", radius = 10}
terms = [{kind = "gradient", formula = "-1/r"}]
start = {q = [[0, 0], [1, 0]]}
"""


@pytest.fixture
def quick(tmp_path: Path) -> Path:
    file = tmp_path / "quick.toml"
    file.write_text(QUICK)
    return file


def call(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    code = cli.main([str(word) for word in words])
    shown = capsys.readouterr()
    for text in (shown.out, shown.err):
        assert "Traceback" not in text
        assert "\x1b" not in text
    return code, shown.out, shown.err


def shell(*words: object, **settings: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "flocking", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **settings)  # type: ignore[call-overload, no-any-return]


def children_seconds() -> float:
    """Processor time of all processes that this one has waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def test_help_names_every_command_and_is_quick() -> None:
    begin = children_seconds()
    shown = shell("--help", env={**os.environ, "COLUMNS": "80"})
    seconds = children_seconds() - begin
    assert shown.returncode == 0
    for command in ("list", "run", "resume", "reproduce", "audit", "check", "equations", "schema"):
        assert command in shown.stdout
    assert "\x1b" not in shown.stdout
    assert max(map(len, shown.stdout.splitlines())) <= 80
    assert seconds < 2.0  # 0.2 s of processor time on an idle machine


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from flocking.apps.cli import main; main(['--help']);"
        "heavy = {'llvmlite', 'sympy', 'scipy', 'matplotlib', 'zarr', 'xarray', 'numpy'};"
        "heavy &= set(sys.modules);"
        "sys.exit(f'imported {heavy}' if heavy else 0)"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert shown.returncode == 0, shown.stderr


def test_a_run_whose_code_is_stored_imports_neither_sympy_nor_scipy_nor_zarr() -> None:
    code = (
        "import sys; from flocking.apps.cli import main; main(['run', 'zhou-2015', '--json']);"
        "print({'sympy', 'scipy', 'zarr', 'matplotlib'} & set(sys.modules) or 'none', file=sys.stderr)"
    )
    said = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120).stderr.split()[-1:]
        for _ in range(2)
    ]
    assert said[1] == ["none"], said  # the first one may have compiled


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert call(capsys, "--version")[:2] == (0, f"{fk.__version__}\n")


def test_list_shows_every_scenario_of_every_paper(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = call(capsys, "list", "--json")
    assert code == 0
    names = {row["scenario"]: row["paper"] for row in json.loads(out)}
    assert {"tanner-2003-fixed", "tanner-2003-dynamic", "zhou-2015", "zhou-2015-leader"} <= set(names)
    assert set(names.values()) == set(ALL_KEYS)
    code, out, _ = call(capsys, "list")
    assert code == 0
    assert all(name in out for name in names)
    assert max(map(len, out.splitlines())) <= 80


def test_run_audit_and_resume_of_a_file(quick: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "run"
    # Before the command, whose error output tells of progress when it has to compile first.
    expected = fk.simulate(fk.read_scenario(quick), progress=False)
    code, text, err = call(capsys, "run", quick, "--out", out)
    # On a busy machine it says after two seconds how far it is.
    assert (code, re.sub(r"(?m)^.* \d+ s so far\n", "", err)) == (0, "")
    assert "finished" in text
    assert "closest pair" in text
    assert fk.read_run(out).q.tobytes() == expected.q.tobytes()
    code, text, _ = call(capsys, "audit", out, "--json")
    report = json.loads(text)
    assert (code == 0) == report["as_expected"]
    promised = {row["key"]: row for row in report["certificates"]}
    assert promised["links_kept"]["kept"] is True
    assert (
        promised["closest_approach"]["promised"] < expected.closest.distance == promised["closest_approach"]["observed"]
    )
    code, text, _ = call(capsys, "audit", out)
    assert "verdict" in text
    assert "closest_approach   >=" in text
    assert re.search(r"^links-kept +holds,", text, re.M)
    assert "links-kept (links_kept)" in text
    assert max(map(len, text.splitlines())) <= 80
    code, text, _ = call(capsys, "resume", out, "--json")
    assert code == 0
    assert json.loads(text)["status"] == "finished"


def test_run_as_json_is_pure_json_and_seeds_differ(quick: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = [json.loads(call(capsys, "run", quick, "--json", *extra)[1]) for extra in ([], ["--seed", "6"])]
    assert [f["provenance"]["seed"] for f in found] == [None, 6]
    assert found[0]["scenario"] == "quick"
    assert found[0]["energy"] != found[1]["energy"]


def test_an_audit_that_finds_a_wrong_run_exits_with_1(
    quick: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = fk.read_scenario(quick)
    mutant = fk.Law(scenario.law.graph, (scenario.law.terms[0], fk.Consensus(0.2)))
    fk.write_run(fk.simulate(scenario, plant=mutant, progress=False), tmp_path / "mutant")
    code, text, _ = call(capsys, "audit", tmp_path / "mutant")
    assert code == 1
    assert "Some decided claims have another verdict than expected." in text


def test_what_is_not_resolved_is_not_said_to_have_another_verdict(quick: Path) -> None:
    open_one = replace(GENERAL[0], conclusion=lambda e: Measure(0.0, 1.0, "in doubt"), obstacle=lambda e: "")
    report = fk.audit(fk.simulate(fk.read_scenario(quick), progress=False), [open_one])
    assert audit_command._outcome(report) == (
        "No decided claim has another verdict than expected; not resolved, though a verdict was expected: ledger."
    )
    assert not report.as_expected


def test_nothing_is_guaranteed_of_a_run_that_breaks_a_promise(
    quick: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The run is that of agents that do not hold together, under the name of those that do."""
    scenario = fk.read_scenario(quick)
    scenario = scenario.with_(t_end=6.0)
    loose = fk.Law(scenario.law.graph, (fk.Consensus(0.0),))
    fk.write_run(fk.simulate(scenario, plant=loose, progress=False), tmp_path / "loose")
    code, text, _ = call(capsys, "audit", tmp_path / "loose")
    assert code == 1
    assert re.search(r"^links_kept .* NO ", text, re.M)
    assert ", guaranteed" not in text
    assert "links-kept (links_kept)" not in text
    assert "is broken" in text


def test_a_run_that_cannot_go_on_exits_with_1_and_tells_what_was_reached(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "fall.toml").write_text(FALL)
    code, out, err = call(capsys, "run", tmp_path / "fall.toml", "--json")
    assert code == 1
    # What is said on the way where that takes a while stands before it.
    assert err.splitlines()[-1].startswith("flocking: The step shrank")
    assert 0 < json.loads(out)["time"] < 0.8


BAD = [
    (["rum"], 'Did you mean "run"'),
    (["run"], "scenario"),
    (["run", "zhou"], "Did you mean 'zhou-2015'?"),
    (["run", "absent.toml"], "cannot be read"),
    (["run", "."], "cannot be read"),
    (["run", "zhou-2015", "--engine", "steam"], "must be one of"),
    (["run", "zhou-2015", "--seed", "x"], "seed"),
    (["run", "zhou-2015", "--seed", "-1"], "seed"),
    (["run", "zhou-2015", "--out", "/dev/null/x"], "/dev/null/x"),
    (["audit", "absent"], "There is neither folder nor file."),
    (["audit", "."], "not a run"),
    (["resume", "absent"], "absent"),
    (["check", "1/r +"], "does not parse"),
    (["check", "__import__('os').system('true')"], "Call"),
    (["check", "1/(R - r)"], "'R', which has no value"),
    (["check", "R/r", "-p", "R"], "name=number"),
    (["check", "R/r", "-p", "R=nan"], "name=number"),
    (["check", "R/r", "-p", "R=1", "-p", "R=2"], "R once"),
    (["check", "1/r", "--radius", "-1"], "greater than 0"),
    (["check", "1/r", "--definition", "none"], "must be one of"),
    (["equations", "tanner"], "must be one of"),
    (["reproduce", "tanner"], "must be one of"),
    (["reproduce", "zhou-2015", "--seeds", "0"], "at least 1"),
    (["reproduce", "zhou-2015", "--seeds", "9" * 30], "at most 10000"),
    (["reproduce", "zhou-2015", "--workers", "0"], "workers must be at least 1"),
    (["reproduce", "zhou-2015", "--out", "/dev/null/x"], "folder that can be written"),
    (["run", "zhou-2015", "--seed", "1.5"], "--seed must be an integer; got '1.5'"),
    (["run", "zhou-2015", "--seed=2.0"], "--seed must be an integer; got '2.0'"),
    (["reproduce", "--seeds", "5.5"], "--seeds must be an integer"),
    (["sweep", "zhou-bound", "--most-runs", "0"], "most_runs must be at least 1"),
    (["plot", "zhou-2015", "--out", "x.jpg"], "must end in .svg, .png or .pdf"),
    (["run", "zhou-2015", "--engine", "tiles", "--memory", "-1"], "--memory must be greater than 0; got -1.0"),
    (["lab", "--port", "99999"], "port must be from 1 to 65535; got 99999"),
    (["lab", "--port", "0"], "port must be at least 1; got 0"),
]


@pytest.mark.parametrize(("words", "message"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_bad_input_exits_with_2_and_one_message(
    words: list[str], message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    code, out, err = call(capsys, *words)
    assert (code, out) == (2, "")
    assert err.startswith("flocking: ")
    assert message in err
    assert err.count("\n") == 1


def test_every_fault_of_a_file_is_on_stderr(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bad.toml").write_text(QUICK.replace("gap = 0.1", "gap = 9").replace("t_end = 1", "t_end = 'x'"))
    code, out, err = call(capsys, "run", tmp_path / "bad.toml", "--json")
    assert (code, out) == (2, "")
    assert "2 faults" in err
    assert "graph.gap: must be smaller than the radius" in err
    assert "t_end: must be a number; got 'x'" in err


def test_more_agents_than_the_limit_need_a_word(quick: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = call(capsys, "run", quick, "--most-agents", "5")
    assert code == 2
    assert "--most-agents 6" in err


def test_the_limit_of_agents_holds_for_named_scenarios_and_stored_runs(
    quick: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(capsys, "run", quick, "--out", tmp_path / "stored")[0] == 0
    for command in (("certify", "zhou-2015"), ("run", "zhou-2015"), ("plot", tmp_path / "stored")):
        code, out, err = call(capsys, *command, "--most-agents", "5")
        assert (code, out) == (2, "")
        assert "most-agents must be at least the" in err


def test_check_exits_with_1_only_where_a_named_definition_fails(capsys: pytest.CaptureFixture[str]) -> None:
    formula = "1/r + 1/(R - r)"
    code, out, _ = call(capsys, "check", formula, "-p", "R=4", "--radius", "4", "--json")
    assert code == 0
    verdicts = {d["key"]: d["holds"] for d in json.loads(out)["definitions"]}
    assert verdicts["zhou-2015"] is True
    assert verdicts["tanner-2003-fixed"] is False
    assert call(capsys, "check", formula, "-p", "R=4", "--definition", "zhou-2015")[0] == 0
    # What is open is not known to hold: nothing says at which radius the potential is to be infinite.
    assert call(capsys, "check", "1/r + log(r)", "--definition", "zhou-2015", "--json")[0] == 1
    code, out, _ = call(capsys, "check", formula, "-p", "R=4", "--definition", "tanner-2003-fixed")
    assert code == 1
    assert "fails" in out
    assert max(map(len, out.splitlines())) <= 80


def test_equations(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = call(capsys, "equations", "tanner-2003-fixed", "--json")
    assert code == 0
    rows = json.loads(out)
    assert {row["paper"] for row in rows} == {"tanner-2003-fixed"}
    assert any(row["verdict"] == "false statement" for row in rows)
    code, out, _ = call(capsys, "equations", "tanner-2003-fixed")
    assert all(row["number"] in out for row in rows)
    assert max(map(len, out.splitlines())) <= 80


def test_schema_is_json(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = call(capsys, "schema")
    assert code == 0
    assert json.loads(out)["title"] == "flocking scenario"


def test_reproduce_with_too_few_seeds_is_not_as_expected(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = call(capsys, "reproduce", "tanner-2003-fixed", "--seeds", "1", "--json")
    assert code == 1
    found = json.loads(out)
    assert found["as_expected"] is False
    refuted = [row for row in found["claims"] if row["basis"] == "counter-example"]
    assert refuted
    assert {row["verdict"] for row in refuted} == {"fails"}
    rest = {row["verdict"] for row in found["claims"] if row not in refuted}
    assert rest <= {"untested", "not applicable"}


def test_reproduce_says_why_claims_are_untested_and_what_to_open(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from flocking.papers import paper
    from flocking.study.claims.claim import Result, Verdict
    from flocking.study.claims.judgement import Judgement

    claim = paper("zhou-2015").claims("zhou-2015")[0]
    few = Judgement(claim, (Result(claim, Verdict.HOLDS, 1.0, 0.0),) * 4)
    found = Reproduction({"zhou-2015": [few, few]}, seconds=1.0)
    monkeypatch.setattr(reproduction, "reproduce", lambda *_, **__: found)
    code, out, _ = call(capsys, "reproduce", "--seeds", "4", "--out", tmp_path)
    assert code == 1
    assert "2 are untested: fewer than five seeds met" in out
    assert "Use at least 5 seeds." in out
    assert f"Open {tmp_path / 'report.html'}" in out


def test_reproduce_tells_observations_that_are_not_decided_from_hypotheses_that_are_not_met(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from flocking.papers import paper
    from flocking.study.claims.claim import Basis, Result, Verdict
    from flocking.study.claims.judgement import Judgement

    claim = next(c for c in paper("reynolds-1987").claims("reynolds-1987") if c.basis is Basis.OBSERVATION)
    waiting = Judgement(claim, (Result(claim, Verdict.NOT_YET, -1.0, 0.0),) * 10)
    found = Reproduction({"reynolds-1987": [waiting]}, seconds=1.0)
    monkeypatch.setattr(reproduction, "reproduce", lambda *_, **__: found)
    _, out, _ = call(capsys, "reproduce", "--out", tmp_path)
    assert "1 is without a rate: fewer than five seeds decided the observation." in out
    assert "met" not in out.split("further claims")[1]
    assert "Use at least" not in out


def test_observations_are_not_counted_among_the_claims_with_an_expected_verdict(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from flocking.papers import paper
    from flocking.study.claims.claim import Basis, Result, Verdict
    from flocking.study.claims.judgement import Judgement

    claims = {basis: next(c for c in paper("reynolds-1987").claims("reynolds-1987") if c.basis is basis)
              for basis in (Basis.PROOF, Basis.OBSERVATION)}  # fmt: skip
    held, seen = (Judgement(c, (Result(c, Verdict.HOLDS, 1.0, 0.0),) * 5) for c in claims.values())
    wrong = Judgement(claims[Basis.PROOF], (Result(claims[Basis.PROOF], Verdict.FAILS, -1.0, 0.0),) * 5)
    for judged, said, code in (([held, seen, seen], "1 of 1", 0), ([held, wrong, seen, seen], "1 of 2", 1)):
        found = Reproduction({"reynolds-1987": judged}, seconds=1.0)
        monkeypatch.setattr(reproduction, "reproduce", lambda *_, found=found, **__: found)
        answer, out, _ = call(capsys, "reproduce", "--out", tmp_path)
        assert answer == code
        assert f"{said} claims with an expected verdict have it" in out
        assert "2 further claims are observations" in out


def test_reproduce_passes_its_arguments_and_exits_with_0_when_all_is_as_expected(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    seen = {}

    def stand_in(keys: object, **settings: object) -> Reproduction:
        seen.update(settings, keys=keys)
        return Reproduction({}, seconds=1.0)

    monkeypatch.setattr(reproduction, "reproduce", stand_in)
    code, out, _ = call(capsys, "reproduce", "--seeds", "7", "--first-seed", "3", "--out", tmp_path, "--workers", "1")
    assert code == 0
    assert "0 of 0 claims" in out
    assert (seen["seeds"], seen["first_seed"], seen["out"], seen["workers"]) == (7, 3, tmp_path, 1)
    assert tuple(seen["keys"]) == tuple(KEYS)
    assert call(capsys, "reproduce", "--all")[0] == 0
    assert tuple(seen["keys"]) == tuple(ALL_KEYS)
    code, _, complaint = call(capsys, "reproduce", "--all", "zhou-2015")
    assert code == 2
    assert "--all" in complaint


def test_a_closed_pipe_is_no_error() -> None:
    line = f"{sys.executable} -m flocking schema | head -1; echo ${{PIPESTATUS[0]}}"
    shown = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60)
    assert shown.stdout.split() == ["{", "0"]
    assert shown.stderr == ""


def with_closed_pipe(code: str) -> subprocess.CompletedProcess[str]:
    """What a program in Python comes to whose output nobody reads."""
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "w") as nobody:
        return subprocess.run(
            [sys.executable, "-c", code], stdout=nobody, stderr=subprocess.PIPE, text=True, timeout=60
        )


def test_a_closed_pipe_leaves_the_exit_code_that_of_the_outcome() -> None:
    command = """
import sys
from flocking.apps import cli
def check() -> int:
    print("x" * 1_000_000)
    {}
cli.check = check
sys.exit(cli.main(["check"]))
"""
    shown = with_closed_pipe(command.format("return 1"))
    assert (shown.returncode, shown.stderr) == (1, "")
    # Another pipe that breaks, as that to a worker, is no success.
    shown = with_closed_pipe(command.format("raise BrokenPipeError(32, 'Broken pipe')"))
    assert (shown.returncode, shown.stderr) == (2, "flocking: Broken pipe.\n")


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "utf-8"])
def test_json_is_valid_whatever_the_encoding_of_the_terminal(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    data = {"name": "fl\u00f6cke \u2192 \U0001f426", "of": math.inf}
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding=encoding, errors="backslashreplace")
    monkeypatch.setattr(sys, "stdout", stream)
    print_json(data)
    stream.flush()
    assert json.loads(raw.getvalue().decode("utf-8")) == {**data, "of": None}


def test_no_colours_and_no_wide_lines_when_piped(quick: Path) -> None:
    shown = shell("run", quick, env={k: v for k, v in os.environ.items() if k not in ("COLUMNS", "FORCE_COLOR")})
    assert shown.returncode == 0, shown.stderr
    assert "\x1b" not in shown.stdout + shown.stderr
    assert max(map(len, shown.stdout.splitlines())) <= 80


def test_ctrl_c_keeps_what_was_computed_and_resume_goes_on(tmp_path: Path) -> None:
    file = tmp_path / "long.toml"
    file.write_text(QUICK.replace("t_end = 1\nframes = 5", "t_end = 1e5\nframes = 100001"))
    out = tmp_path / "run"
    command = [sys.executable, "-m", "flocking", "run", str(file), "--out", str(out), "--json"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        limit = time.monotonic() + 600
        while not (out.exists() and committed(out) > 0) and time.monotonic() < limit:
            assert process.poll() is None, process.communicate()[1]
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        text, err = process.communicate(timeout=600)
    finally:
        process.kill()
    assert process.returncode == 130, err
    assert "flocking resume" in err
    assert "Traceback" not in err
    found = json.loads(text)
    assert found["status"].startswith("interrupted")
    assert 0 < committed(out) <= found["frames"]


def committed(folder: Path) -> int:
    try:
        return len(fk.read_run(folder).t)
    except fk.FlockingError:
        return 0


def test_without_a_command_all_commands_are_listed(capsys):
    assert cli.main([]) == 0
    said = capsys.readouterr()
    assert "Usage: flocking COMMAND" in said.out
    assert "Judge claims about a saved run" in said.out
    assert said.err == ""
