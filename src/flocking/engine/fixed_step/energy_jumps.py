"""Ledgers of fixed steps, which do not locate when pairs cross a distance, of potentials that jump there."""

from __future__ import annotations

from flocking.errors import UnsupportedLaw
from flocking.model.law import Law
from flocking.model.terms.potential_reach import energy_jump


def check_no_energy_jump(law: Law) -> None:
    """Refuse a ledger of potentials that jump within the reach of their graph.

    Parameters
    ----------
    law
        The law whose energy is summed.

    Raises
    ------
    UnsupportedLaw
        When there is one.
    """
    jump = energy_jump((term, law.graphs[law.graph_number(term)]) for term in law.pair_terms)
    if jump is not None:
        raise UnsupportedLaw(
            f"Engines of fixed steps have no ledger for a potential that jumps at a distance of {jump:.6g}, where "
            "pairs are linked: no step is short enough. Use engine='exact', which locates when pairs cross it, or "
            "ledger=False."
        )
