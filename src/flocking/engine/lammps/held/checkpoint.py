"""Checkpoints under held control on many processes: all that belongs to an agent in one row, whichever rank has it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TypedDict, cast

import numpy as np

from flocking.arrays import Array
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import (
    Flag,
    Integer,
    MalformedError,
    Many,
    Maybe,
    Names,
    Real,
    Row,
    Table,
)
from flocking.engine.fixed_step.step_counts import time_slack
from flocking.engine.lammps.domains.checkpoint import LinkRows
from flocking.engine.protocol.session import Packed
from flocking.engine.tiles.checkpoint import flattened, restored
from flocking.engine.tiles.checkpoint_form import check_records
from flocking.engine.tiles.held.checkpoint import ANY, MOST_STEPS, NUMBERS, check_ascending
from flocking.engine.tiles.held.held_ledger import POWERS, LedgerFields
from flocking.engine.tiles.held.memory import HeldMemory
from flocking.engine.tiles.kernels.tile_sums import SUMS
from flocking.engine.tiles.records import RecordsMemory
from flocking.model.law import Scenario
from flocking.model.world.times import NANOSECOND


@dataclass(frozen=True, eq=False)
class Carried:
    """What belongs to all agents, in the order of their numbers.

    Parameters
    ----------
    rows
        Position, velocity and `flocking.engine.lammps.held.particles.HeldRankParticles.columns`.
    links
        True links under each graph with memory, then those by the information of agents; None before there are lists.
    """

    rows: Array
    links: list[LinkRows] | None


class HeldRankFields(TypedDict):
    """Fields of a checkpoint, by their names in files."""

    time: float
    looked: float
    farthest: float
    ledger_ends: float
    steps: int
    step_length: int
    acted: bool
    ledger: LedgerFields
    rows: Array
    links: list[LinkRows] | None
    waiting: list[int]
    samples: list[Array] | None
    records: RecordsMemory


def pack_held_ranks(memory: HeldMemory, carried: Carried) -> Packed:
    """Numbers and arrays of a session, without its scenario and the records on disk; arrays are not copied.

    Parameters
    ----------
    memory
        What the session goes on from.
    carried
        What belongs to the agents.
    """
    arrays: Arrays = {}
    store, ledger = memory.particles.store, memory.ledger
    data = {name: getattr(memory, name) for name in (*NUMBERS, "steps", "step_length", "acted")} | {
        "ledger": ledger.stored(), "rows": carried.rows,
        "links": carried.links, "waiting": [when for when, _, _ in memory.waiting],
        "samples": None if store is None else [store.off, store.speeds.table], "records": memory.records.memory(),
    }  # fmt: skip
    return {"options": asdict(memory.options), "session": flattened(data, arrays)}, arrays


def unpacked(numbers: Mapping[str, object], arrays: Arrays, scenario: Scenario, moving: int) -> HeldRankFields:
    """The state of a session from its packed form.

    Parameters
    ----------
    numbers, arrays
        The packed form, read from a file that anybody may have written.
    scenario
        The scenario.
    moving
        Number of kinds of links that are stored.

    Raises
    ------
    MalformedError
        If it is of no session of this scenario.
    """
    n, m = scenario.start.q.shape
    slack = time_slack(scenario)
    span = scenario.t_end - scenario.start.t
    powers = Table("f8", (len(POWERS),), finite=False)
    links = Row([Table("i8", (n + 1,), least=0), Table("i4", (None,), least=0, most=n - 1)])
    samples = Row([Table("f8", (None, 2), least=0.0), Table("f8", (None, m + 2))])
    found = Names(
        {
            "time": Real(scenario.start.t - slack, scenario.t_end + slack), "steps": Integer(0, MOST_STEPS),
            "step_length": Integer(1), "acted": Flag(), "looked": Real(0.0, span + slack),
            "farthest": Real(least=0.0, finite=False), "ledger_ends": ANY,
            "ledger": Names({
                "integrals": powers, "powers": powers, "jumped": ANY, "wanted": ANY,
                "sums": Names({}, dict.fromkeys(SUMS, ANY)),
            }),
            "rows": Table("f8", (n, None), finite=False), "links": Maybe(Row([links] * moving)),
            "waiting": Many(Integer(0)), "samples": Maybe(samples), "records": check_records(scenario),
        }
    ).check(restored(numbers["session"], arrays), "session")  # fmt: skip
    checked = cast(HeldRankFields, found)
    # Forces may be infinite, which limits of bodies make finite: of columns the particles know which are forces.
    if not np.isfinite(checked["rows"][:, : 2 * m]).all():
        raise MalformedError("session: rows must begin with finite positions and velocities")
    for offsets, partners in checked["links"] or []:
        if offsets[0] != 0 or offsets[-1] != len(partners) or (np.diff(offsets) < 0).any():
            raise MalformedError("session: links must have ascending offsets that end with them")
    step, now = checked["step_length"] * NANOSECOND, checked["steps"] * checked["step_length"]
    if not -slack <= checked["time"] - scenario.start.t - now * NANOSECOND <= step + slack:
        raise MalformedError("session: steps must end within a step of the time")
    if any(when < now for when in checked["waiting"]):
        raise MalformedError("session: waiting forces must act later")
    check_ascending(checked["waiting"])
    return checked
