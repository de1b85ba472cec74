"""A drawn run of the library held against what the judge knows of it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from itertools import zip_longest

import numpy as np

import flocking as fk
from tests.validation.draws import Draw
from tests.validation.judge.motion import Judge
from tests.validation.truths import SURE, Truth, starts_connected, truth

DECIDED = ("holds", "fails")
OPEN = ("not resolved",)


@dataclass
class Finding:
    """What came out for one draw: contradictions and refusals in words, verdicts by claim, errors against stated ones.

    ``seconds`` are those of the library's run, of its audit and of the judge, of processor time.
    """

    number: int
    law: str
    kind: str
    note: str
    tolerance: float
    contradictions: list[str] = field(default_factory=list)
    refusal: str = ""
    legitimate: bool = True
    trouble: str = ""
    verdicts: dict[str, str] = field(default_factory=dict)
    open: int = 0
    asked: int = 0
    ratios: dict[str, float] = field(default_factory=dict)
    seconds: tuple[float, float, float] = (0.0, 0.0, 0.0)


def examine(draw: Draw, judge: Judge) -> Finding:
    """Run, audit and judge a draw."""
    found = Finding(draw.number, draw.law, draw.kind, draw.note, draw.scenario.tolerance)
    clock = [time.process_time()]
    try:
        run = fk.simulate(draw.scenario, engine="exact", progress=False)
    except fk.FlockingError as error:
        run = None
        found.refusal = f"{type(error).__name__}: {error}"
    clock.append(time.process_time())
    report = fk.audit(run) if run is not None else None
    clock.append(time.process_time())
    known = truth(draw, judge)
    clock.append(time.process_time())
    found.seconds = (clock[1] - clock[0], clock[2] - clock[1], clock[3] - clock[2])
    found.trouble = known.trouble
    if run is None or report is None:
        found.legitimate = legitimate(draw, known, found.refusal)
        return found
    found.verdicts = {r.claim.key: str(r.verdict) for r in report.results}
    asked = [v for v in found.verdicts.values() if v in DECIDED or v in OPEN]
    found.asked, found.open = len(asked), sum(v in OPEN for v in asked)
    for result in report.results:
        verdict, fact = str(result.verdict), known.claims.get(result.claim.key)
        if fact is not None and verdict in DECIDED and (verdict == "holds") != fact:
            found.contradictions.append(f"{result.claim.key}: {verdict} ({result.note})")
    if known.claims and not known.trouble:
        connected = starts_connected(draw, known.motion)
        if connected == (found.verdicts.get("connected") == "hypothesis not met"):
            found.contradictions.append(f"connected: at the start it is {'' if connected else 'not '}connected")
        _compare_switches(draw, run, known, found)
        _compare_approach(run, known, found)
    if known.claims:
        _compare_states(draw, run, known, found)
    return found


def legitimate(draw: Draw, known: Truth, refusal: str) -> bool:
    """Whether the library may refuse this run: for lack of digits, or where the judge finds no motion either."""
    if known.motion.status != "done":
        return True
    q = np.abs(draw.problem.q).max()
    far = max(q, np.abs(draw.problem.p).max(), abs(draw.problem.start))
    kind = refusal.partition(":")[0]
    if kind == "OutOfPrecision":
        return bool(far >= 1e6)
    same = min((float(np.abs(draw.problem.q[i] - draw.problem.q[j]).max()) for i in range(len(draw.problem.q))
                for j in range(i)), default=1.0)  # fmt: skip
    closest = min(known.motion.closest_linked.distance, known.motion.closest_unlinked.distance, same)
    even = draw.law in ("even", "flights")
    return kind in ("NotFinite", "StepTooSmall", "InvalidInput") and closest < 1e-9 and not even


def _compare_switches(draw: Draw, run: fk.Run, known: Truth, found: Finding) -> None:
    """Switches of the law's own graph, pair by pair; what the run itself calls doubtful is left open."""
    rows = run.switches
    own = rows[(rows["graph"] == 0) & np.isin(rows["kind"], ["appear", "break"])]
    mine: dict[tuple[int, int], list[tuple[str, float, float]]] = {}
    for row in own:
        error = float(row["time_error"]) if "time_error" in rows.dtype.names else math.nan
        mine.setdefault((int(row["i"]), int(row["j"])), []).append((str(row["kind"]), float(row["time"]), error))
    true: dict[tuple[int, int], list[tuple[str, float]]] = {}
    for x in known.motion.switches:
        if x.graph == 0:
            true.setdefault(x.pair, []).append((x.kind, x.time))
    known_until, doubted = _doubts(run)
    resolved = all(found.verdicts.get(key) not in OPEN for key in ("links-kept", "ledger"))
    for pair in sorted({*mine, *true}):
        both = zip_longest(mine.get(pair, []), true.get(pair, []))
        for a, b in both:
            if a is None or b is None or a[0] != b[0]:
                at = min(x[1] + (draw.problem.start if x is b else 0.0) for x in (a, b) if x is not None)
                if resolved and pair not in doubted and at <= known_until:
                    counts = f"{len(mine.get(pair, []))} for {len(true.get(pair, []))}"
                    found.contradictions.append(f"switches: pair {pair} from t = {at:.6g}, {counts}")
                break
            if pair in doubted or a[1] > known_until:
                break
            late = abs((a[1] - draw.problem.start) - b[1])
            if a[2] > 0:
                _worst(found, "switch times / stated", late / (a[2] + SURE * known.error / max(known.slowest, 1e-300)))


