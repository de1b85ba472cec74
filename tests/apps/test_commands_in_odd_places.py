"""Commands in odd places: closed streams, readers that leave, signals, strange files."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import flocking as fk
from flocking.apps.cli import main
from flocking.apps.early_signals import INTERRUPTED, SENTENCE
from flocking.apps.standard_streams import printable
from flocking.errors import FormulaError, InvalidInput
from flocking.study.sweeps.sweep_file import read_sweep_file
from tests.engine.storage.stored_runs import scenario
from tests.machines.starting import processor_time_of

COMMAND = f"{sys.executable} -m flocking"


def shell(words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["bash", "-c", words], capture_output=True, text=True)


@pytest.mark.parametrize(
    "words", [f"{COMMAND} list >&-", f"{COMMAND} list | head -1", f"{COMMAND} list <&- >/dev/null"]
)
def test_nobody_reads_what_is_said(words: str) -> None:
    found = shell(words)
    assert found.returncode == 0
    assert found.stderr == ""


def test_errors_do_not_go_to_the_output() -> None:
    found = shell(f"{COMMAND} info nowhere 2>&-")
    assert (found.returncode, found.stdout) == (2, "")


def test_terminal_escapes_are_written_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "evil.toml"
    path.write_text('"\\u001b[2J\\u001b]0;title\\u0007" = 1\n')
    assert main(["run", str(path)]) == 2
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err
    assert "\x07" not in said.out + said.err
    assert printable("a\x1b[2J\x9b\u202eb\n\té") == "a\\x1b[2J\\x9b\\u202eb\n\té"


def test_a_byte_order_mark_is_read_past(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    fk.write_scenario(scenario(), path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert fk.read_scenario(path).name == "ten agents"


@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
def test_only_files_are_read(tmp_path: Path, kind: str) -> None:
    path = {"pipe": tmp_path / "pipe", "device": Path("/dev/zero"), "folder": tmp_path}[kind]
    if kind == "pipe":
        os.mkfifo(path)
    for read in (fk.read_scenario, lambda x: read_sweep_file(x, {})):
        with pytest.raises(InvalidInput, match="a folder" if kind == "folder" else "a pipe, a socket or a device"):
            read(path)


@pytest.mark.parametrize("deepest", [12, 13, 59])
def test_functions_within_functions_are_bounded(deepest: int) -> None:
    begin = time.process_time()
    formula = "exp(" * deepest + "-r" + ")" * deepest
    if deepest == 12:
        fk.Potential(formula)
    else:
        with pytest.raises(FormulaError, match="must not nest more than 12 functions"):
            fk.Potential(formula)
        assert time.process_time() - begin < 0.5


def test_unknown_options_are_called_unknown() -> None:
    for engine in ("exact", "tiles", "lammps"):
        with pytest.raises(InvalidInput, match="delay is not known to"):
            fk.simulate(scenario(), engine=engine, delay=0.1)
    with pytest.raises(InvalidInput, match=r"Did you mean precision\?"):
        fk.simulate(scenario(), engine="tiles", precison="float32")
    with pytest.raises(InvalidInput, match=r"Did you mean progress\?"):
        fk.simulate(scenario(), engine="exact", progres=True)
    with pytest.raises(InvalidInput, match="is only an option of engine='tiles' and engine='lammps'"):
        fk.simulate(scenario(), engine="exact", step=0.1)


def long_run(folder: Path, file: Path, *, background: bool = False) -> subprocess.Popen[str]:
    """A long run that has begun and committed something; a shell would have started it in the background."""
    fk.write_scenario(scenario().with_(t_end=1e5, frames=200_001), file)
    words = [*COMMAND.split(), "run", str(file), "--out", str(folder)]
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=(lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)) if background else None,
    )  # fmt: skip
    while not list(folder.glob("checkpoint-*.npz")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    return process


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signals_end_a_run_with_everything_kept(tmp_path: Path, number: signal.Signals) -> None:
    process = long_run(tmp_path / "run", tmp_path / "long.toml")
    process.send_signal(number)
    process.communicate(timeout=120)
    assert process.returncode == 130
    run = fk.read_run(tmp_path / "run")
    assert run.status.startswith("interrupted at t = ")
    until = float(run.status.removeprefix("interrupted at t = "))
    assert list(run.t) == [0.5 * k for k in range(len(run.t))]
    assert run.t[-1] <= until
    assert len(run.t) > 1 or until < 100.0, "frames follow the steps at some distance"


def test_a_job_in_the_background_hears_sigterm_alone(tmp_path: Path) -> None:
    process = long_run(tmp_path / "run", tmp_path / "long.toml", background=True)
    process.send_signal(signal.SIGINT)  # had it been heard, the next one would be the second
    process.send_signal(signal.SIGTERM)
    said = process.communicate(timeout=120)
    assert process.returncode == 130, said
    assert fk.read_run(tmp_path / "run").status.startswith("interrupted at t = ")


HOLDING = """
import time
from flocking.apps import cli, signal_handlers
from flocking.engine import interruption
with signal_handlers.ended_by_signals(), interruption.Deferred():
    print("begun", flush=True)
    while not interruption.noted():
        time.sleep(0.01)
    print("noted", flush=True)
    sum(range(10**12))  # within it no handler of Python runs
