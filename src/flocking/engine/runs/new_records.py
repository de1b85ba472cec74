"""Records that a recorder hands over to be written to disk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NotRequired, TypedDict

import numpy as np

from flocking.arrays import Array, Links, Mask, Reals, Records, Times
from flocking.engine.runs.message_log import MessageLog
from flocking.engine.runs.run import FineSamples


class RecordLayout(TypedDict, total=False):
    """How the records of a session are stored on disk.

    Parameters
    ----------
    with_links
        Whether frames hold link matrices.
    precision
        ``"float64"`` or ``"float32"``, of the frames.
    observed
        Whether there are observations.
    with_errors
        Whether errors of the frames are known.
    with_log
        Whether there is a log of what agents used when they acted.
    """

    with_links: bool
    precision: str
    observed: bool
    with_errors: bool
    with_log: bool


class RecordTables(TypedDict):
    """The records of a session as arrays, by the names and with the shapes of `flocking.engine.runs.run.Run`."""

    t: Times
    q: Reals
    p: Reals
    links: Links
    switches: Records
    trace: Records
    observables: NotRequired[Records | None]
    fine: NotRequired[FineSamples | None]
    columns: NotRequired[Mapping[str, Array]]
    log: NotRequired[MessageLog | None]


@dataclass(frozen=True, eq=False)
class NewRecords:
    """Records of a running simulation that are not on disk yet.

    Parameters
    ----------
    t, q, p, links
        Frames: times (F,), positions and velocities (F, N, m), and link matrices (F, N, N) or None.
    switches, trace
        Rows of `SWITCH_FIELDS` and of `TRACE_FIELDS`.
    observed
        Rows of `OBSERVED_FIELDS`, or None where nothing is observed.
    errors
        Errors of positions and of velocities at the frames, shape (F, 2), or None where none are known.
    columns
        Further columns of the agents at the frames by name, shape (F, N, width) each.
    log
        What agents used when they acted, or None where no log is kept.
    """

    t: Times
    q: Reals
    p: Reals
    links: Mask | None
    switches: Records
    trace: Records
    observed: Records | None
    errors: Array | None = None
    columns: Mapping[str, Array] = field(default_factory=dict)
    log: MessageLog | None = None


def stacked_columns(frames: Sequence[Mapping[str, Array]]) -> dict[str, Array]:
    """Further columns of some frames, shape (F, N, width) each, from those of each frame."""
    return {name: np.array([frame[name] for frame in frames]) for name in (frames[0] if frames else ())}
