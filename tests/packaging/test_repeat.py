"""`make repeat` repeats every test whose outcome could depend on time, other processes, threads or signals."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

TIMING = re.compile(
    r"^\s*(import|from) (time|threading|signal|socket|subprocess|multiprocessing|concurrent|asyncio|pty)\b"
    r"|\b(threads|workers)=([2-9]|None)",
    re.MULTILINE,
)
"""What a test needs that depends on time: a clock, another process, a thread, a signal or a socket."""

LEFT_OUT = {
    "tests/conftest.py": "no tests",
    "tests/contracts/test_own_bodies.py": "runs a program to its end, without limit",
    "tests/contracts/test_own_parts.py": "runs a program to its end, without limit",
    "tests/engine/c_export": "runs compilers to their end, without limit",
    "tests/engine/exact/test_first_frame.py": "runs programs to their end, without limit",
    "tests/engine/exact/events/loop_faults.py": "no tests: runs tests to their end, without limit",
    "tests/engine/storage/storage_victim.py": "no tests: part of test_storage_kill.py",
    "tests/engine/storage/test_scenario_sums.py": "runs programs to their end, without limit",
    "tests/engine/storage/test_storage.py": "a signal at an instruction, without a clock",
    "tests/counting.py": "no tests: adds up processor time, which is stated and not judged",
    "tests/formula/test_growth.py": "under limits of processor time",
    "tests/interrupting.py": "no tests: a signal at an instruction, without a clock",
    "tests/mpi": "make test-mpi",
    "tests/packaging": "builds the package, without limit",
    "tests/papers/broken": "no tests: faults for test_broken_homes.py, under a limit of processor time",
    "tests/papers/homes/vicsek.py": "no tests: numbers of threads, whose results are compared",
    "tests/papers/test_own_paper.py": "runs a program to its end, without limit",
    "tests/repeat.py": "no tests: runs the repetitions",
    "tests/show/test_notebook_in_browser.py": "make test-browser; waits for what a page shows, for a minute at most",
    "tests/show/test_output.py": "runs programs to their end, without limit",
    "tests/study/certificates/assumptions": "under limits of processor time",
    "tests/study/certificates/random_promises.py": "no tests: a program that goes on until it is stopped",
    "tests/test_floors.py": "runs ruff to its end, without limit",
    "tests/validation": "clocks are printed, not judged",
}
"""Files and folders that are not repeated, with the reason."""


def covered(path: str, places: set[str]) -> bool:
    return any(path == place or path.startswith(f"{place}/") for place in places)


def test_every_test_that_could_depend_on_time_is_repeated_or_left_out_for_a_reason() -> None:
    makefile = (ROOT / "Makefile").read_text().replace("\\\n", " ")
    found = re.search(r"^TIMED := (.*)$", makefile, re.MULTILINE)
    assert found
    repeated = set(found[1].split())
    assert all((ROOT / place).exists() for place in repeated | set(LEFT_OUT))
    files = [path.relative_to(ROOT).as_posix() for path in (ROOT / "tests").rglob("*.py")]
    timed = {file for file in files if TIMING.search((ROOT / file).read_text())}
    assert len(timed) > 50
    assert [file for file in sorted(timed) if not covered(file, repeated | set(LEFT_OUT))] == []
    assert [place for place in LEFT_OUT if not any(covered(file, {place}) for file in timed)] == []
