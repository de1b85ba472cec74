"""The command that prints what is guaranteed of a scenario before it runs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from flocking.apps.json_output import print_json

if TYPE_CHECKING:
    from flocking.engine.runs.run import Run
    from flocking.study.certificates.certificate import Certificates


SIGNS = {"at most": "<=", "at least": ">=", "is": "="}
"""Signs of the sides of bounds in narrow columns."""


VERDICTS = {"True": "yes", "False": "NO", "None": "not resolved"}
"""Words for whether a promise was kept; one that seems broken in a run without stated errors is not resolved."""


def certify(
    scenario: str,
    *,
    seed: int | None = None,
    most_agents: int | None = None,
    hypotheses: bool = False,
    as_json: Annotated[bool, Parameter(name="--json")] = False,
) -> int:
    """Print what is guaranteed of every run of a scenario, by which theorem; nothing is simulated.

    Parameters
    ----------
    scenario
        A name that 'flocking list' shows, or a TOML file.
    seed
        Seed of the start; that of the file, or 0 for a paper's scenario, when absent.
    most_agents
        Largest number of agents it may have.
    hypotheses
        Show the hypotheses of each theorem as they were found.
    as_json
        Print JSON; numbers are enclosed between a lower and an upper one.
    """
    from flocking.apps.scenario_names import find_scenario
    from flocking.apps.tables import print_table
    from flocking.engine.driver.waits import Wait, stage
    from flocking.study.certificates.certify import certify as certificates_of

    with Wait("certify"):
        stage("reading the scenario")
        found = certificates_of(find_scenario(scenario, seed, most_agents))
    if as_json:
        print_json(found.as_dict())
        return 0
    rows = [(c.key, c.outcome, c.statement if c.granted else c.reason) for c in found]
    print_table(("certificate", "outcome", "guarantee, or why there is none"), rows, title=found.name)
    for source in dict.fromkeys(c.source for c in found if hypotheses):
        checked = {h.statement: h for c in found if c.source == source for h in c.hypotheses}
        cells = [(h.statement, "met" if h.holds else "not met", h.found) for h in checked.values()]
        print()
        print_table(("hypothesis", "verdict", "found"), cells, title=source)
    return 0


def certificate_rows(run: Run, found: Certificates | None = None) -> list[dict[str, object]]:
    """Every granted certificate that a run can be held against, beside what it shows, as plain values for JSON.

    Parameters
    ----------
    run
        The run.
    found
        The certificates of its scenario, where they are at hand.
    """
    from flocking.study.certificates.certify import certify as certificates_of
    from flocking.study.certificates.comparison import compare

    known = certificates_of(run.scenario) if found is None else found
    rows = compare(known, run) if len(run.t) else ()
    sides = ({"quantity": known[row.key].quantity, "side": known[row.key].side} for row in rows)
    return [
        {name: _finite(value) for name, value in (row.as_dict() | more).items()}
        for row, more in zip(rows, sides, strict=True)
    ]


def print_promises(rows: list[dict[str, object]]) -> None:
    """Print what was guaranteed before a run beside what it shows; nothing where nothing was.

    Parameters
    ----------
    rows
        Those of `certificate_rows`.
    """
    from flocking.apps.tables import print_table

    if not rows:
        return
    cells = [
        (
            str(r["key"]), _promised(r), f"{r['observed']:.4g}",
            VERDICTS[str(r["kept"])], str(r["quantity"]),
        )
        for r in rows
    ]  # fmt: skip
    print_table(("certificate", "promised", "observed", "kept", "of what"), cells, title="Guaranteed before the run")


def _promised(row: dict[str, object]) -> str:
    """The sign and the bound, in a narrow column."""
    from flocking.formula.safe_digits import bound_text

    side, bound = str(row["side"]), row["promised"]
    assert isinstance(bound, float)
    return f"{SIGNS[side]} {bound_text(bound, side, 4)}"


def _finite(value: object) -> object:
    """Plain values for JSON, which has no infinity and no NaN: null stands for them."""
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
