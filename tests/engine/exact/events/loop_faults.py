# ruff: noqa: E501
"""Deliberate faults in the native loop of the exact engine, and a program that tries which of them the tests notice.

    python -m tests.engine.exact.events.loop_faults [--only 3,17] [TESTS ...]

Each fault is applied to a copy of the library with a cache of its own, whose native functions are compiled anew, and the
tests run until one fails, or does not end or takes all of the memory that it may use: that is noticed, too. It takes
minutes a fault: it is no part of the default tests, which only see that every fault still applies.
"""

from __future__ import annotations

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[4]
ENGINE = Path("src/flocking/engine/exact")
TESTS = ("tests/engine/exact",)

LONGEST = 1200.0
"""Seconds after which a test counts as one that does not end; all of them take a third of that."""

MEMORY = 4 << 30
"""Most bytes of address space of the tests."""


class Fault(NamedTuple):
    """What is wrong, the file below the folder of the engine, and the text that another one replaces."""

    name: str
    file: str
    before: str
    after: str


FAULTS = (
    Fault(
        "late switch: the step is cut a little behind the crossing",
        "blocks/tried_steps.py",
        "stop = t + first * (stop - t)",
        "first = min(1.0, first + 1e-7)\n            stop = t + first * (stop - t)",
    ),
    Fault(
        "later crossings of the step count as the first",
        "blocks/tried_steps.py",
        "if crossed[k, 1] <= first + TIE:",
        "if crossed[k, 1] <= first + 1e-3:",
    ),
    Fault(
        "a lost link across a barrier is not refused",
        "blocks/tried_steps.py",
        "return REFUSED, first",
        "pass",
    ),
    Fault(
        "missed guard: the last pair watch is not looked at",
        "blocks/tried_steps.py",
        "    for w in range(pairs.enter.shape[0] + balls.levels.shape[0]):\n        if w < pairs",
        "    for w in range(pairs.enter.shape[0] - 1 + balls.levels.shape[0]):\n        if w < pairs",
    ),
    Fault(
        "obstacle guard forgotten",
        "blocks/tried_steps.py",
        "for w in range(pairs.enter.shape[0] + balls.levels.shape[0]):\n        if w < pairs",
        "for w in range(pairs.enter.shape[0]):\n        if w < pairs",
    ),
    Fault(
        "wrong sign: the speed of a crossing",
        "blocks/switches.py",
        "rows[s, SPEED], rows[s, RELATIVE], rows[s, LATE], rows[s, DRIFT] = speed,",
        "rows[s, SPEED], rows[s, RELATIVE], rows[s, LATE], rows[s, DRIFT] = -speed,",
    ),
    Fault(
        "inward taken for outward",
        "blocks/switches.py",
        "0.0 if pairs.near[w, i, j] else 1.0, delay",
        "1.0 if pairs.near[w, i, j] else 0.0, delay",
    ),
    Fault(
        "a rejected step is kept",
        "blocks/tried_steps.py",
        "while not error < 1.0 and length >= shortest:",
        "while not error < 1e6 and length >= shortest:",
    ),
    Fault(
        "a rejected step is fine",
        "blocks/tried_steps.py",
        "fine = error < 1.0",
        "fine = error < 1e3",
    ),
    Fault(
        "stale first stage after a step",
        "blocks/tried_steps.py",
        "solution.y[c], solution.slope[c] = work.new[c], work.fresh[c]",
        "solution.y[c] = work.new[c]",
    ),
    Fault(
        "stale first stage after a switch",
        "blocks/switches.py",
        "        solution.slope[c] = work.K[0, c]\n",
        "        solution.slope[c] = solution.slope[c]\n",
    ),
    Fault(
        "saltation rule forgotten",
        "blocks/switches.py",
        "(work.velocities[0, c] - work.K[0, c]) * delay",
        "0.0 * delay",
    ),
    Fault(
        "saltation rule with the wrong sign",
        "blocks/switches.py",
        "+= (work.velocities[0, c] - work.K[0, c]) * delay",
        "-= (work.velocities[0, c] - work.K[0, c]) * delay",
    ),
    Fault(
        "ledger row of a jump dropped",
        "blocks/loop.py",
        "                rows = add_step(records, rows, solution, switched, 0.0)\n",
        "",
    ),
    Fault(
        "jump of the energy not counted",
        "blocks/loop.py",
        "switched.jumped[0] += energy - progress[ENERGY]",
        "switched.jumped[0] += 0.0",
    ),
    Fault(
        "ledger row of a step dropped every eighth time",
        "blocks/loop.py",
        "        rows = add_step(records, rows, solution, switched, stop - t)\n",
        "        if taken % 8 != 0:\n            rows = add_step(records, rows, solution, switched, stop - t)\n",
    ),
    Fault(
        "list of nearby pairs: horizon too long",
        "crossings/nearby_pairs.py",
        "if made and 2.0 * farthest * (1.0 + ROUNDED) <= bounds[SKIN]:",
        "if made and 2.0 * farthest * (1.0 + ROUNDED) <= 3.0 * bounds[SKIN]:",
    ),
    Fault(
        "list of nearby pairs: factor 2 of the skin forgotten",
        "crossings/nearby_pairs.py",
        "if made and 2.0 * farthest * (1.0 + ROUNDED)",
        "if made and farthest * (1.0 + ROUNDED)",
    ),
    Fault(
        "list of nearby pairs: displacements forgotten",
        "crossings/nearby_pairs.py",
        "nearby.moved[i] += far[i]",
        "nearby.moved[i] = far[i]",
    ),
    Fault(
        "list of nearby pairs: linked ones left out",
        "crossings/nearby_pairs.py",
        "marks_of_pair(watches.near, i, j) + marks_of_pair(linked, i, j) > 0\n            close = close or marks_of_pair(watches.near, j, i) + marks_of_pair(linked, j, i) > 0",
        "marks_of_pair(watches.near, i, j) > 0\n            close = close or marks_of_pair(watches.near, j, i) > 0",
    ),
    Fault(
        "retake skipped: doubts are never there",
        "blocks/loop.py",
        "if not room or not leaves_no_doubt(watches, switched, solution, work, count, pairs, q_floor):",
        "leaves_no_doubt(watches, switched, solution, work, count, pairs, q_floor)\n        if not room:",
    ),
    Fault(
        "a near miss is no doubt",
        "blocks/doubts.py",
        "            if not known or rows[k, 5] == 0.0:\n                return False",
        "            if False:\n                return False",
    ),
    Fault(
        "fresh pair back at once is no doubt",
        "blocks/doubts.py",
        "        elif back <= 1.0:\n            return False",
        "        elif back > 1.0:\n            fresh[f, LEFT_AT] = NEVER",
    ),
    Fault(
        "closest approach between samples missed",
        "crossings/guards.py",
        "            value, x = smallest_value(square, found[row, 0])\n            if x <= 1.0:",
        "            value, x = smallest_value(square, found[row, 0])\n            if x == 0.0 or x == 1.0:",
    ),
    Fault(
        "frame interpolated on the companion difference",
        "blocks/loop.py",
        "            frame[c] = work.part[DEGREE, c]",
        "            frame[c] = work.part[DEGREE - 1, c]",
    ),
    Fault(
        "frame's place from the uncut step",
        "blocks/loop.py",
        "(time - t) / (stop - t), work.part)",
        "(time - t) / (1.01 * (stop - t)), work.part)",
    ),
    Fault(
        "frame at a switch shows the links after it",
        "blocks/loop.py",
        "        for f in range(shown, due):\n            make_frame",
        "        if count > 0:\n            copy_links(switching.linked[0], work.linked)\n        for f in range(shown, due):\n            make_frame",
    ),
    Fault(
        "links for frames and extremes do not follow a switch",
        "blocks/loop.py",
        "            copy_links_of(solution.crossed, count, watches.pairs, switching.linked[0], work.linked)\n",
        "",
    ),
    Fault(
        "both directions of a link: only one switches",
        "blocks/switches.py",
        "        if both:\n            switching.linked[g, j, i] = now\n",
        "        if both:\n            switching.linked[g, j, i] = switching.linked[g, j, i]\n",
    ),
    Fault(
        "energy of pairs without links is stale",
        "blocks/switches.py",
        "    limits.unlinked[0] = 0.5 * (n * (n - 1) - linked) * switching.each\n    if",
        "    if",
    ),
    Fault(
        "companion not advanced",
        "blocks/tried_steps.py",
        "    copy_rows(work.e, solution.difference)\n",
        "",
    ),
    Fault(
        "narrow feature jumped over",
        "blocks/tried_steps.py",
        "        if share < 1.0:\n            return False",
        "        if share < 0.0:\n            return False",
    ),
    Fault(
        "ledger check of a step skipped",
        "blocks/tried_steps.py",
        "and not missed <= LEDGER_GAP * limits.tolerance:",
        "and not missed <= 1e12 * LEDGER_GAP * limits.tolerance:",
    ),
    Fault(
        "velocities of agents of order 1 are stale at a switch",
        "blocks/loop.py",
        "            slopes_at_end(law, method, limits, stop, solution, work)\n",
        "",
    ),
    Fault(
        "sliding pairs not counted",
        "blocks/slides.py",
        "return sliding[k, SLIDES] + 1.0 if still else 0.0",
        "return 0.0",
    ),
    Fault(
        "relink loses the last partner",
        "blocks/switches.py",
        "for place in range(nearby.starts[i], nearby.starts[i + 1]):",
        "for place in range(nearby.starts[i], max(nearby.starts[i], nearby.starts[i + 1] - 1)):",
    ),
    Fault(
        "contact with an obstacle: the kink inside is not watched",
        "blocks/contacts.py",
        "balls.active[inner, i, o] = balls.inside[level, i, o]",
        "balls.active[inner, i, o] = balls.active[inner, i, o]",
    ),
    Fault(
        "contact with an obstacle: the error of the agent is left out",
        "blocks/contacts.py",
        "bound = SAFETY * agent_difference(work.e, i, m) + q_floor",
        "bound = q_floor",
    ),
    Fault(
        "list of nearby pairs: kept over a step that the session took",
        "crossings/switching.py",
        "        else:\n            self.forget_nearby()",
        "        else:\n            pass",
    ),
    Fault(
        "list of nearby pairs: the last step of a call is not noted",
        "crossings/switching.py",
        "            note_displacements(self.nearby, motion.far)",
        "            pass",
    ),
    Fault(
        "step length forgotten after a bound",
        "blocks/tried_steps.py",
        "max(length, progress[LENGTH]) if stop == limits.bound else length",
        "length",
    ),
)


