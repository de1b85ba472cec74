"""Audits of any numbers: a verdict for every claim, no error, and none that rests on what cannot be computed with."""

from __future__ import annotations

import dataclasses
import json
from functools import cache
from typing import Any

import numpy as np
from hypothesis import strategies as st

import flocking as fk
from flocking.engine.runs.fidelity import Approaches, LawAgreement, LedgerRule
from flocking.engine.runs.run import Closest
from flocking.papers import ALL_KEYS, paper
from flocking.study.claims.claim import UNCOMPUTED, Claim, Verdict
from flocking.study.claims.general_claims import GENERAL
from flocking.study.claims.witnesses import witness_of
from flocking.study.evidence import Evidence
from flocking.study.trajectory import run_from_samples
from tests.fuzz.guard import fuzz, guarded

WELL = fk.Potential("(r - 1)**2/r")
LAWS = (
    fk.Law(fk.Proximity(2.0), [fk.Gradient(WELL), fk.Consensus(0.5)]),
    fk.Law(fk.Hysteresis(2.0, 0.3), [fk.Gradient(fk.Potential("1/(4 - r**2) + 1/r**2")), fk.Consensus(0.5)]),
    fk.Law(fk.Smooth(2.0, 0.3), [fk.Gradient(fk.Potential("(r - 1)**2")), fk.Consensus(0.5)]),
    fk.Law(fk.Fixed.complete(3), [fk.Consensus(0.5), fk.Track(fk.Velocity([1.0, 0.0]), velocity_gain=0.5)]),
)
ODD = st.sampled_from([0.0, 1.0, -1.0, 1e-300, 1e20, 1e99, 1e150, 1e300, -1e308, np.inf, -np.inf, np.nan])


@cache
def all_claims() -> tuple[Claim, ...]:
    """The general claims and those of all papers about all their systems."""
    return (*GENERAL, *(c for key in ALL_KEYS for name in paper(key).scenarios() for c in paper(key).claims(name)))


@cache
def runs() -> tuple[fk.Run, ...]:
    """Good runs of every kind."""
    found = []
    for law in LAWS:
        scenario = fk.Scenario(law, fk.start.box(3, side=1.5, speed=0.4, seed=3), t_end=4.0, frames=61)
        found.append(fk.simulate(scenario, progress=False))
        found.append(run_from_samples(scenario, found[-1].t, found[-1].q, found[-1].p))
    scenario = fk.Scenario(LAWS[0], fk.start.box(3, side=1.5, speed=0.4, seed=3), t_end=4.0, frames=61)
    found.append(fk.simulate(scenario, engine="tiles", step=0.01, progress=False))
    found.append(fk.simulate(scenario, engine="tiles", step=0.01, observe=True, keep_frames=False, progress=False))
    found.append(fk.simulate(fk.papers.vicsek_1995.system.group(6, 2.5, 1.0, duration=30), progress=False))
    return tuple(found)


def audited(run: fk.Run) -> dict[int, Verdict]:
    """Verdicts of all claims on a run, each looked at as whoever shows it does."""
    evidence = Evidence(run)
    found = {}
    for number, claim in enumerate(all_claims()):
        result = claim.examine(evidence)
        assert isinstance(result.verdict, Verdict)
        assert not result.note.startswith(UNCOMPUTED), (claim.key, result.note)
        json.dumps(result.as_dict(), allow_nan=False)
        witness_of(result, evidence)
        if result.verdict in (Verdict.HOLDS, Verdict.FAILS):
            assert not np.isnan(result.margin), claim.key
        found[number] = result.verdict
    return found


@fuzz("sampled audits")
def test_any_trajectory_has_its_verdicts(data: Any, folder: Any) -> None:
    draw = data.draw
    law = draw(st.sampled_from(LAWS))
    frames = draw(st.integers(3, 40))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    t = np.cumsum(rng.uniform(0.01, 1.0, frames)) * 10.0 ** draw(st.integers(-6, 6))
    size = 10.0 ** draw(st.integers(-8, 8))
    q = rng.normal(size=(1, 3, 2)) + size * rng.normal(size=(frames, 3, 2)) * draw(st.booleans())
    if draw(st.booleans()):
        q = q * np.exp(np.minimum(t - t[0], 700.0) * draw(st.sampled_from([0.1, 1.0, 10.0])))[:, None, None]
    if draw(st.integers(0, 3)) == 0:
        q[:, 1] = q[:, 0]
    p = np.gradient(q, t, axis=0) if draw(st.booleans()) else rng.normal(size=q.shape) * size
    if draw(st.integers(0, 4)) == 0:
        (q if draw(st.booleans()) else p)[draw(st.integers(0, frames - 1)), draw(st.integers(0, 2))] = draw(ODD)
    scenario = fk.Scenario(law, fk.State(rng.normal(size=(3, 2))), t_end=1.0)
    with guarded("sampled audits"):
        run = run_from_samples(scenario, t, q, p)
        verdicts = audited(run)
        if not (np.abs(q) < 1e99).all():
            assert Verdict.HOLDS not in verdicts.values()


