"""How commands end, where the machine is slow or a signal comes at a bad moment."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import flocking as fk
from flocking.apps.early_signals import SENTENCE
from tests.engine.storage.stored_runs import finished

BUSY = """
import sys, time
import zarr.core.sync as sync
from flocking.engine.storage.stored_runs import read_run
read_run(sys.argv[1])
sync.loop[0].call_soon_threadsafe(time.sleep, 1.0)
"""


def test_the_end_waits_for_the_thread_of_zarr(whole: Path) -> None:
    found = subprocess.run([sys.executable, "-c", BUSY, str(whole)], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (0, "")


LOST = """
import signal, sys, time
from flocking.apps.signal_handlers import ended_by_signals
class Late:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
        time.sleep(0)
with ended_by_signals():
    try:
        Late()
        for k in range(6000):
            time.sleep(0.01)
    except KeyboardInterrupt:
        print("interrupted")
"""


def test_an_interrupt_that_falls_into_a_destructor_is_not_lost() -> None:
    found = subprocess.run([sys.executable, "-c", LOST], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stdout, found.stderr) == (0, "interrupted\n", "")


DEAF = """
import os, signal, threading
from flocking.apps.signal_handlers import ended_by_signals
from flocking.study.sweeps.worker_pool import without_interrupts
for number in (signal.SIGTERM, signal.SIGINT):
    with ended_by_signals():
        try:
            with without_interrupts():
                os.kill(os.getpid(), number)
                print("begun")
            threading.Event().wait(60)
        except KeyboardInterrupt:
            print("interrupted")
"""


def test_a_signal_while_worker_processes_begin_waits_until_they_have() -> None:
    found = subprocess.run([sys.executable, "-c", DEAF], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stdout, found.stderr) == (0, 2 * "begun\ninterrupted\n", "")


IMPORTED = """
import os, signal, sys, time
from flocking.apps.signal_handlers import ended_by_signals
said = []
with ended_by_signals():
    try:
        import struck
        said.append("went on")
        time.sleep(1.0)
    except KeyboardInterrupt:
        print("interrupted", *said, *sorted(name for name in sys.modules if name.startswith("struck")), sys.gettrace())
"""

STRUCK = """
import os, signal, time
os.kill(os.getpid(), signal.{number})
begin = time.monotonic()
while time.monotonic() < begin + 0.05:
    pass
import struck_too
"""


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_a_signal_amid_an_import_ends_right_after_it(tmp_path: Path, number: str) -> None:
    """However long the next import takes to begin: no later moment has to be found."""
    (tmp_path / "struck.py").write_text(STRUCK.format(number=number))
    (tmp_path / "struck_too.py").write_text("")
    found = subprocess.run(
        [sys.executable, "-c", IMPORTED], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *filter(None, sys.path)])},
    )  # fmt: skip
    assert (found.returncode, found.stdout, found.stderr) == (0, "interrupted struck struck_too None\n", "")


HALF = """
import signal, sys
from flocking.apps.signal_handlers import ended_by_signals
class Half:
    def __init__(self):
        signal.raise_signal(signal.SIGINT)
        self.handle = 1
    def __del__(self):
        self.handle
kept = []
with ended_by_signals(for_good=True) as handlers:
    try:
        handlers.begun = True
        Half()
    except KeyboardInterrupt as error:
        print("interrupted")
        kept = [error] if sys.argv[1] == "late" else []
"""


@pytest.mark.parametrize("when", ["soon", "late"])
def test_what_an_interrupt_left_half_made_goes_quietly(when: str) -> None:
    found = subprocess.run([sys.executable, "-c", HALF, when], capture_output=True, text=True, check=False)
    assert (found.returncode, found.stdout, found.stderr) == (0, "interrupted\n", "")


LAST = """
import os, signal

def last(kill=os.kill, process=os.getpid(), number=signal.{number}):
    kill(process, number)

{act}
"""

TEXT = """
import json

def dumps(*given, **options):
    # As where a class of records is made.
    exec("last()\\nfor k in range(1000): pass", {"last": last})

json.dumps = dumps
"""

DROPPED = """
import json, sys, time

json.dumps = lambda *given, **options: time.sleep(60)

class Struck:
    def find_spec(self, name, path=None, target=None):
        if name == "flocking.formula.cache":
            try:
                last()
                for k in range(1000): pass
            except:
                pass

sys.meta_path.insert(0, Struck())
"""

AT_THE_END = """
import sys

class Late:
    def __del__(self, last=last):
        last()

sys.late = Late()
"""


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize(
    ("act", "code"),
    [(TEXT, 130), (DROPPED, 130), (AT_THE_END, 0)],
    ids=["amid text that is executed", "while a library drops it", "while Python takes itself down"],
)
def test_the_exit_code_is_that_of_the_command(tmp_path: Path, number: str, act: str, code: int) -> None:
    (tmp_path / "sitecustomize.py").write_text(LAST.format(number=number, act=act))
    found = subprocess.run(
        [sys.executable, "-m", "flocking", "cache", "--json"], capture_output=True, text=True, check=False,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *filter(None, sys.path)])},
    )  # fmt: skip
    assert found.returncode == code, found.stderr
    assert found.stderr == (f"{SENTENCE}\n" if code else "")


BETWEEN = """
import os, signal, sys
from flocking.__main__ import main
from flocking.apps import cli
sys.argv = ["flocking", "cache"]
change = signal.signal
for moment in range(2, 9):  # once SIGTERM has a handler
    calls = 0

    def changed(*given):
        global calls
        found = change(*given)
        calls += 1
        if calls == moment:
            os.kill(os.getpid(), signal.{number})
        return found

    child = os.fork()
    if child == 0:
        signal.signal = changed
        code = main()
        sys.stdout.flush()
        os._exit(code)
    print("code", os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.mark.parametrize("number", ["SIGINT", "SIGTERM"])
def test_a_signal_while_handlers_are_changed_ends_quietly(number: str) -> None:
    words = [sys.executable, "-c", BETWEEN.format(number=number)]
    found = subprocess.run(words, capture_output=True, text=True, check=False)
    codes = [line for line in found.stdout.splitlines() if line.startswith("code")]
    early = codes.count("code 130")
    assert codes.count("code 0") + early == 7, found.stdout + found.stderr
    assert early >= 3
    assert set(found.stderr.splitlines()) == {SENTENCE}


AFTER = """
import os, signal, sys, time
from flocking.apps import cli
sys.argv = ["flocking", "cache"]
cli.main()
os.kill(os.getpid(), {number})
time.sleep(60)
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_after_the_work_ends_quietly(number: signal.Signals) -> None:
    words = [sys.executable, "-c", AFTER.format(number=int(number))]
    found = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (130, "")


def test_an_interrupt_before_the_first_picture_of_a_film_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("matplotlib.animation.PillowWriter.grab_frame", stop)
    with pytest.raises((KeyboardInterrupt, IndexError)) as caught:
        fk.animate(finished(), tmp_path / "film.gif", seconds=0.1)
    assert caught.type is KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []
