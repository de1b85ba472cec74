"""An engine from outside the library is run, saved, killed, resumed, audited, swept and shown like any other."""

from __future__ import annotations

import ast
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.apps.lab.experiment.experiment import Experiment, replay
from flocking.engine.driver import registry
from flocking.engine.driver import session_writer as saving
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.session import Session
from flocking.engine.runs.run import Run
from flocking.errors import EngineFailed, EngineMissing, InvalidInput, UnsupportedLaw
from flocking.study.claims.claim import Verdict
from flocking.study.mutants import flipped_sign
from tests.engine.outside.plain_verlet import ENGINE, PlainEngine, PlainSession
from tests.engine.storage.stored_runs import assert_same, scenario

ROOT = Path(__file__).resolve().parents[3]
NAME = ENGINE.name


@pytest.fixture(autouse=True)
def engine() -> Iterator[None]:
    fk.register_engine(ENGINE)
    yield
    if registry.registered():
        fk.unregister_engine(NAME)


def run(**options: object) -> Run:
    return fk.simulate(scenario(1.0), engine=NAME, progress=False, **options)


THREE = fk.State([[0.0, 0.0], [3.0, 0.5], [1.0, 2.5]], [[0.5, 0.0], [-0.5, 0.25], [0.0, -0.5]])


def test_it_computes_what_the_exact_engine_does_to_the_square_of_its_step() -> None:
    made = fk.Scenario(scenario().law, THREE, 0.5, frames=2)
    exact = fk.simulate(made, progress=False)
    assert len(exact.switches) == 0
    off = [np.abs(fk.simulate(made, engine=NAME, step=h, progress=False).q - exact.q).max() for h in (0.004, 0.002)]
    assert off[1] < 1e-6
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.05)


def test_accelerations_of_every_engine_are_those_of_the_law() -> None:
    made = fk.Scenario(scenario().law, THREE, 1.0, agents=fk.Agents(masses=2.0, damping=0.3))
    expected = (fk.control(made.law, THREE, agents=made.agents) - 0.3 * THREE.p) / 2.0
    for name in ("exact", "tiles", NAME):
        np.testing.assert_allclose(fk.start(made, name).accelerations(), expected, rtol=0, atol=1e-12)
    first_order = fk.Scenario(scenario().law, fk.State(THREE.q), 1.0, agents=fk.Agents(order=1))
    expected = fk.control(first_order.law, first_order.start, agents=first_order.agents)
    np.testing.assert_allclose(fk.start(first_order).accelerations(), expected, rtol=0, atol=1e-12)


def test_a_run_killed_while_it_is_saved_goes_on_bit_for_bit(tmp_path: Path) -> None:
    script = (
        "import os, signal, sys, flocking as fk\n"
        "from flocking.engine.driver import session_writer as saving\n"
        "from tests.engine.outside.plain_verlet import ENGINE\n"
        "from tests.engine.storage.stored_runs import scenario\n"
        "fk.register_engine(ENGINE)\n"
        "saving.COMMIT_SECONDS, keep, count = 0.0, saving.SessionWriter.commit_if_due, [0]\n"
        "def dying(self):\n"
        "    keep(self); count[0] += 1\n"
        "    if count[0] == 7: os.kill(os.getpid(), signal.SIGKILL)\n"
        "saving.SessionWriter.commit_if_due = dying\n"
        f"fk.simulate(scenario(1.0), engine={NAME!r}, save=sys.argv[1], progress=False)\n"
    )
    died = subprocess.run([sys.executable, "-c", script, str(tmp_path / "run")], cwd=ROOT, check=False)
    assert died.returncode == -signal.SIGKILL
    left = fk.read_run(tmp_path / "run")
    assert left.status == "unfinished"
    assert 0 < len(left.t) < 21
    whole = run()
    gone_on = fk.resume(tmp_path / "run", progress=False)
    assert_same(gone_on, whole)
    assert_same(fk.read_run(tmp_path / "run"), whole)
    assert gone_on.fidelity == whole.fidelity == fk.read_run(tmp_path / "run").fidelity


def test_its_runs_are_audited_by_what_they_say_of_themselves() -> None:
    found = run()
    assert (found.fidelity.engine, found.fidelity.switches_located, found.fidelity.ledger.kind) == (
        NAME,
        False,
        "share",
    )
    report = fk.audit(found)
    assert report["connected"].verdict == Verdict.NOT_RESOLVED
    assert report["ledger"].verdict == Verdict.HOLDS
    plant = flipped_sign(scenario(1.0)).law
    assert fk.audit(run(plant=plant))["ledger"].verdict == Verdict.FAILS


def test_a_sweep_takes_it_to_its_workers(tmp_path: Path) -> None:
    def make(gain: float, seed: int) -> fk.Scenario:
        return fk.Scenario(fk.Law(fk.Proximity(4.0), [fk.Consensus(gain)]), scenario().start, t_end=0.1, frames=2)

    table = fk.sweep(make, grid={"gain": [0.5, 1.0]}, engine=NAME, options={"step": 0.05}, workers=2, progress=False)
    assert [row["status"] for row in table.rows.values()] == ["ok", "ok"], [r["message"] for r in table.rows.values()]


def test_the_lab_changes_it_goes_back_and_replays() -> None:
    experiment = Experiment(scenario(1.0), NAME)
    assert experiment.session.run().t.size == 0
    experiment.advance(0.1)
    experiment.save_moment()
    kept = experiment.state.q
    experiment.apply({"kind": "set", "path": ["law", "terms", 1, "gain"], "value": 3.0})
    experiment.advance(0.2)
    ended = experiment.state.q
    assert experiment.records()[0][-1][0] == pytest.approx(0.2)
    again = replay(experiment.log)
    assert again.state.q.tobytes() == ended.tobytes()
    experiment.go_back()
    assert experiment.state.q.tobytes() == kept.tobytes()
    assert experiment.records()[0][-1][0] == pytest.approx(0.1)
    assert experiment.scenario.law is scenario(1.0).law


def installed(place: Path, *names: str, package: str = "plain-package", engine: str = "ENGINE") -> dict[str, str]:
    """A package that brings engines by entry points, for a process with this environment."""
    about = place / f"{package.replace('-', '_')}-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    points = "".join(f"{name} = tests.engine.outside.plain_verlet:{engine}\n" for name in names)
    (about / "entry_points.txt").write_text(f"[flocking.engines]\n{points}")
    return {**os.environ, "PYTHONPATH": f"{os.environ.get('PYTHONPATH', '')}{os.pathsep}{ROOT}{os.pathsep}{place}"}


def command(environment: dict[str, str], *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "flocking", *words],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_command_line_finds_it_in_an_installed_package(tmp_path: Path) -> None:
    found = installed(tmp_path / "site", NAME)
    file, folder = tmp_path / "ten.toml", tmp_path / "run"
    fk.write_scenario(scenario(0.1), file)
    words = ("run", str(file), "--engine", NAME, "--out", str(folder), "--json")
    made = command(found, *words, "--option", "step=0.005")
    assert made.returncode == 0, made.stderr
    assert json.loads(made.stdout)["provenance"]["engine"] == NAME
    assert_same(fk.read_run(folder), fk.simulate(scenario(0.1), engine=NAME, step=0.005, progress=False))
    audited = command(found, "audit", str(folder))
    assert "ledger residual" in audited.stdout
    assert "Traceback" not in audited.stderr
    wrong = command(found, *words, "--option", "stepp=0.005")
    assert wrong.returncode == 2
    assert "Did you mean step?" in wrong.stderr
    other = command({**found, "PYTHONPATH": str(ROOT / "src")}, *words)
    assert other.returncode == 2
    assert f"must be one of auto, exact, tiles, sampled, delayed, discrete, lammps; got '{NAME}'" in other.stderr


