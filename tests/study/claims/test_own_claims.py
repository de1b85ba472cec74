"""The page on adding a claim holds: its one file is audited, witnessed, lit in the lab and has a picture."""

from __future__ import annotations

import importlib.util
import re
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

import flocking as fk
from flocking.apps.lab.panels.measures import verdicts_on
from flocking.apps.reproduction.claim_pictures import picture_of
from flocking.study.claims.claim import Claim
from flocking.study.claims.subjects import Subject, about_of
from flocking.study.claims.witnesses import witness_of
from flocking.study.evidence import Evidence

PAGE = (Path(__file__).resolve().parents[3] / "CONTRIBUTING.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def own(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.split("## Adding a claim")[1].split("\n## ")[0], re.DOTALL)
    file = tmp_path_factory.mktemp("outside") / "my_claims.py"
    file.write_text(code)
    spec = importlib.util.spec_from_file_location("my_claims", file)
    assert spec is not None
    assert spec.loader is not None
    found = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(found)
    return found


@pytest.fixture(scope="module")
def run() -> fk.Run:
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0.0, 0.0], [0.0, 0.5], [0.0, 2.0]])
    return fk.simulate(fk.Scenario(law, start, t_end=10.0, frames=3), progress=False)


def test_a_claim_from_outside_is_audited_witnessed_lit_and_pictured(own: ModuleType, run: fk.Run) -> None:
    (result,) = fk.audit(run, [own.SLOW]).results
    assert str(result.verdict) == "fails"
    found = witness_of(result, Evidence(run))
    assert found is not None
    assert (found.time, found.agents) == (0.0, (2,))
    assert picture_of(own.SLOW) == "velocities"
    # Nothing mends what lasts; what is pending may still come true before the end.
    early = replace(run, scenario=run.scenario.with_(t_end=20.0))
    pending = replace(own.SLOW, lasting=False)
    lit = {shown.claim.lasting: shown for shown in verdicts_on(early, [own.SLOW, pending])}
    assert lit[None].word == "fails"
    assert lit[False].word == "not yet"
    assert lit[None].witness == found


def test_what_a_claim_says_itself_counts_before_what_its_measure_says(own: ModuleType) -> None:
    other = replace(own.SLOW, subject=Subject.LEDGER, lasting=False)
    assert (other.about.subject, other.about.lasting) == (Subject.LEDGER, False)
    assert other.about.witness is about_of(own.slow).witness
    plain = Claim("plain", "own question", "Nothing.", lambda e: own.slow(e))
    assert picture_of(plain) == "net"
    assert plain.about.witness is None