"""


def test_a_second_interrupt_ends_at_once() -> None:
    with subprocess.Popen([sys.executable, "-c", HOLDING], stdout=subprocess.PIPE, text=True) as held:
        assert held.stdout is not None
        assert held.stdout.readline() == "begun\n"
        held.send_signal(signal.SIGINT)
        assert held.stdout.readline() == "noted\n"
        used = processor_time_of(held.pid)
        while processor_time_of(held.pid) < used + 0.1:
            time.sleep(0.01)
        held.send_signal(signal.SIGINT)
        try:
            assert held.wait(timeout=60) == -signal.SIGINT
        finally:
            held.kill()


def test_a_place_that_cannot_be_written_is_refused_before_anything_is_run(capsys: pytest.CaptureFixture[str]) -> None:
    for command, name in (("plot", "net.svg"), ("animate", "film.gif")):
        assert main([command, "nowhere", "--out", f"/proc/{name}"]) == 2
        assert f"path must be writable (No such file or directory); got '/proc/{name}'" in capsys.readouterr().err


LOGGED = """
import logging, sys
from flocking.apps import cli
sys.argv = ["flocking", "schema"]
cli.main()
logging.getLogger("library").warning("a folder could not be made")
"""


def test_what_libraries_log_is_not_shown() -> None:
    found = subprocess.run([sys.executable, "-c", LOGGED], capture_output=True, text=True)
    assert (found.returncode, found.stderr) == (0, "")


TURNED = """
import os, signal
from flocking.apps import cli

def command_line():
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except KeyboardInterrupt:
        pass
    raise {error}

class App:
    def parse_args(self, *given, **options):
        command_line()

cli.command_line = App
raise SystemExit(cli.main(["list"]))
"""


@pytest.mark.parametrize(
    ("error", "said"),
    [
        ("RuntimeError('Error building a serializer: KeyboardInterrupt')", SENTENCE),
        ("MemoryError", "flocking: interrupted; the operation under way ended with: this needs more memory"),
        (
            "OSError(5, 'Input/output error')",
            "flocking: interrupted; the operation under way ended with: Input/output error.",
        ),
    ],
)
def test_an_interrupt_that_a_compiled_library_made_its_own_error_of_is_one(error: str, said: str) -> None:
    """As some do that call back into Python."""
    found = subprocess.run([sys.executable, "-c", TURNED.format(error=error)], capture_output=True, text=True)
    assert (found.returncode, found.stderr[: len(said)]) == (INTERRUPTED, said)


DROPPED = """
import io, os, signal, sys, time
from flocking.apps import cli

def struck():
    os.kill(os.getpid(), signal.{number})
    time.sleep(0)

class Closed(io.RawIOBase):
    def close(self):
        if not self.closed:
            struck()
        super().close()

class Called:
    def __del__(self):
        struck()

def closed():
    Closed()

def called():
    Called()

def caught():
    try:
        struck()
    except BaseException:
        pass

class App:
    def parse_args(self, *given, **options):
        {where}()
        print("goes on", flush=True)
        while True:
            time.sleep(0.01)

cli.command_line = App
sys.argv = ["flocking", "list"]
sys.exit(cli.main())
"""


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("where", ["closed", "called", "caught"])
def test_an_interrupt_that_was_dropped_is_raised_again(where: str, number: str) -> None:
    """Python drops it where a file or an object that nobody holds is destroyed, and a library where it likes."""
    program = DROPPED.format(where=where, number=number)
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert (found.returncode, found.stderr, found.stdout) == (INTERRUPTED, SENTENCE + "\n", "goes on\n")


IMPORTING = """
import os, signal, sys

class Struck:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.{number})

sys.meta_path.insert(0, Struck())
from flocking.__main__ import main
sys.argv = ["flocking", "run", {file!r}]
sys.exit(main())
"""


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("module", ["flocking.apps.cli", "cyclopts", "flocking.model.library", "tomllib", "llvmlite"])
def test_a_signal_while_modules_are_imported_ends_quietly(tmp_path: Path, module: str, number: str) -> None:
    fk.write_scenario(scenario(), tmp_path / "scenario.toml")
    program = IMPORTING.format(module=module, number=number, file=str(tmp_path / "scenario.toml"))
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert found.returncode == INTERRUPTED
    if module == "llvmlite" and found.stderr.startswith("flocking: interrupted at t = 0: "):
        # The run had begun: an interrupt that the import drops is raised again a little later.
        assert found.stderr.count("\n") == 1
    else:
        assert (found.stderr, found.stdout) == (SENTENCE + "\n", "")


def test_the_command_line_shows_it_and_hides_warnings_of_libraries() -> None:
    code = "; ".join(
        (
            "import warnings", "from flocking.apps.standard_streams import quiet_warnings",
            "from flocking.errors import HardlyAdvances", "quiet_warnings()", "warnings.warn('of a library')",
            "warnings.warn('it hardly advances', HardlyAdvances)",
        )
    )  # fmt: skip
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stderr == "flocking: it hardly advances\n"