def test_a_run_whose_engine_is_missing_is_read_and_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    keep = saving.SessionWriter.commit_if_due

    def stopping(self: saving.SessionWriter) -> None:
        keep(self)
        raise KeyboardInterrupt

    monkeypatch.setattr(saving.SessionWriter, "commit_if_due", stopping)
    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    assert run(save=tmp_path / "run").status.startswith("interrupted")
    monkeypatch.undo()
    fk.unregister_engine(NAME)
    assert fk.audit(fk.read_run(tmp_path / "run")).results
    said = rf"made by engine='{NAME}', which is not registered. Install the package 'tests'.*can be read without"
    with pytest.raises(EngineMissing, match=said):
        fk.resume(tmp_path / "run", progress=False)
    fk.register_engine(ENGINE)
    assert_same(fk.resume(tmp_path / "run", progress=False), run())
    fk.unregister_engine(NAME)
    assert fk.resume(tmp_path / "run", progress=False).finished
    fk.register_engine(ENGINE)


def test_one_that_fails_midway_keeps_its_last_commit_and_goes_on_once_mended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    step = PlainSession._step

    def failing(self: PlainSession) -> None:
        if self.time > 0.5:
            raise ZeroDivisionError("a fault of its own")
        step(self)

    monkeypatch.setattr(saving, "COMMIT_SECONDS", 0.0)
    monkeypatch.setattr(PlainSession, "_step", failing)
    with pytest.raises(EngineFailed, match=r"engine='plain-verlet' failed: ZeroDivisionError: a fault") as caught:
        run(save=tmp_path / "run")
    assert isinstance(caught.value.__cause__, ZeroDivisionError)
    assert caught.value.run.t[-1] <= 0.51
    assert fk.read_run(tmp_path / "run").status.startswith("stopped: engine='plain-verlet' failed")
    with pytest.raises(EngineFailed, match="a fault of its own"):
        run()
    monkeypatch.setattr(PlainSession, "_step", step)
    assert_same(fk.resume(tmp_path / "run", progress=False), run())


def test_one_that_never_gets_on_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PlainSession, "advance", lambda self, to, seconds: None)
    with pytest.raises(EngineFailed, match="takes no step and does not end"):
        run()


def test_a_wrong_option_names_the_nearest_and_the_engine_that_has_it() -> None:
    with pytest.raises(InvalidInput, match=r"stepp is not known to engine='plain-verlet'.*Did you mean step\? Known"):
        run(stepp=0.1)
    with pytest.raises(InvalidInput, match="threads is only an option of engine='tiles'"):
        run(threads=2)
    with pytest.raises(InvalidInput, match="PlainOptions: step must be greater than 0"):
        run(step=-1.0)
    with pytest.raises(InvalidInput, match="fine is for runs of"):
        run(fine=True)
    with pytest.raises(
        InvalidInput, match=r"one of auto, exact, tiles, sampled, delayed, discrete, lammps, plain-v.*mean plain-verlet"
    ):
        fk.simulate(scenario(), engine="plain-verlt", progress=False)
    first_order = scenario().with_(agents=fk.Agents(order=1))
    with pytest.raises(UnsupportedLaw, match="order 2 alone"):
        fk.simulate(first_order, engine=NAME, progress=False)
    assert "order 2 alone" in ENGINE.why_not(first_order)
    assert ENGINE.why_not(scenario()) == ""


class Another(PlainEngine):
    """An engine of the same name."""


class Exact(PlainEngine):
    name = "exact"


class Auto(PlainEngine):
    name = "auto"