@fuzz("damaged audits")
def test_any_run_has_its_verdicts(data: Any, folder: Any) -> None:
    draw = data.draw
    run = draw(st.sampled_from(runs()))
    for _ in range(draw(st.integers(1, 3))):
        run = dataclasses.replace(run, **draw(st.sampled_from(DAMAGE))(run, draw))
    with guarded("damaged audits"):
        verdicts = audited(run)
        for key, arrays in RESTS_ON.items():
            if not all(np.isfinite(x).all() for x in arrays(run)):
                number = next(k for k, c in enumerate(GENERAL) if c.key == key)
                assert verdicts[number] not in (Verdict.HOLDS, Verdict.FAILS), key


RESTS_ON = {
    "ledger": lambda run: [run.trace["energy"], run.trace["dissipated"]],
    "momentum": lambda run: [run.p, run.t],
    "distances-settle": lambda run: [run.q, run.p, run.t],
    "forces-vanish": lambda run: [run.q, run.t],
    "all-apart": lambda run: [run.closest_linked.distance, run.trace["energy"]][1:],
}
"""What some claims cannot do without."""


def _values(run: fk.Run, draw: Any) -> dict[str, Any]:
    name = draw(st.sampled_from(["t", "q", "p"]))
    values = getattr(run, name).copy()
    if values.size:
        values.flat[draw(st.integers(0, values.size - 1))] = draw(ODD)
    return {name: values}


def _scaled(run: fk.Run, draw: Any) -> dict[str, Any]:
    with np.errstate(all="ignore"):
        return {name: getattr(run, name) * draw(ODD) for name in ("q", "p")}


def _fewer(run: fk.Run, draw: Any) -> dict[str, Any]:
    count = draw(st.integers(0, min(6, len(run.t))))
    return {name: getattr(run, name)[:count] for name in ("t", "q", "p", "links")}


def _ledger(run: fk.Run, draw: Any) -> dict[str, Any]:
    trace = run.trace.copy()[: draw(st.integers(0, len(run.trace)))]
    if len(trace) and draw(st.booleans()):
        trace[draw(st.sampled_from(trace.dtype.names))][draw(st.integers(0, len(trace) - 1))] = draw(ODD)
    return {"trace": trace}


def _switches(run: fk.Run, draw: Any) -> dict[str, Any]:
    switches = run.switches.copy()
    if len(switches):
        name = draw(st.sampled_from(["time", "i", "j", "speed"]))
        value = draw(ODD) if name in ("time", "speed") else draw(st.integers(-5, 50))
        switches[name][draw(st.integers(0, len(switches) - 1))] = value
    return {"switches": switches[draw(st.integers(0, 2)) :]}


def _links(run: fk.Run, draw: Any) -> dict[str, Any]:
    links = run.links.copy()
    if draw(st.booleans()):
        return {"links": np.zeros((len(run.t), 0, 0), dtype=bool)}
    if links.size:
        where = draw(st.integers(0, links.size - 1))
        links.flat[where] = not links.flat[where]
    return {"links": links}


def _closest(run: fk.Run, draw: Any) -> dict[str, Any]:
    found = Closest(draw(ODD), draw(ODD), (draw(st.integers(-2, 5)), draw(st.integers(-2, 5))))
    return {draw(st.sampled_from(["closest_linked", "closest_unlinked"])): found}


def _about(run: fk.Run, draw: Any) -> dict[str, Any]:
    kept = dict(run.provenance)
    kept.pop(draw(st.sampled_from(sorted(kept))))
    extra = draw(st.sampled_from([{}, {"switches": "not recorded"}, {"farthest": np.nan}, {"engine": "samples"}]))
    return {"provenance": kept | extra}


def _account(run: fk.Run, draw: Any) -> dict[str, Any]:
    told = run.fidelity
    changes = [
        {"switches_located": not told.switches_located}, {"sampled": not told.sampled},
        {"law": LawAgreement(1, draw(ODD), draw(ODD))},
        {"approaches": Approaches("linked", draw(ODD))}, {"approaches": Approaches("all", None, "seldom")},
        {"ledger": LedgerRule("share", draw(ODD))}, {"ledger": LedgerRule("estimate", draw(ODD), draw(ODD))},
        {"ledger": LedgerRule()},
    ]  # fmt: skip
    return {"fidelity": dataclasses.replace(told, **draw(st.sampled_from(changes)))}


def _status(run: fk.Run, draw: Any) -> dict[str, Any]:
    return {"status": draw(st.sampled_from(["running", "unfinished", "interrupted at t = 1"]))}


DAMAGE = (_values, _scaled, _fewer, _ledger, _switches, _links, _closest, _about, _account, _status)
