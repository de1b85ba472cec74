"""Break the homes of rows from the command line: ``python -m tests.papers.broken [--paper KEY] [--row NUMBER]``."""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from collections.abc import Iterable, Iterator

from tests.papers.broken.running import Outcome, break_row, warmed
from tests.papers.rows import ROWS


def _one(given: tuple[int, int | None]) -> Outcome:
    position, most = given
    return break_row(ROWS[position], most=most)


def outcomes(positions: Iterable[int], most: int | None, processes: int = 2) -> Iterator[Outcome]:
    """What became of the faults of some rows, given by their positions in the list of all rows."""
    warmed()
    work = [(k, most) for k in positions]
    if processes == 1:
        yield from map(_one, work)
        return
    with multiprocessing.get_context("fork").Pool(processes) as pool:
        yield from pool.imap(_one, work, chunksize=4)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--paper", default="", help="key of a paper, or its beginning")
    parser.add_argument("--row", action="append", help="number of a row, or its beginning")
    parser.add_argument("--home", help="part of the homes' names")
    parser.add_argument("--once", action="store_true", help="one row for each home")
    parser.add_argument("--most", type=int, help="faults to try for each row")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--quiet", action="store_true", help="list rows with survivors only")
    given = parser.parse_args()
    wanted = [
        k
        for k, row in enumerate(ROWS)
        if row.paper.startswith(given.paper) and (not given.row or any(row.number.startswith(n) for n in given.row))
    ]
    wanted = [k for k in wanted if not given.home or given.home in ROWS[k].home]
    if given.once:
        wanted = list({ROWS[k].home: k for k in wanted}.values())
    began, alive, tried = time.perf_counter(), 0, 0
    for outcome in outcomes(wanted, given.most, given.processes):
        alive += len(outcome.survivors)
        tried += outcome.tried
        if outcome.survivors or not given.quiet:
            print(f"{outcome.row} ({outcome.home.removeprefix('flocking.')}): "
                  f"{len(outcome.survivors)} of {outcome.tried} survive, {len(outcome.equivalent)} equivalent, "
                  f"{outcome.possible} known, {outcome.seconds:.1f} s")  # fmt: skip
            for line in outcome.survivors:
                print("    ", line)
            sys.stdout.flush()
    print(f"{len(wanted)} rows, {tried} faults, {alive} survivors, {time.perf_counter() - began:.0f} s")
    return 1 if alive else 0


if __name__ == "__main__":
    sys.exit(main())