class Bare(PlainEngine):
    name = "bare"
    options = dict


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (Another(), "name must not be that of another engine, which the package tests brings; got 'plain-verlet'"),
        (Exact(), "name must not be that of another engine, which the package flocking brings; got 'exact'"),
        (Auto(), "name must be lower-case letters"),
        (Bare(), "options of engine 'bare' must be a dataclass"),
        (PlainEngine, "must be an instance of"),
    ],
)
def test_what_cannot_be_registered(made: object, said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        fk.register_engine(made)  # type: ignore[arg-type]
    fk.register_engine(ENGINE)  # again, which changes nothing


def test_entry_points_that_collide_are_told_and_what_was_there_stays(tmp_path: Path) -> None:
    places = [tmp_path / name for name in ("one", "two", "three")]
    installed(places[0], "plain-two", package="first-package")
    installed(places[1], "plain-two", package="second-package", engine="OTHER")
    found = installed(places[2], "exact", "Bad Name", package="third-package")
    found["PYTHONPATH"] += "".join(f"{os.pathsep}{place}" for place in places)
    script = "import flocking as fk; fk.simulate(fk.Scenario(fk.Law(fk.Proximity(1), [fk.Consensus(1.0)]), "
    script += "fk.State([[0.0]], [[0.0]]), 1.0), engine='warp')"
    told = subprocess.run(
        [sys.executable, "-c", script], env=found, cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert "'exact' of the package third-package is not used: the package flocking brings one" in told.stderr
    assert "'plain-two' of the package second-package is not used: the package first-package" in told.stderr
    assert "'Bad Name' of the package third-package is not used: its name must be" in told.stderr


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("nowhere.at_all:ENGINE", "cannot be imported: ModuleNotFoundError"),
        ("json:ENGINE", "must be an instance of"),
        ("tests.engine.outside.plain_verlet:ENGINE", "has the name 'plain-verlet'"),
    ],
)
def test_an_entry_point_that_leads_to_no_engine_is_told(target: str, said: str) -> None:
    with pytest.raises(EngineMissing, match=said):
        registry.Entry("broken", target, "some-package").load()


def test_a_session_that_is_none_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(PlainEngine, "open", lambda self, scenario, options, *, plant=None: object())
    with pytest.raises(InvalidInput, match="open must give a flocking"):
        run()


def test_a_damaged_checkpoint_and_that_of_another_engine_are_refused(tmp_path: Path) -> None:
    from flocking.engine.driver.checkpoint import pack, read_checkpoint, restored
    from flocking.engine.protocol.session import Stored
    from flocking.errors import StorageError

    session = fk.start(scenario(1.0), NAME)
    session.advance(0.1)
    data = pack(session)
    with pytest.raises(StorageError, match="engine must be 'exact', not 'plain-verlet'"):
        read_checkpoint(data, "exact", tmp_path)
    numbers, arrays = read_checkpoint(data, NAME, tmp_path)
    stored = Stored(scenario(1.0), None, {}, run)
    assert restored(ENGINE, (numbers, arrays), stored, tmp_path, {}).state.q.tobytes() == session.state.q.tobytes()
    with pytest.raises(StorageError, match="q must have the shape"):
        restored(ENGINE, (numbers, {**arrays, "q": arrays["q"][:4]}), stored, tmp_path, {})


@dataclass(frozen=True)
class Unplain:
    table: object = frozenset({1.0})


def test_options_that_cannot_be_saved_are_told() -> None:
    with pytest.raises(InvalidInput, match="Unplain: table must be plain data to be saved"):
        saving.plain_options(Unplain())


PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("## Adding an engine")[1].split("\n## ")[0]


def test_it_is_written_in_the_number_of_files_that_the_page_says() -> None:
    """One file of the engine's own, which knows the library alone, and the lines of a package that name it."""
    assert "one file" in PAGE
    assert f"{NAME} = " in PAGE.replace('"', "")
    assert '[project.entry-points."flocking.engines"]' in PAGE
    file = Path(sys.modules[PlainEngine.__module__].__file__ or "")
    brought = {
        node.module.partition(".")[0]
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module
    }
    assert "tests" not in brought
    for kind, names in ((Engine, PAGE), (Session, PAGE)):
        missing = [name for name in kind.__abstractmethods__ if f"`{name}`" not in names]
        assert missing == [], kind


def test_engines_are_imported_when_they_are_used() -> None:
    code = (
        "import sys, flocking; flocking.simulate, flocking.resume, flocking.register_engine; "
        "print([m for m in sys.modules if m.startswith('flocking.engine.') and m.split('.')[2] in "
        "('exact', 'tiles', 'lammps', 'kernels')])"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
