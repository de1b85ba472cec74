"""``python -m tests.repeat PATH...``: runs tests many times, several repetitions side by side, and counts what fails.

Repetitions are each other's load. Where fewer are left than run at once, processes that only compute take their places,
so that the load stays until the last one ends.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from queue import Empty, SimpleQueue

FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)
"""How pytest names what failed, at its end."""


def repeated(tests: Sequence[str], times: int, load: int, logs: Path) -> Counter[str]:
    """Run tests many times; returns how often each failed.

    Parameters
    ----------
    tests
        Paths, and further arguments of pytest.
    times
        Number of repetitions.
    load
        Number of processes that are busy all the time.
    logs
        Folder for what the repetitions print.
    """
    logs.mkdir(parents=True, exist_ok=True)
    waiting: SimpleQueue[int] = SimpleQueue()
    for k in range(times):
        waiting.put(k)
    failed: Counter[str] = Counter()
    with ExitStack() as busy, ThreadPoolExecutor(load) as slots:

        def fill() -> list[str]:
            """Repeat until nothing is left, and be busy then."""
            found: list[str] = []
            while True:
                try:
                    k = waiting.get_nowait()
                except Empty:
                    process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
                    busy.callback(process.kill)
                    return found
                log = logs / f"{k + 1}.log"
                with log.open("w") as out:
                    command = [sys.executable, "-m", "pytest", "-q", "-rfE", "-p", "no:xdist", *tests]
                    code = subprocess.run(command, stdout=out, stderr=subprocess.STDOUT, check=False).returncode
                names = FAILED.findall(log.read_text())
                if code and not names:
                    names = [f"{log} (exit code {code})"]
                found += names
                print(f"repetition {k + 1}: {', '.join(names) or 'passed'}", flush=True)

        for names in [slots.submit(fill) for _ in range(load)]:
            failed.update(names.result())
    return failed


def main() -> int:
    """The command line; exits with 1 if anything ever failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=20)
    parser.add_argument("--load", type=int, default=6)
    parser.add_argument("--logs", type=Path, default=Path("out/repeat"))
    given, tests = parser.parse_known_args()
    failed = repeated(tests, given.times, given.load, given.logs)
    for name, count in failed.most_common():
        print(f"{name} failed {count} of {given.times} times; see {given.logs}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
