"""Break the homes of rows from the command line: ``python -m tests.papers.broken [--paper KEY] [--home NAME]``."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator, Sequence
from functools import partial

from tests.papers.broken.running import Outcome, break_home, warmed
from tests.papers.transcriptions.rows import ROWS


def homes(paper: str = "", part: str = "", numbers: Sequence[str] = ("",)) -> list[str]:
    """Homes of the rows whose papers and numbers begin so, those with this part in their names."""
    chosen = (r for r in ROWS if r.paper.startswith(paper) and r.number.startswith(tuple(numbers)))
    return list(dict.fromkeys(r.home for r in chosen if part in r.home))


def outcomes(wanted: Sequence[str], most: int | None = None, processes: int = 2) -> Iterator[Outcome]:
    """What became of the faults of some homes, in the order in which they are done."""
    warmed()
    work = partial(break_home, most=most)
    if processes == 1:
        yield from map(work, wanted)
        return
    with multiprocessing.get_context("fork").Pool(processes) as pool:
        yield from pool.imap_unordered(work, wanted)


def told(outcome: Outcome) -> str:
    """What became of the faults of a home, in words."""
    head = (
        f"{outcome.home.removeprefix('flocking.')} ({len(outcome.rows)} rows): {len(outcome.survivors)} of "
        f"{outcome.tried} survive, {len(outcome.by_a_row)} noticed by a row alone, {len(outcome.equivalent)} "
        f"equivalent, {outcome.possible} known, {outcome.seconds:.1f} s"
    )
    return "\n      ".join([head, *outcome.survivors])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--paper", default="", help="key of a paper, or its beginning")
    parser.add_argument("--row", action="append", help="number of a row, or its beginning")
    parser.add_argument("--home", default="", help="part of the homes' names")
    parser.add_argument("--most", type=int, help="faults to try for each home")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--quiet", action="store_true", help="list homes with survivors only")
    parser.add_argument("--equivalent", action="store_true", help="list the faults that change nothing")
    given = parser.parse_args()
    wanted = homes(given.paper, given.home, given.row or ("",))
    began, alive, tried, spent = time.perf_counter(), 0, 0, 0.0
    for outcome in outcomes(wanted, given.most, given.processes):
        alive += len(outcome.survivors)
        tried += outcome.tried
        spent += outcome.seconds
        if outcome.survivors or not given.quiet:
            print(told(outcome))
            for line in outcome.equivalent if given.equivalent else ():
                print("     ", line)
            sys.stdout.flush()
    print(f"{len(wanted)} homes, {tried} faults, {alive} survivors, {time.perf_counter() - began:.0f} s, "
          f"{spent:.0f} s of processor time")  # fmt: skip
    return 1 if alive else 0


if __name__ == "__main__":
    sys.exit(main())
