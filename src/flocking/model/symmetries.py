"""Symmetries: what does not change the motion of a group, as parts of laws and worlds state it."""

from __future__ import annotations

SYMMETRIES = frozenset({"momentum", "rotation", "relabelling", "galilean", "locality"})
"""Pair forces cancel; no direction, no agent, no place and no constant velocity is special; forces depend on neighbours
alone. Each has a contract test."""

DRAWN = frozenset({"rotation", "relabelling"})
"""Symmetries that errors break which are drawn for each agent and axis: the numbers drawn do not have them."""
