"""Random scenarios of all kinds of certificate, run and held against what was promised.

``python -m tests.study.certificates.random_promises FOLDER [PART OF]`` goes through all scenarios, stores one line for
each in the folder, and skips those that are there already; with ``1 2`` and ``2 2`` two processes share the work. On
cores that are shared ``OMP_NUM_THREADS=1`` keeps threads of linear algebra from waiting for each other. It
prints counts, broken promises and the median tightness of every certificate at the end, and with the folder alone
named last after ``report`` what is stored so far.
"""

from __future__ import annotations

import json
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

import flocking as fk
from flocking.errors import UnsupportedLaw
from flocking.study.certificates.certify import certify
from flocking.study.certificates.comparison import Comparison, compare
from tests.study.certificates.draws import STRUCTURES
from tests.study.certificates.fates import fates
from tests.study.certificates.random_scenarios import NUMBERS, random_scenario

UNSTATED = 1e-6
"""Relative excess that the errors of a run without stated errors explain: its tolerance is 1e-9."""

SECONDS = 0.25
"""Processor time after which a run is cut short; what it shows until then is held against what was promised."""


CONTRARY = ("it does not fall", "it is not stable")
"""Reasons that say what a run will do although nothing is granted."""


@dataclass
class Judged:
    """One scenario, certified and run.

    Parameters
    ----------
    kind, number
        Which scenario.
    granted
        Keys of the certificates that were granted.
    held
        Key and tightness of every promise that the run was held against; the tightness may be unknown.
    broken
        Key and description of every promise that the run broke.
    ended
        Kind of the error that ended it; empty where none did.
    ran
        Whether a run, or a part of one, was there to be compared.
    cut
        Whether the run was cut short to save time.
    """

    kind: str
    number: int
    granted: list[str] = field(default_factory=list)
    held: list[tuple[str, float | None]] = field(default_factory=list)
    broken: list[tuple[str, str]] = field(default_factory=list)
    ended: str = ""
    ran: bool = False
    cut: bool = False


def judged(kind: str, number: int) -> Judged:
    """Certify and run one scenario."""
    found = Judged(kind, number)
    try:
        scenario = random_scenario(kind, number)
    except fk.InvalidInput as error:
        found.ended = f"scenario: {type(error).__name__}"
        return found
    certificates = certify(scenario)
    found.granted = [c.key for c in certificates.granted]
    if not found.granted and not any(words in c.reason for c in certificates for words in CONTRARY):
        # Nothing is promised, so that nothing can be broken.
        return found
    run = _run(scenario, found)
    if run is None or not len(run.t):
        return found
    found.ran = True
    for row in compare(certificates, run):
        found.held.append((row.key, row.tightness))
        if row.kept is False or (row.kept is None and beyond(row)):
            found.broken.append((row.key, f"promised {row.promised:.12g}, observed {row.observed:.12g}"))
    for fate in fates(certificates, run):
        found.held.append((fate.key, fate.tightness))
        if not fate.kept:
            found.broken.append((fate.key, fate.words))
    return found


def _run(scenario: fk.Scenario, found: Judged) -> fk.Run | None:
    try:
        # What happens between frames is told by fine samples of the exact engine.
        session = fk.start(scenario, **({"fine": True} if found.kind == "obstructed" else {}))
        try:
            begin = time.process_time()
            while not session.reached(scenario.t_end):
                session.advance(scenario.t_end, 0.5)
                if time.process_time() - begin > SECONDS and not session.reached(scenario.t_end):
                    found.cut = True
                    return session.run("cut short")
            return session.run()
        finally:
            session.close()
    except fk.SimulationError as error:
        found.ended = type(error).__name__
        return error.run
    except (fk.InvalidInput, UnsupportedLaw) as error:
        found.ended = type(error).__name__
        return None


def beyond(row: Comparison) -> bool:
    """Whether a promise is broken by more than errors of the run explain that it does not state."""
    return abs(row.observed - row.promised) > UNSTATED * max(abs(row.promised), 1.0)


def tally(rows: Iterable[Judged]) -> str:
    """Counts, broken promises and median tightness of scenarios that were judged."""
    rows = list(rows)
    granted, held, tightness = Counter[str](), Counter[str](), defaultdict(list)
    kinds, ended = Counter(r.kind for r in rows), Counter(r.ended for r in rows if r.ended)
    for row in rows:
        granted.update(row.granted)
        for key, value in row.held:
            held[key] += 1
            if value is not None and np.isfinite(value):
                tightness[key].append(value)
    empty = sum(not r.ran and not r.ended for r in rows)
    broken = [(r.kind, r.number, *each) for r in rows for each in r.broken]
    of_kinds = ", ".join(f"{kind} {count}" for kind, count in sorted(kinds.items()))
    lines = [
        f"{len(rows)} scenarios ({of_kinds}): {sum(r.ran for r in rows)} with runs, "
        f"{sum(r.cut for r in rows)} of which were cut short; {empty} without a promise; "
        f"{sum(held.values())} promises held against runs; "
        f"{len(broken)} broken; ended by errors: {dict(ended)}"
    ]
    for key, count in sorted(granted.items()):
        values = tightness[key]
        median = f"{np.median(values):.3f}" if values else "-"
        lines.append(f"| `{key}` | {count} | {held[key]} | {median} |")
    return "\n".join([*lines, *(f"BROKEN {each}" for each in broken)])


def stored(folder: Path) -> list[Judged]:
    """What is stored in a folder."""
    lines = [line for path in sorted(folder.glob("*.jsonl")) for line in path.read_text().splitlines()]
    return [Judged(**json.loads(line)) for line in lines]


def go(folder: Path, part: int = 1, of: int = 1, kinds: Iterable[str] = tuple(NUMBERS)) -> None:
    """Judge all scenarios of some kinds that are not stored yet, one structure after the other."""
    folder.mkdir(parents=True, exist_ok=True)
    done = {(row.kind, row.number) for row in stored(folder)}
    # All kinds advance together, structure by structure, so that a part of it is a fair draw.
    wanted = [
        (kind, number)
        for structure in range(part - 1, STRUCTURES, of)
        for kind in kinds
        for number in range(structure, NUMBERS[kind], STRUCTURES)
    ]  # fmt: skip
    with (folder / f"part-{part}-of-{of}.jsonl").open("a") as out:
        for kind, number in wanted:
            if (kind, number) not in done:
                found = judged(kind, number)
                out.write(json.dumps(asdict(found)) + "\n")
                out.flush()


if __name__ == "__main__":
    if sys.argv[1] == "report":
        print(tally(stored(Path(sys.argv[2]))))
    else:
        part, of = (int(x) for x in sys.argv[2:4]) if len(sys.argv) > 3 else (1, 1)
        go(Path(sys.argv[1]), part, of, sys.argv[4].split(",") if len(sys.argv) > 4 else tuple(NUMBERS))
        print(tally(stored(Path(sys.argv[1]))))