def _doubts(run: fk.Run) -> tuple[float, set[tuple[int, int]]]:
    """Until when a run knows its motion, and pairs of which it calls a switch doubtful."""
    accuracy = getattr(run, "accuracy", None)
    if accuracy is None:
        return math.inf, set()
    rows = accuracy.doubts
    pairs = {(int(min(x)), int(max(x))) for x in zip(rows["i"], rows["j"], strict=True)}
    return float(accuracy.known_until), pairs


def _worst(found: Finding, name: str, ratio: float) -> None:
    found.ratios[name] = max(found.ratios.get(name, 0.0), float(ratio))


def _compare_approach(run: fk.Run, known: Truth, found: Finding) -> None:
    """Closest approach of all pairs against the error that the run states."""
    stated = run.closest.error
    true = min(known.motion.closest_linked.distance, known.motion.closest_unlinked.distance)
    off = abs(run.closest.distance - true) if math.isfinite(true) else 0.0
    if stated > 0:
        _worst(found, "closest approach / stated", off / (stated + known.error))
    if off > stated + SURE * known.error and found.verdicts.get("all-apart") in DECIDED:
        found.contradictions.append(f"closest: {run.closest.distance:.9g} +- {stated:.1e} is {true:.9g}")


def _compare_states(draw: Draw, run: fk.Run, known: Truth, found: Finding) -> None:
    """Positions at the frames, in the judge's frame of reference, against the errors that the run states."""
    wide, motion = np.longdouble, known.motion
    since = run.t.astype(wide) - wide(draw.problem.start)
    origin = motion.origin + since[:, None] * motion.drift
    off = np.abs((run.q.astype(wide) - origin[:, None, :]) - motion.q[:-1]).max(axis=(1, 2)).astype(float)
    size = max(1.0, float(np.abs(motion.q).max()))
    if found.verdicts.get("ledger") not in OPEN:
        _worst(found, "positions / (tolerance x size)", off.max() / (draw.scenario.tolerance * size))
    accuracy = getattr(run, "accuracy", None)
    if accuracy is not None:
        sure = (run.t <= accuracy.known_until) & np.isfinite(accuracy.frames[:, 0])
        stated = accuracy.frames[sure, 0] + known.error + np.finfo(float).eps * float(np.abs(run.q).max())
        if sure.any() and not known.trouble:
            _worst(found, "positions / stated", (off[sure] / stated).max())
