"""Plants: laws that agents obey instead of the declared one, for tests of ledgers and audits."""

from __future__ import annotations

from dataclasses import fields, is_dataclass

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.graphs.smooth_cones import HeadingWeights
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
        if not _same_links(ours, theirs):
            raise InvalidInput(owner, "plant", "must have the graphs of the declared law", theirs, fix)


def _same_links(ours: Graph, theirs: Graph) -> bool:
    """Whether two graphs link the same agents: they differ in numbers of formulas at most, such as a smooth onset.

    Factors of headings must agree, too: such engines find those of the declared graph beside its links.
    """
    if type(ours) is not type(theirs) or ours.structure != theirs.structure:
        return False
    if any(w != theirs.parameters[name] for name, w in ours.parameters.items() if isinstance(w, HeadingWeights)):
        return False
    names = ["break_radius", "appear_radius"]
    if is_dataclass(ours):
        names += [field.name for field in fields(ours) if field.name not in ours.parameters]
    return all(np.array_equal(getattr(ours, name), getattr(theirs, name)) for name in names)
