"""Checkpoints of a session on many processes: all agents with their links, whichever rank has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import cast

import numpy as np

from flocking.arrays import Array, Numbers, Numbers32
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import MalformedError, Maybe, Names, Row, Table
from flocking.engine.lammps.domains.options import DomainOptions
from flocking.engine.tiles.checkpoint import SessionMemory, restored
from flocking.engine.tiles.checkpoint_form import check_session
from flocking.engine.tiles.checkpoint_form import stored_options as tiles_options
from flocking.engine.tiles.integrators import LedgerSums
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.particle_memory import ParticleMemory
from flocking.model.law import Scenario

LinkRows = tuple[Numbers, Numbers32]
"""Links under one graph: those of agent k are ``numbers[offsets[k] : offsets[k + 1]]``."""


def link_rows(pairs: Array, n: int) -> LinkRows:
    """Links of all agents from linked pairs of numbers.

    Parameters
    ----------
    pairs
        Sensing and sensed agents, shape (K, 2).
    n
        Number of agents.
    """
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    i, j = pairs[order].T
    counts = np.bincount(i.astype(np.int64), minlength=n)
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64), j.astype(np.int32)


def link_tables(rows: LinkRows) -> Numbers32:
    """Links of all agents as a table, see `flocking.engine.lammps.domains.link_tables.link_table`.

    Parameters
    ----------
    rows
        As `link_rows` gives them.
    """
    offsets, numbers = rows
    counts = np.diff(offsets)
    table = np.zeros((len(counts), int(counts.max(initial=0)) or 1), np.int32)
    column = np.arange(len(numbers)) - np.repeat(offsets[:-1], counts)
    table[np.repeat(np.arange(len(counts)), counts), column] = numbers + 1
    return table


def columns_of(scenario: Scenario, rows: Array) -> dict[str, Array]:
    """Further columns of all agents by name, shape (N, width) each.

    Parameters
    ----------
    scenario
        The scenario.
    rows
        Positions, velocities and further columns of all agents, shape (N, 2m + widths).
    """
    found, first = {}, 2 * scenario.start.dimension
    for name, width in scenario.agents.widths(scenario.start.dimension).items():
        found[name] = np.ascontiguousarray(rows[:, first : first + width])
        first += width
    return found


def stored_options(data: object) -> DomainOptions:
    """The options of a run on disk, without the log file: its path comes from the file and is not trusted.

    Raises
    ------
    InvalidInput, MalformedError
        If they are invalid.
    """
    if not isinstance(data, Mapping):
        raise MalformedError("options must be a table")
    found = tiles_options({name: x for name, x in data.items() if name not in ("forces", "keep_log")})
    return DomainOptions(**{f.name: getattr(found, f.name) for f in fields(TilesOptions)})


def unpacked(numbers: Mapping[str, object], arrays: Arrays, scenario: Scenario, moving: int) -> SessionMemory:
    """The state of a session from its packed form.

    Parameters
    ----------
    numbers, arrays
        The packed form.
    scenario
        The scenario.
    moving
        Number of graphs whose links are stored.

    Raises
    ------
    MalformedError
        If it is of no session of this scenario.
    """
    found = restored(numbers["session"], arrays)
    check_session(found, LedgerSums, ParticleMemory, scenario)
    # `check_session` has checked every entry.
    memory = cast(SessionMemory, found)
    n, m = scenario.start.q.shape
    links = Row([Table("i8", (n + 1,), least=0), Table("i4", (None,), least=0, most=n - 1)])
    form = {"q": Table("f8", (n, m)), "p": Table("f8", (n, m)), "links": Maybe(Row([links] * moving))}
    width = sum(scenario.agents.widths(m).values())
    Names(form | ({"columns": Table("f8", (n, width))} if width else {})).check(memory["crowd"].fields, "crowd")
    for offsets, partners in cast(list[LinkRows], memory["crowd"].fields["links"] or []):
        if offsets[0] != 0 or offsets[-1] != len(partners) or (np.diff(offsets) < 0).any():
            raise MalformedError("crowd: links must have ascending offsets that end with them")
    return memory