def changed(fault: Fault, root: Path = ROOT) -> str:
    """Text of the file with the fault.

    Raises
    ------
    ValueError
        If what it replaces is not there exactly once.
    """
    text = (root / ENGINE / fault.file).read_text()
    if text.count(fault.before) != 1:
        raise ValueError(f"{fault.name}: {fault.before!r} is {text.count(fault.before)} times in {fault.file}")
    return text.replace(fault.before, fault.after)


def noticed_by(fault: Fault, tests: list[str]) -> str | None:
    """The first test that fails under a fault; None if none does."""
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name in ("src", "tests", "benchmarks", "docs"):
            shutil.copytree(ROOT / name, root / name, ignore=shutil.ignore_patterns("__pycache__", "_build"))
        shutil.copy(ROOT / "pyproject.toml", root)
        (root / ENGINE / fault.file).write_text(changed(fault))
        environment = {**os.environ, "PYTHONPATH": str(root / "src"), "FLOCKING_CACHE": str(root / "cache")}
        command = [sys.executable, "-m", "pytest", "-vv", "-x", "-p", "no:xdist", "-p", "no:cacheprovider", *tests]
        # Where a fault has been applied it cannot be applied again.
        command += ["--ignore", "tests/engine/exact/events/test_loop_faults.py"]
        with open(root / "output", "w+") as output:
            try:
                done = subprocess.run(
                    command, cwd=root, env=environment, stdout=output, stderr=output, check=False, timeout=LONGEST,
                    preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
                ).returncode  # fmt: skip
            except subprocess.TimeoutExpired:
                done = None
            output.seek(0)
            lines = output.read().splitlines()
    if done == 0:
        return None
    failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
    last = [line for line in lines if "::" in line] or lines or ["no output"]
    return f"does not end: {last[-1]}" if done is None else (failed or [f"ended by {done}: {last[-1]}"])[0]


def main() -> int:
    """Try the faults; the number of those that no test notices."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", help="numbers of faults, with commas")
    parser.add_argument("tests", nargs="*", default=TESTS)
    options = parser.parse_args()
    chosen = range(len(FAULTS)) if options.only is None else [int(k) for k in options.only.split(",")]
    missed = 0
    for k in chosen:
        found = noticed_by(FAULTS[k], list(options.tests))
        missed += found is None
        print(f"{k:>3} {'NOT NOTICED' if found is None else 'noticed':<12} {FAULTS[k].name}: {found or ''}", flush=True)
    return missed


if __name__ == "__main__":
    sys.exit(main())
