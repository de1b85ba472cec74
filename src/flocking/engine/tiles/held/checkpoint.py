"""Conversion of a session under held control to plain numbers and named arrays, and back, with all checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import pairwise
from typing import TypedDict, cast

import numpy as np

from flocking.arrays import Array, Indices, Numbers, Reals
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import (
    Flag,
    Form,
    Integer,
    MalformedError,
    Many,
    Maybe,
    Names,
    Nothing,
    Part,
    Real,
    Row,
    Table,
)
from flocking.engine.fixed_step.step_counts import time_slack
from flocking.engine.protocol.session import Packed, Stored
from flocking.engine.tiles.checkpoint import flattened, restored
from flocking.engine.tiles.checkpoint_form import check_lists, check_records, stored_options
from flocking.engine.tiles.held.held_actuation import ActuationFields
from flocking.engine.tiles.held.held_ledger import POWERS, HeldLedger, LedgerFields
from flocking.engine.tiles.held.held_particles import HeldParticles
from flocking.engine.tiles.held.memory import HeldMemory
from flocking.engine.tiles.kernels.tile_sums import SUMS
from flocking.engine.tiles.neighbours.cell_search import TILES_IN_CHUNK
from flocking.engine.tiles.neighbours.neighbour_lists import WIDTH, TileLists
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.particle_memory import ParticleMemory
from flocking.engine.tiles.records import RecordsMemory
from flocking.model.law import Scenario
from flocking.model.world.times import NANOSECOND

NUMBERS = ("time", "looked", "farthest", "ledger_ends")
"""Numbers of a session that are stored as they are."""


class SampleFields(TypedDict):
    """Fields of the samples, by their names in files; ``truth`` is None where the samples are the truth."""

    rows: Reals
    truth: Reals | None
    errors: Array
    off: Array
    speeds: Array


class HeldFields(TypedDict):
    """Fields of a checkpoint, by their names in files."""

    time: float
    steps: int
    step_length: int
    acted: bool
    crowd: ParticleMemory
    force: Reals
    margin: float
    samples: SampleFields | None
    actuation: ActuationFields
    known: list[TileLists | None]
    known_rooms: list[Numbers]
    ledger: LedgerFields
    waiting: list[tuple[int, Indices, Reals]]
    records: RecordsMemory


ANY = Real(finite=False)
MOST_STEPS = 1 << 53
"""Largest number of steps that a checkpoint may name."""


def pack_held(memory: HeldMemory) -> Packed:
    """Numbers and arrays of a session, without its scenario and the records on disk; arrays are not copied.

    Parameters
    ----------
    memory
        What the session goes on from.
    """
    arrays: Arrays = {}
    particles, ledger = memory.particles, memory.ledger
    data = {name: getattr(memory, name) for name in (*NUMBERS, "steps", "step_length", "acted")} | {
        "crowd": ParticleMemory.of(particles, copied=False), "force": particles.force, "known": particles.known,
        "margin": particles.search.margin, "samples": None if particles.store is None else particles.store.memory(),
        "known_rooms": [b.capacity for b in particles.known_builders],
        "ledger": ledger.stored(),
        "waiting": [list(each) for each in memory.waiting], "records": memory.records.memory(),
    }  # fmt: skip
    if particles.actuation is not None:
        data["actuation"] = particles.actuation.memory()
    return {"options": asdict(memory.options), "session": flattened(data, arrays)}, arrays


def packed_options(packed: Packed) -> TilesOptions:
    """Options of a packed session.

    Raises
    ------
    MalformedError, InvalidInput, KeyError
        When they are none.
    """
    options = stored_options(packed[0]["options"])
    # Runs of earlier versions keep no log.
    return replace(options, log=bool(options.log))


def recall_held(packed: Packed, stored: Stored, memory: HeldMemory) -> None:
    """Let a session at its start go on from what was packed.

    Parameters
    ----------
    packed
        What `pack_held` gave, read from a file that anybody may have written.
    stored
        Its scenario and its records.
    memory
        Memory of a session of this scenario and these options at its start; it is changed.

    Raises
    ------
    MalformedError, ValueError, KeyError, TypeError
        When it is of no session of this scenario.
    """
    numbers, arrays = packed
    data = restored(numbers["session"], arrays)
    _check(data, stored.scenario, memory.particles)
    # Every entry has been checked.
    found, particles = cast(HeldFields, data), memory.particles
    found["crowd"].put_back(particles)
    particles.search.margin = float(found["margin"])
    if particles.store is not None and found["samples"] is not None:
        particles.store.recall(**found["samples"])
    if particles.actuation is not None:
        now = int(found["steps"]) * int(found["step_length"])
        particles.actuation.recall(found["actuation"], now, particles.ids)
    particles.recall_known(found["force"], found["known"], found["known_rooms"])
    memory.step_length, memory.steps, memory.acted = (
        int(found["step_length"]),
        int(found["steps"]),
        bool(found["acted"]),
    )
    for name in NUMBERS:
        setattr(memory, name, float(cast(float, data[name])))  # type: ignore[index]
    memory.ledger = HeldLedger.restored(found["ledger"])
    memory.waiting = [(int(when), who.copy(), u.copy()) for when, who, u in found["waiting"]]
    memory.records.recall_memory(found["records"], stored.counts, stored.read)


def _samples(particles: HeldParticles) -> Form[dict[str, object]] | Form[None]:
    """Form of the samples of a session with such particles."""
    store = particles.store
    if store is None:
        return Nothing()
    rows = Table(particles.dtype, store.rows.shape)
    return Names(
        {
            "rows": rows,
            "truth": rows if store.keeps_truth else Nothing(),
            "errors": Table("f8", store.errors.shape),
            "off": Table("f8", store.off.shape, least=0.0),
            "speeds": Table("f8", (None, particles.m + 2)),
        }
    )


def _actuation(particles: HeldParticles) -> dict[str, Form[dict[str, object]]]:
    """Form of what stands between the desired and the acting forces, by name; nothing for points."""
    found = particles.actuation
    if found is None:
        return {}
    lag = Nothing() if found.lag is None else Table(particles.dtype, found.lag.shape)
    heading = Nothing() if found.heading is None else Table("f8", found.heading.shape)
    desired = Table(particles.dtype, found.desired.shape, finite=False)
    return {"actuation": Names({"wanted": desired, "lag": lag, "heading": heading})}


def _check(data: object, scenario: Scenario, particles: HeldParticles) -> None:
    """Check the stored state; its particle arrays are checked where they are put back."""
    n, m, kind = particles.n, particles.m, particles.dtype
    slack = time_slack(scenario)
    span = scenario.t_end - scenario.start.t
    lists = Part(
        TileLists,
        {
            "rows": Table("u4", (None, WIDTH)), "first": Table("i8", (particles.tiles,), least=0),
            "count": Table("i4", (particles.tiles,), least=0),
        },
    )  # fmt: skip
    capacity = Table("i8", (particles.known_builders[0].chunks,), least=0, most=TILES_IN_CHUNK * n * 9 // 8 + 8)
    powers = Table("f8", (len(POWERS),), finite=False)
    waiting = Row([Integer(0), Table("i8", (None,), least=0, most=n - 1), Table(kind, (None, m))])
    found = Names(
        {
            "time": Real(scenario.start.t - slack, scenario.t_end + slack), "steps": Integer(0, MOST_STEPS),
            "step_length": Integer(1), "acted": Flag(), "looked": Real(0.0, span + slack),
            "farthest": Real(least=0.0, finite=False), "ledger_ends": ANY,
            "crowd": Part(ParticleMemory, {"fields": Names({}, others=True)}),
            "force": Table(kind, particles.force.shape, finite=False),
            "margin": Real(least=0.0),
            "samples": _samples(particles), **_actuation(particles),
            "known": Row([Maybe(lists)] * len(particles.known)),
            "known_rooms": Row([capacity] * len(particles.known)),
            "ledger": Names({
                "integrals": powers, "powers": powers, "jumped": ANY, "wanted": ANY,
                "sums": Names({}, dict.fromkeys(SUMS, ANY)),
            }),
            "waiting": Many(waiting), "records": check_records(scenario),
        }
    ).check(data, "session")  # fmt: skip
    checked = cast(HeldFields, found)
    step, now = checked["step_length"] * NANOSECOND, checked["steps"] * checked["step_length"]
    if not -slack <= checked["time"] - scenario.start.t - now * NANOSECOND <= step + slack:
        raise MalformedError("session: steps must end within a step of the time")
    built = bool(checked["crowd"].fields.get("rebuilds"))
    for k, (each, graph) in enumerate(zip(checked["known"], particles.control_spec.graphs, strict=True)):
        if each is not None:
            check_lists(each, n, particles.size, f"session: known[{k}]")
        own = built and not graph.fixed
        # Earlier versions kept lists of their own for all graphs under messages.
        if (each is None and own and graph.memory) or (
            each is not None and not (own and (graph.memory or particles.store is not None))
        ):
            raise MalformedError("session: known must hold the lists of graphs with links of their own")
    for when, who, u in checked["waiting"]:
        if len(who) != len(u) or (np.diff(who) <= 0).any() or when < now:
            raise MalformedError("session: waiting must hold forces of agents in order that act later")
    check_ascending([when for when, _, _ in checked["waiting"]])


def check_ascending(times: Sequence[int]) -> None:
    """Check the times at which forces that wait will act.

    Raises
    ------
    MalformedError
        When they do not ascend: what is not first would never act.
    """
    if any(late <= early for early, late in pairwise(times)):
        raise MalformedError("session: waiting must hold forces in the order of their times")
