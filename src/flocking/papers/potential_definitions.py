"""Check of potentials against the definitions of a potential in the papers."""

from __future__ import annotations

from flocking.model.checks import one_of
from flocking.model.potentials.potential import Potential
from flocking.papers import keys, paper
from flocking.study.potentials import potential_check
from flocking.study.potentials.potential_check import Definition, PotentialReport


def definitions() -> dict[str, Definition]:
    """Definitions of a potential by the key of the paper, the oldest paper first."""
    papers = sorted(map(paper, keys()), key=lambda p: p.year)
    return {p.key: p.potential_definition for p in papers if p.potential_definition is not None}


def check_potential(
    potential: Potential | str, *, radius: float | None = None, definition: str | None = None
) -> PotentialReport:
    """Find the properties of a potential, and the papers whose definitions of a potential it satisfies.

    See `flocking.study.potentials.potential_check.check_potential`.

    Parameters
    ----------
    potential
        The potential, or its formula.
    radius
        Sensing radius R; by default the first distance at which the potential is infinite.
    definition
        Key of the one paper whose definition is used: ``"tanner-2003-fixed"``, ``"tanner-2003-dynamic"``,
        ``"shi-2009"`` or ``"zhou-2015"``; all by default.

    Returns
    -------
    PotentialReport
        ``rows`` and ``definitions``; print it for a table.

    Raises
    ------
    InvalidInput
        If the radius is not positive, the definition is unknown, or the formula is not in the grammar.

    Examples
    --------
    >>> report = check_potential("1/r^2 + log(r^2)", definition="tanner-2003-fixed")
    >>> report.definitions[0].holds
    True
    """
    known = definitions()
    if definition is not None:
        one_of("check_potential", "definition", definition, sorted(known))
    asked = tuple(known.values()) if definition is None else (known[definition],)
    return potential_check.check_potential(potential, radius=radius, definitions=asked)
