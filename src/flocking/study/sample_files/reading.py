"""Reads samples of a motion from a file of any known format."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from flocking.errors import InvalidInput
from flocking.study.sample_files.arrays import read_gsd, read_npz
from flocking.study.sample_files.recordings import read_mcap
from flocking.study.sample_files.samples import Columns, Samples, check_size
from flocking.study.sample_files.tables import read_csv, read_parquet

ENDINGS = (".csv", ".parquet", ".npz", ".gsd", ".mcap")
"""Endings of the files that can be read."""


def read_samples(
    path: str | Path, *, columns: Mapping[str, str] | None = None, time_step: float | None = None
) -> Samples:
    """Read samples of a motion.

    The file is not trusted: its size is bounded, nothing in it is unpickled, and every value must be finite.

    Parameters
    ----------
    path
        A CSV or Parquet table with the columns ``t``, ``id``, ``x``, ``y``, ``z`` and, where velocities are known,
        ``vx``, ``vy``, ``vz``, one row per agent and time; an NPZ file with arrays ``t`` (F,), ``q`` and ``p``
        (F, N, m); a GSD file; or an MCAP file with messages of JSON. The ending states which.
    columns
        Names of columns or arrays in the file, by the names above: ``{"t": "time", "id": "bird"}``.
    time_step
        Time of one step, for GSD files of other programs, which count steps.

    Raises
    ------
    InvalidInput
        When the file is missing, too large, or not of this form; the message names the place.
    StorageError
        When its format needs a package that is not installed.
    """
    path = Path(path)
    if not path.is_file():
        raise InvalidInput("read_samples", "path", "must be a file", str(path))
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        raise InvalidInput("read_samples", "path", f"must end in {', '.join(ENDINGS)}", str(path))
    if time_step is not None and ending != ".gsd":
        raise InvalidInput("read_samples", "time_step", "must be absent but for GSD files", time_step)
    check_size(path, path.stat().st_size)
    named = Columns(path, dict(columns or {}))
    if ending == ".gsd":
        return read_gsd(path, named, time_step)
    return {".csv": read_csv, ".parquet": read_parquet, ".npz": read_npz, ".mcap": read_mcap}[ending](path, named)
