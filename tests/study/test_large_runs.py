"""Audits of groups too large for link matrices: what cannot be measured is not applicable, never a crash."""

from __future__ import annotations

import dataclasses

import numpy as np

import flocking as fk
from flocking.study.claims import Verdict


def test_claims_about_links_are_not_applicable_without_link_matrices():
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
    run = fk.simulate(fk.Scenario(law, fk.start.box(12, side=4.0, speed=1.0, seed=1), t_end=1.0, frames=5))
    with_links = {r.claim.key: r.verdict for r in fk.audit(run).results}
    bare = dataclasses.replace(run, links=np.zeros((len(run.t), 0, 0), dtype=bool))
    without = {r.claim.key: r for r in fk.audit(bare).results}
    assert with_links["links-kept"] != Verdict.NOT_APPLICABLE
    assert without["connected"].verdict == Verdict.NOT_APPLICABLE
    assert "no link matrices" in without["connected"].note
    assert without["ledger"].verdict == with_links["ledger"] == Verdict.HOLDS
