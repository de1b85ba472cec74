"""How far the rounding of positions changes the energy of pairs: near a minimum it may be all of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from flocking.engine.fixed_step.automatic_step import SampledPairs
from flocking.model.law import Law
from flocking.model.terms.pair_terms import Gradient


def energy_rounding(law: Law, sampled: Sequence[SampledPairs | None], blur: float) -> float:
    """Change of the stored energy of the sampled pairs if all their distances are wrong by ``blur``.

    Parameters
    ----------
    law
        The law.
    sampled
        Pairs of each graph of the law; None for a graph that is not sampled.
    blur
        Error of a distance from the rounding of positions.
    """
    found = 0.0
    for term in law.pair_terms:
        pairs = sampled[law.graph_number(term)]
        if pairs is None or not isinstance(term, Gradient):
            continue
        r, psi = pairs.distance, term.potential
        with np.errstate(all="ignore"):
            gaps = [np.abs(psi(np.abs(r + sign * blur)) - psi(r)) for sign in (-1.0, 1.0)]
        # Ordered pairs, each with half of its energy.
        found += 0.5 * float(np.nan_to_num(np.maximum(*gaps), nan=0.0, posinf=0.0).sum())
    return found
