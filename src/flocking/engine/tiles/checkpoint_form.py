"""Validation of the checkpoint of a tiled session against its scenario and particle arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypedDict, cast

import numpy as np

from flocking.arrays import Links, Numbers, Numbers32, Reals
from flocking.engine.archives.data_checks import (
    And,
    Flag,
    Form,
    Integer,
    MalformedError,
    Many,
    Maybe,
    Names,
    Part,
    Real,
    Row,
    Table,
    Text,
    squarable,
)
from flocking.engine.fixed_step.law_gaps import LawGaps
from flocking.engine.fixed_step.step_counts import time_slack
from flocking.engine.fixed_step.supported_bodies import is_point
from flocking.engine.runs.run import FIRST_QUANTITIES, TRACE_FIELDS, Closest
from flocking.engine.tiles.instability import SAMPLE, Instability
from flocking.engine.tiles.integrators import INTEGRATED
from flocking.engine.tiles.kernels.tile_sums import SUMS
from flocking.engine.tiles.neighbours.cell_search import TILES_IN_CHUNK
from flocking.engine.tiles.neighbours.neighbour_lists import LINKED, NUMBER, WIDTH, TileLists
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.model.law import Scenario

ANY = Real(finite=False)
POSITIVE = Real(least=0.0, finite=False)
ROWS_AT_ONCE = 2**18
"""Number of rows of a list that are checked at once; limits the memory in use."""


class ParticleFields(TypedDict):
    """The particle memory, with the names and shapes of `ParticleArrays`.

    ``rooms`` is the capacity of the lists in rows, for each chunk of each graph.
    """

    X: Reals
    ids: Numbers32
    each: list[Reals]
    A: Reals
    C: Reals
    reference: Reals
    elapsed: float
    bound: float
    skin: float
    rebuilds: int
    lists: list[TileLists | None]
    top_speed: float
    _rounding: float
    _first_links: Links | None
    lost: tuple[int, int] | None
    rooms: list[Numbers]


class OptionFields(TypedDict, total=False):
    """The options of a session, with the names of `TilesOptions`."""

    step: float | None
    scheme: str | None
    precision: str
    threads: int | None
    ledger: bool
    observe: bool
    keep_frames: bool
    skin: float | None
    memory_limit: float | None
    ledger_at: str
    log: bool | None


_OPTIONS = Names(
    {},
    {
        "step": Maybe(Real()), "scheme": Maybe(Text()), "precision": Text(), "threads": Maybe(Integer()),
        "ledger": Flag(), "observe": Flag(), "keep_frames": Flag(), "skin": Maybe(Real()),
        "memory_limit": Maybe(Real(finite=False)), "ledger_at": Text(),
        "log": Maybe(Flag()),
    },
)  # fmt: skip


def stored_options(data: object) -> TilesOptions:
    """Read the options of a session from the plain ``data`` of its checkpoint.

    Raises
    ------
    MalformedError, InvalidInput
        If ``data`` is not a valid set of options.
    """
    return TilesOptions(**cast(OptionFields, _OPTIONS.check(data, "options")))


def _is_ledger_row(row: Sequence[object]) -> bool:
    """Whether the number of fields is that of a ledger row, of this version or of one with fewer columns."""
    return FIRST_QUANTITIES <= len(row) <= len(TRACE_FIELDS.names or ())


def check_session(data: object, ledger_sums: type[object], memory: type[object], scenario: Scenario) -> None:
    """Check the stored state of a session; its particle arrays are checked by `check_particles`.

    Parameters
    ----------
    data
        The restored checkpoint.
    ledger_sums, memory
        Class of the ledger of an integrator, and of the particle memory.

    Raises
    ------
    MalformedError
        If an entry is invalid; the message names it.
    """
    n, m = scenario.start.q.shape
    slack = time_slack(scenario)
    time = Real(scenario.start.t - slack, scenario.t_end + slack)
    plan = And(
        Row([time, time, Integer(1), Integer()]), "advance in time",
        lambda x: bool(x[0] <= x[1] and x[3] <= x[2]),
    )  # fmt: skip
    sums = And(Names({}, dict.fromkeys(SUMS, ANY)), "hold all sums or none", lambda x: len(x) in (0, len(SUMS)))
    departs = scenario.agents.order == 2 and not is_point(scenario.agents)
    integrals = Table("f8", (len(INTEGRATED) + departs,), finite=False)
    ledger = Part(ledger_sums, {"integrals": integrals, "jumped": ANY, "sums": sums, "ahead": integrals})
    Names(
        {
            "step": Real(least=float(np.finfo(float).tiny)), "time": time, "plan": plan, "steps": Integer(),
            "crowd": Part(memory, {"fields": Names({}, others=True)}),
            "scheme": Names({"last": Real(least=0.0), "counted": Flag(), "books": ledger}),
            "records": check_records(scenario),
            "farthest": POSITIVE,
            "law_gaps": Part(LawGaps, {"checks": Integer(), "gap": ANY, "allowed": ANY, "worst": ANY}),
            "instability": _instability(n, m),
        }
    ).check(data, "session")  # fmt: skip


def check_records(scenario: Scenario) -> Names:
    """Form of the state of the records of a session of this scenario."""
    row = And(Many(ANY), "have the fields of a row of the ledger", _is_ledger_row)
    replaced = And(Many(ANY), "have a time", lambda x: len(x) > 0)
    one_row = And(Many(row), "hold one row at most", lambda x: len(x) <= 1)
    return Names(
        {
            "count": Integer(0, len(scenario.frame_times)),
            "apart": ANY,
            "first": Maybe(row),
            "open": one_row,
            "closest": _closest(scenario.start.n),
        },
        {"replaced": replaced, "rounding": POSITIVE},
    )


def _closest(n: int) -> Part[Closest]:
    pair = And(
        Row([Integer(-1, n - 1)] * 2), "contain two agents or none", lambda x: (x[0] < 0) == (x[1] < 0)
    )  # fmt: skip
    return Part(Closest, {"distance": ANY, "time": ANY, "pair": pair, "error": ANY})


def _instability(n: int, m: int) -> Form[Instability]:
    looked_at = len(range(0, n, max(1, n // SAMPLE)))
    return And(
        Part(
            Instability,
            {
                "speed": POSITIVE, "streak": Integer(), "grown": ANY, "rebuilds": Integer(-1),
                "places": Maybe(Table("i4", (looked_at,), least=0, most=n - 1)),
                "change": Maybe(Table("f8", (looked_at, m), finite=False)), "products": ANY, "sizes": ANY,
                "compared": Integer(), "early": ANY, "late": ANY, "turns": Integer(),
            },
        ),
        "contain the agents whose velocities changed", lambda x: x.change is None or x.places is not None,
    )  # fmt: skip


def check_particles(fields: Mapping[str, object], particles: ParticleArrays) -> ParticleFields:
    """Check the stored particle arrays.

    Parameters
    ----------
    fields
        What was read.
    particles
        Particle arrays of the same scenario and options.

    Raises
    ------
    MalformedError
        When it is none; the message names what is wrong.
    """
    n, agent = particles.n, Integer(0, particles.n - 1)
    kind, large = particles.dtype, squarable(particles.dtype)
    lists = Part(
        TileLists,
        {
            "rows": Table("u4", (None, WIDTH)), "first": Table("i8", (particles.tiles,), least=0),
            "count": Table("i4", (particles.tiles,), least=0),
        },
    )  # fmt: skip
    # No tile has more rows than there are agents, and the capacity exceeds the need by an eighth.
    most_capacity = TILES_IN_CHUNK * n * 9 // 8 + 8
    Names(
        {
            "X": Table(kind, (2 * particles.m, particles.size), -large, large, ordered=False),
            "ids": Table("i4", (particles.size,), least=0, most=n - 1),
            "each": Row([Table(kind, each.shape, least=0.0, finite=False) for each in particles.radii.each]),
            "A": Table(kind, particles.parameters.A.shape),
            "C": Table(kind, particles.displacement.velocity.shape, -large, large),
            # Before the first rebuild there are no lists.
            "reference": Table(kind, particles.displacement.reference.shape, finite=False),
            "elapsed": Real(), "bound": POSITIVE, "skin": Real(least=0.0), "rebuilds": Integer(),
            "lists": Row([Maybe(lists)] * len(particles.spec.graphs)), "top_speed": POSITIVE, "_rounding": POSITIVE,
            "_first_links": Maybe(Table("?", (n, n), ordered=False)), "lost": Maybe(Row([agent, agent])),
            "rooms": Row(
                [Table("i8", b.capacity.shape, least=0, most=most_capacity) for b in particles.search.builders]
            ),
            **({"columns": Table(kind, particles.body_rows.further.shape)} if len(particles.body_rows.further) else {}),
        }
    ).check(fields, "crowd")  # fmt: skip
    # Every entry has been checked.
    checked = cast(ParticleFields, fields)
    ids = checked["ids"]
    present = np.zeros(n, dtype=bool)
    present[ids[:n]] = True
    if not present.all() or (ids[n:] != ids[n - 1]).any():
        raise MalformedError("crowd: ids must contain every agent once")
    missing = [x is None for x in checked["lists"]]
    if any(missing) and (not all(missing) or checked["rebuilds"] or checked["bound"] < np.inf):
        raise MalformedError("crowd: lists must be stored, or be due for a rebuild")
    for k, found in enumerate(checked["lists"]):
        if found is not None:
            check_lists(found, n, particles.size, f"crowd: lists[{k}]")
    return checked


def check_lists(lists: TileLists, n: int, size: int, name: str) -> None:
    """Check that every entry in use is the index of an agent; rows between the tiles are uninitialized.

    Parameters
    ----------
    lists
        The lists that were read.
    n, size
        Number of agents, and of places.
    name
        What the lists are called, for the message.

    Raises
    ------
    MalformedError
        If one is not.
    """
    rows, first, end = lists.rows, lists.first, lists.first + lists.count
    if end.max(initial=0) > len(rows):
        raise MalformedError(f"{name} must end within its {len(rows)} rows")
    held = np.zeros(len(rows) + 1, np.int64)
    np.add.at(held, first, 1)
    np.add.at(held, end, -1)
    used = np.cumsum(held)[:-1] > 0
    # The last tile has padding lanes; their link bits have no meaning.
    last = slice(int(first[-1]), int(end[-1]))
    for begin in range(0, len(rows), ROWS_AT_ONCE):
        part = slice(begin, begin + ROWS_AT_ONCE)
        entries = rows[part][used[part]]
        if (entries & NUMBER).max(initial=0) >= size:
            raise MalformedError(f"{name} must contain indices of existing agents")
        linked = (entries & LINKED).astype(bool) & ((entries & NUMBER) >= n)
        if linked.any():
            nobody = np.zeros((len(rows[part]), WIDTH), dtype=bool)
            nobody[max(0, last.start - begin) : max(0, last.stop - begin), n - size :] = n < size
            if (linked & ~nobody[used[part]]).any():
                raise MalformedError(f"{name} must link existing agents")
