"""Plants: laws that agents obey instead of the declared one, for tests of ledgers and audits."""

from __future__ import annotations

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.law import Law


def known_plant(owner: str, plant: Law | None) -> None:
    """Check that a plant is a law or None.

    Raises
    ------
    InvalidInput
        When it is something else.
    """
    if plant is not None and not isinstance(plant, Law):
        raise InvalidInput(owner, "plant", "must be a Law, or None", plant, "A scenario's law is scenario.law.")


def check_plant(owner: str, declared: Law, plant: Law) -> None:
    """Check that an engine with fixed steps can run a plant and the ledger of the declared law: their graphs agree.

    Raises
    ------
    InvalidInput
        When it cannot.
    """
    known_plant(owner, plant)
    fix = "Use engine='exact', or change the plant's terms alone."
    if len(plant.graphs) != len(declared.graphs):
        raise InvalidInput(owner, "plant", "must have the graphs of the declared law", len(plant.graphs), fix)
    for ours, theirs in zip(declared.graphs, plant.graphs, strict=True):
        same = type(ours) is type(theirs) and ours.structure == theirs.structure
        radii = ((ours.break_radius, theirs.break_radius), (ours.appear_radius, theirs.appear_radius))
        if not same or not all(np.array_equal(a, b) for a, b in radii):
            raise InvalidInput(owner, "plant", "must have the graphs of the declared law", theirs, fix)
