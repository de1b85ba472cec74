"""Potentials held against the papers' definitions of what counts as one."""

from __future__ import annotations

from flocking.errors import InvalidInput
from flocking.model.potentials.potential import Potential
from flocking.papers import keys, paper
from flocking.study.potentials import potential_check
from flocking.study.potentials.potential_check import Definition, PotentialReport


def definitions() -> dict[str, Definition]:
    """The definitions of the papers that have one, by the paper's key, the oldest paper first."""
    papers = sorted(map(paper, keys()), key=lambda p: p.year)
    return {p.key: p.potential_definition for p in papers if p.potential_definition is not None}


def check_potential(
    potential: Potential | str, *, radius: float | None = None, definition: str | None = None
) -> PotentialReport:
    """Find the properties of a potential, and which papers' definitions of a potential it meets.

    See `flocking.study.potentials.potential_check.check_potential`.

    Parameters
    ----------
    potential
        The potential, or its formula.
    radius
        Sensing radius R; the first distance where the potential is infinite when absent.
    definition
        Key of the one paper whose definition is used: ``"tanner-2003-fixed"``, ``"tanner-2003-dynamic"``,
        ``"shi-2009"`` or ``"zhou-2015"``; all when absent.

    Returns
    -------
    PotentialReport
        ``rows`` and ``definitions``; print it for a table.

    Raises
    ------
    InvalidInput
        When the radius is not positive, the definition is unknown, or the formula is not in the grammar.

    Examples
    --------
    >>> report = check_potential("1/r^2 + log(r^2)", definition="tanner-2003-fixed")
    >>> report.definitions[0].holds
    True
    """
    known = definitions()
    if definition is not None and definition not in known:
        raise InvalidInput("check_potential", "definition", f"must be one of {', '.join(sorted(known))}", definition)
    asked = tuple(known.values()) if definition is None else (known[definition],)
    return potential_check.check_potential(potential, radius=radius, definitions=asked)
