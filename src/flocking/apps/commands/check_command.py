"""The command that finds the properties of a potential."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from cyclopts import Parameter

from flocking.apps.json_output import print_json

Json = Annotated[bool, Parameter(name="--json")]

FINE, DIFFERENT = 0, 1
"""Exit codes, see `flocking.apps.cli`."""

_WORDS = {True: "holds", False: "fails", None: "open"}


def check(
    formula: str,
    *,
    parameter: Annotated[list[str] | None, Parameter(name=["--parameter", "-p"])] = None,
    radius: float | None = None,
    definition: str | None = None,
    as_json: Json = False,
) -> int:
    """Find the properties of a potential psi(r), and the papers' definitions that it meets.

    Parameters
    ----------
    formula
        The formula, for example "1/r + 1/(R - r)".
    parameter
        A value for a name of the formula, as name=value; once for each.
    radius
        Sensing radius.
    definition
        Key of the one paper whose definition must hold; the exit code is 1 where it fails or is open.
    as_json
        Print JSON.
    """
    from flocking.apps.tables import print_table
    from flocking.engine.driver.waits import Wait, stage
    from flocking.model.potentials.potential import Potential
    from flocking.papers.potential_definitions import check_potential

    potential = Potential(formula, **_named_values(parameter or []))
    with Wait("check"):
        stage("finding the shape of the potential")
        report = check_potential(potential, radius=radius, definition=definition)
    if as_json:
        print_json(report.as_dict())
    else:
        print(report.potential)
        titles = [f"{d.source}: {_WORDS[d.holds]}" for d in report.definitions]
        for title, rows in zip(["", *titles], [report.rows, *(d.rows for d in report.definitions)], strict=True):
            print()
            cells = [(row.name, _WORDS[row.holds], row.explanation) for row in rows]
            print_table(("property", "verdict", "measured"), cells, title=title)
    outcomes = [d.holds for d in report.definitions if definition is not None]
    return FINE if all(outcomes) else DIFFERENT


def _named_values(texts: Sequence[str]) -> dict[str, float]:
    from flocking.errors import InvalidInput

    found: dict[str, float] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not equals or not name.isidentifier() or name == "formula" or number != number:
            raise InvalidInput("check", "-p", "must be name=number, such as -p R=4", text)
        if name in found:
            raise InvalidInput("check", "-p", f"must give {name} once", text)
        found[name] = number
    return found
