"""The claims of a package held against a table of what they state, and their counter-examples against runs."""

from __future__ import annotations

from types import ModuleType

import flocking as fk
from flocking.study.claims.claim import Basis, Verdict

Rows = dict[str, list[tuple[str, str, str, str, bool, str, str]]]
"""By the end of the scenario's name: key, source, origin, expected verdict, dynamic, conclusion and hypothesis."""


def agree_on(theorems: ModuleType, system: ModuleType, rows: Rows) -> None:
    """The claims about every scenario are those of the table, and each has a ground that stands."""
    assert {f"{system.KEY}{end}" for end in rows} == set(system.scenarios())
    for end, expected in rows.items():
        stated = theorems.claims(f"{system.KEY}{end}")
        found = [
            (c.key, c.source, c.origin.name, c.expected.name, c.dynamic, c.conclusion.__name__, c.hypothesis.__name__)
            for c in stated
        ]
        assert found == expected, end
        for claim in stated:
            assert claim.statement.endswith(".")
            assert claim.basis is not Basis.GENERAL
            assert bool(claim.reason) == (claim.expected is Verdict.FAILS)
            if claim.basis is Basis.COUNTEREXAMPLE:
                run = fk.simulate(claim.counterexample(), progress=False)
                assert fk.audit(run, [claim])[claim.key].verdict == Verdict.FAILS, claim.key
