"""The account that a run gives of itself: what each engine says, stored and read, and derived for older runs."""

from __future__ import annotations

import dataclasses
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import flocking as fk
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.runs.fidelity import UNSTATED, Approaches, Fidelity, LawAgreement, LedgerRule
from flocking.engine.runs.stored_fidelity import derived_fidelity, fidelity_data, fidelity_of
from flocking.study.claims.claim import Verdict
from flocking.study.trajectory import run_from_samples
from tests.engine.storage.stored_runs import finished, scenario

STATED = [
    UNSTATED,
    Fidelity("own", False, True, Approaches("all", None), LedgerRule("tolerance", 1e-9)),
    Fidelity("other", True, False, Approaches("linked", math.inf, "seldom"), LedgerRule("estimate", 1.0, math.nan)),
    Fidelity("third", fixed_step=0.1, law=LawAgreement(3, 1e-12, 2e-12)),
    Fidelity("fourth", position_error=0.25, velocity_error=math.nan, changed=True),
]


@pytest.mark.parametrize("stated", STATED)
def test_an_account_survives_its_record(stated: Fidelity) -> None:
    again = fidelity_of(json.loads(json.dumps(fidelity_data(stated), allow_nan=False)), {}, scenario())
    assert repr(again) == repr(stated)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"sampled": 1}, "sampled must be True or False"), ({"engine": None}, "engine must be text"),
        ({"fixed_step": "soon"}, "fixed_step must be a number"), ({"law": {"checks": 1}}, "law"),
        ({"ledger": {"kind": "faith", "size": 1.0, "switch_error": 0.0}}, "must be one of tolerance"),
        ({"more": 1}, "more"), ({"changed": 1}, "changed must be True or False"),
        ({"position_error": "small"}, "position_error must be a number"),
    ],
)  # fmt: skip
def test_what_is_no_account_is_refused(change: dict[str, object], said: str) -> None:
    with pytest.raises(MalformedError, match=said):
        fidelity_of({**fidelity_data(STATED[1]), **change}, {}, scenario())


def test_what_is_derived_for_older_runs_is_what_engines_say_of_the_same_runs_now() -> None:
    runs = [finished(), fk.simulate(scenario(0.1), engine="tiles", progress=False)]
    runs += [run_from_samples(scenario(), runs[0].t, runs[0].q, runs[0].p)]
    assert [run.fidelity.engine for run in runs] == ["exact", "tiles", "samples"]
    for run in runs:
        assert derived_fidelity(run.provenance, run.scenario) == run.fidelity


def test_what_an_older_run_does_not_tell_is_not_known() -> None:
    found = derived_fidelity({"engine": "samples", "gap": "wide"}, scenario())
    assert math.isnan(found.approaches.error or 0.0)
    assert math.isnan(found.ledger.size)


LATER = ("position_error", "velocity_error", "changed")


def test_errors_of_samples_and_changes_of_older_runs_are_read_from_their_provenance() -> None:
    older_provenance = {"position_error": 0.5, "velocity_error": "small", "changed at": [1.0]}
    plain = fidelity_data(STATED[1])
    older = {name: value for name, value in plain.items() if name not in LATER}
    for found in (fidelity_of(older, older_provenance, scenario()), derived_fidelity(older_provenance, scenario())):
        assert (found.position_error, found.changed) == (0.5, True)
        assert math.isnan(found.velocity_error)
    stated = fidelity_of(plain, older_provenance, scenario())
    assert (stated.position_error, stated.velocity_error, stated.changed) == (0.0, 0.0, False)


def test_audits_read_the_account_and_not_the_provenance() -> None:
    """The same records under another account: what it does not claim stays open."""
    run = finished()
    assert fk.audit(run)["links-kept"].verdict in (Verdict.HOLDS, Verdict.FAILS)
    silent = dataclasses.replace(run, fidelity=UNSTATED)
    for claim in ("ledger", "links-kept", "all-apart", "connected"):
        assert fk.audit(silent)[claim].verdict == Verdict.NOT_RESOLVED, claim
    misnamed = dataclasses.replace(run, provenance={
        "engine": "samples", "switches": "not recorded", "farthest": 9.0, "velocity_error": 9.0, "position_error": -1.0,
    })  # fmt: skip
    for one, other in zip(fk.audit(run).results, fk.audit(misnamed).results, strict=True):
        assert (one.verdict, one.note) == (other.verdict, other.note)
    loose = dataclasses.replace(run.fidelity, approaches=Approaches("all", 1e9))
    assert fk.audit(dataclasses.replace(run, fidelity=loose))["all-apart"].verdict == Verdict.NOT_RESOLVED
    off = dataclasses.replace(run.fidelity, law=LawAgreement(1, 0.5, 1e-12))
    assert fk.audit(dataclasses.replace(run, fidelity=off))["ledger"].verdict == Verdict.FAILS
    assert np.isfinite(run.closest.distance)


PROVENANCE_READ = re.compile(r"provenance(\[|\.get\()")
"""How a file reads an entry of what a run says of its making."""


def test_analysis_reads_no_provenance() -> None:
    """What bears on a verdict is in the account; entries of the provenance are for people."""
    study = Path(fk.__file__).parent / "study"
    found = {
        path.name: line.strip()
        for path in sorted(study.rglob("*.py"))
        for line in path.read_text().splitlines()
        if PROVENANCE_READ.search(line)
    }
    assert found == {}


def test_a_run_without_a_ledger_has_an_empty_residual():
    law = fk.Law(fk.Proximity(9.0), [fk.Gradient(fk.Potential("(r - 1)**2/2"))])
    made = fk.Scenario(
        law, fk.State([[0.0, 0.0], [2.0, 0.0]]), t_end=0.2, frames=2, bodies=fk.SingleIntegrator(), control=fk.Held(0.1)
    )
    run = fk.simulate(made, engine="tiles", ledger=False, progress=False)
    assert len(run.trace) == 0
    assert run.residual.shape == (0,)
