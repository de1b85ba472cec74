"""Where each run-time parameter of a law sits in the arrays a compiled kernel is handed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flocking.model.checks import Array
from flocking.model.energy import Energy
from flocking.model.law import Law
from flocking.model.leaders import Leader
from flocking.model.state import Agents
from flocking.model.terms import Term, Value
from flocking.model.weights import PairWeights

MASS, DAMPING = "A0", "A1"


@dataclass(frozen=True, eq=False)
class Layout:
    """Slots of all parameters of a law, in an order that depends on its structure alone.

    Parameters
    ----------
    law
        The law.
    energy
        The energy; its leader's parameters get slots too.
    """

    law: Law
    energy: Energy

    def leaders(self) -> tuple[Leader, ...]:
        """Leaders of the law, then the energy's if it is another one."""
        found = list(self.law.leaders)
        if self.energy.leader is not None and all(self.energy.leader is not x for x in found):
            found.append(self.energy.leader)
        return tuple(found)

    def owners(self) -> list[tuple[str, dict[str, Value]]]:
        """Every owner of parameters with what it owns, in slot order."""
        found: list[tuple[str, dict[str, Value]]] = []
        found += [(f"graph{k}", dict(g.parameters)) for k, g in enumerate(self.law.graphs)]
        found += [(f"term{k}", t.parameters) for k, t in enumerate(self.law.terms)]
        found += [(f"leader{k}", dict(x.parameters)) for k, x in enumerate(self.leaders())]
        return found

    @cached_property
    def slots(self) -> dict[tuple[str, str], str]:
        """Symbol of each (owner, parameter): ``P0``, ``P1``... one number, ``A2``... per agent, ``W0``... per pair."""
        counts = {"P": 0, "A": 2, "W": 0}
        found = {}
        for owner, values in self.owners():
            for name, value in values.items():
                kind = "W" if isinstance(value, PairWeights) else "A" if np.ndim(value) else "P"
                found[owner, name] = f"{kind}{counts[kind]}"
                counts[kind] += 1
        return found

    def slot(self, owner: str, name: str) -> str:
        """Symbol of one parameter."""
        return self.slots[owner, name]

    @property
    def structure(self) -> tuple[object, ...]:
        """What fixes the generated kernels: all formulas, which terms act on which graph, and the slots."""
        law = self.law
        return (
            tuple(g.structure for g in law.graphs),
            tuple((t.structure, law.graph_number(t)) for t in law.pair_terms),
            tuple((t.structure, self.leader_number(t.leader)) for t in law.body_terms),
            tuple(type(t).__name__ for t in law.terms),
            tuple(x.structure for x in self.leaders()),
            self.energy.structure,
            tuple(self.slots.items()),
            tuple(_foreign_source(part) for part in (*law.graphs, *law.terms, *self.leaders())),
        )

    def leader_number(self, leader: Leader | None) -> int | None:
        """Position of a leader in `leaders`."""
        return None if leader is None else next(k for k, x in enumerate(self.leaders()) if x is leader)

    def term_owner(self, term: Term) -> str:
        """Owner name of a term."""
        return f"term{next(k for k, t in enumerate(self.law.terms) if t is term)}"

    def values(self, agents: Agents, n: int) -> tuple[Array, Array, Array]:
        """Numbers for the slots: P of shape (scalars,), A of shape (rows, n) and W of shape (matrices, n, n)."""
        scalars: list[float] = []
        rows: list[Array] = [np.broadcast_to(agents.masses, n), np.broadcast_to(agents.damping, n)]
        matrices: list[Array] = []
        for _, owned in self.owners():
            for value in owned.values():
                if isinstance(value, PairWeights):
                    matrices.append(value.matrix(n))
                elif np.ndim(value):
                    rows.append(np.asarray(value, dtype=np.float64))
                else:
                    scalars.append(float(value))
        pairs = np.array(matrices) if matrices else np.zeros((0, 1, 1))
        return np.array(scalars, dtype=np.float64), np.array(rows, dtype=np.float64), pairs


def _foreign_source(part: object) -> str:
    """Digest of the code of a part from outside this library: an edited formula must never meet old kernels."""
    kind = type(part)
    if kind.__module__.startswith("flocking."):
        return ""
    codes = [
        (name, code.co_code, code.co_consts, code.co_names)
        for name, member in sorted(vars(kind).items())
        if (code := getattr(getattr(member, "fget", member), "__code__", None)) is not None
    ]
    return hashlib.sha256(repr((kind.__qualname__, codes)).encode()).hexdigest()[:16]
