"""What a recorder hands over to be written to disk."""

from __future__ import annotations

from dataclasses import dataclass

from flocking.arrays import Array, Mask, Reals, Records, Times


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
    """

    t: Times
    q: Reals
    p: Reals
    links: Mask | None
    switches: Records
    trace: Records
    observed: Records | None
    errors: Array | None = None
