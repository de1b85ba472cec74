"""A start from a file: the last or any frame of a GSD or NPZ file, or a CSV table of agents."""

from __future__ import annotations

import csv
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from flocking.arrays import AnyArray
from flocking.engine.archives.archive import NPZ_ERRORS
from flocking.engine.storage.atomic_files import storage_errors
from flocking.engine.storage.export_formats import axis_names
from flocking.errors import InvalidInput, StorageError
from flocking.formula.safe_digits import given_text
from flocking.model.state import State

LARGEST_CSV = 2**28
"""Largest CSV table read, in bytes; larger groups belong in NPZ or GSD."""


def read_start(path: str | Path, *, frame: int = -1) -> State:
    """Positions and velocities from a file, as a start at time 0 without links.

    Parameters
    ----------
    path
        ``.gsd``: any GSD file of the hoomd schema; ``.npz``: arrays ``q`` and, unless at rest, ``p`` of shape (N, m) or
        (F, N, m); ``.csv``: a row per agent, columns ``x``, ``y``, ``z`` and, unless at rest, ``vx``, ``vy``, ``vz``;
        a column ``t`` must have one time.
    frame
        Number of the frame in a file with several; the last by default.

    Raises
    ------
    StorageError
        If the file cannot be read or does not match its suffix.
    InvalidInput
        If the suffix is unknown or the values are not a valid state.
    """
    if not isinstance(path, str | Path):
        raise InvalidInput("read_start", "path", "must be a path", path)
    path = Path(path)
    form = path.suffix.removeprefix(".").lower()
    if form not in READERS:
        raise InvalidInput("read_start", "path", f"must end in one of {', '.join('.' + k for k in READERS)}", str(path))
    with storage_errors(path, f"read {form}"):
        if not path.is_file():
            raise StorageError(f"{path}: no such file.")
        q, p = READERS[form](path, frame)
    return State(q, p)


def _pick(path: Path, count: int, frame: int) -> int:
    if not -count <= frame < count:
        raise StorageError(f"{path}: has {count} frames; there is no frame {frame}.")
    return frame % count


def _read_gsd(path: Path, frame: int) -> tuple[AnyArray, AnyArray]:
    try:
        import gsd.hoomd
    except ImportError:
        raise StorageError("GSD needs the package gsd: pip install 'flocking[export]'.") from None
    try:
        with gsd.hoomd.open(str(path), "r") as file:
            found = file[_pick(path, len(file), frame)]
    except RuntimeError as error:
        raise StorageError(f"{path}: not a GSD file of the hoomd schema ({error}).") from None
    places, speeds = (found.log.get(f"particles/flocking/{name}") for name in ("position", "velocity"))
    if places is not None:
        # GSD has no second axis of length one, and agents of order 1 have no velocities.
        q = places[:, None] if places.ndim == 1 else places
        return q, np.zeros_like(q) if speeds is None else speeds.reshape(q.shape)
    m = int(found.configuration.dimensions)
    return found.particles.position[:, :m], found.particles.velocity[:, :m]


def _read_npz(path: Path, frame: int) -> tuple[AnyArray, AnyArray]:
    try:
        with np.load(path, allow_pickle=False) as file:
            if not isinstance(file, np.lib.npyio.NpzFile) or "q" not in file.files:
                raise StorageError(f"{path}: contains no array 'q'.")
            q = file["q"]
            p = file["p"] if "p" in file.files else np.zeros_like(q)
    except NPZ_ERRORS as error:
        raise StorageError(f"{path}: not an NPZ file of plain arrays ({error}).") from None
    if q.ndim == 3 and q.shape == p.shape:
        k = _pick(path, len(q), frame)
        return q[k], p[k]
    return q, p


def _read_csv(path: Path, frame: int) -> tuple[AnyArray, AnyArray]:
    if path.stat().st_size > LARGEST_CSV:
        raise StorageError(f"{path}: too large for CSV; use NPZ.")
    try:
        reader = csv.DictReader(path.read_text(encoding="utf-8-sig").splitlines())
        rows = list(reader)
    except (UnicodeDecodeError, csv.Error) as error:
        raise StorageError(f"{path}: not a CSV table ({error}).") from None
    if not rows:
        raise StorageError(f"{path}: contains no rows. It needs a header x,y[,z][,vx,vy[,vz]] and a row per agent.")
    names = [str(name).strip() for name in rows[0]]
    given = [name.strip() for name in reader.fieldnames or ()]
    if twice := next((name for name in given if given.count(name) > 1), None):
        raise StorageError(f"{path}: has two columns called {twice!r}.")
    axes = next((a for m in (3, 2, 1) if set(a := axis_names(m)) <= set(names)), None)
    if axes is None:
        raise StorageError(f"{path}: has no columns x, y; its header is {','.join(names)}.")
    for name in "xyz":
        # No column is dropped in silence.
        if name not in axes and (found := next((x for x in (name, f"v{name}") if x in names), None)):
            raise StorageError(f"{path}: has a column {found}, but not every axis before it; its axes are {axes}.")
    speeds = [f"v{name}" for name in axes]
    missing = [name for name in speeds if name not in names]
    if missing and len(missing) < len(speeds):
        raise StorageError(f"{path}: has no column {missing[0]}, but other velocity columns.")
    table = {str(name).strip(): name for name in rows[0]}

    def column(name: str) -> list[float]:
        values = []
        for number, row in enumerate(rows, start=2):
            try:
                # Python alone reads 1_000 as a number.
                values.append(float(row[table[name]].replace("_", "?")))
            except (TypeError, ValueError, AttributeError):
                raise StorageError(f"{path}: line {number}, column {name}: no number: {row[table[name]]!r}.") from None
        return values

    if "t" in names and len(times := sorted(set(column("t")))) > 1:
        raise StorageError(
            f"{path}: column t has {len(times)} times, from {given_text(times[0])} to {given_text(times[-1])}; a start "
            "is of one. Keep the rows of one time: each row would be an agent of its own."
        )
    who = [str(row[table["id"]]).strip() for row in rows] if "id" in names else []
    if twice := next((x for x, times in Counter(who).items() if times > 1), None):
        raise StorageError(f"{path}: column id names {twice!r} twice; a start has one row for each agent.")
    q = np.array([column(name) for name in axes]).T
    return q, np.zeros_like(q) if missing else np.array([column(name) for name in speeds]).T


READERS: dict[str, Callable[[Path, int], tuple[AnyArray, AnyArray]]] = {
    "gsd": _read_gsd, "npz": _read_npz, "csv": _read_csv,
}  # fmt: skip
"""Readers by the suffix of their files."""
