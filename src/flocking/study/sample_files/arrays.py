"""Files of arrays: NPZ, and GSD of particle simulations."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flocking.engine.archives.archive import NPZ_ERRORS
from flocking.engine.storage.export_formats import missing_package
from flocking.errors import InvalidInput
from flocking.model.checks import Array
from flocking.study.sample_files.samples import (
    Columns,
    Samples,
    check_size,
    check_times,
    finite_array,
    reason,
    storage_rounding,
)

if TYPE_CHECKING:
    import gsd.hoomd

ARRAY_COLUMNS = ("t", "q", "p")
"""Arrays of an NPZ file: times, positions and velocities."""

INDEX_ENTRY = 32
"""Bytes of an entry of the index of a GSD file; every frame that is stored has one or more."""

OWN_TIME, OWN_POSITION, OWN_VELOCITY = "flocking/time", "particles/flocking/position", "particles/flocking/velocity"
"""Entries of the log of GSD files that ``flocking export`` writes: in double precision, not wrapped into the box."""


def read_npz(path: Path, columns: Columns) -> Samples:
    """Read an NPZ file; nothing in it is unpickled.

    Parameters
    ----------
    path
        The file.
    columns
        Names of its arrays.

    Raises
    ------
    InvalidInput
        When an array is missing, too large unpacked, holds objects or a value that is not finite, or shapes disagree.
    """
    columns.check_names(ARRAY_COLUMNS)
    try:
        with zipfile.ZipFile(path) as packed:
            check_size(path, sum(entry.file_size for entry in packed.infolist()), "its arrays unpacked")
        with np.load(path, allow_pickle=False) as found:
            names = list(found.files)
            for ours in ("t", "q"):
                if columns.name(ours) not in names:
                    raise columns.missing(ours, names)
            arrays = {ours: found[columns.name(ours)] for ours in ARRAY_COLUMNS if columns.present(ours, names)}
    except InvalidInput:
        raise
    except (
        *NPZ_ERRORS, OSError, KeyError, TypeError, MemoryError, OverflowError, RuntimeError,
    ) as error:  # fmt: skip
        said = f"must be an NPZ file of plain arrays ({reason(error)})"
        raise InvalidInput(str(path), "file", said, path.name) from None
    checked = {
        ours: finite_array(path, columns.name(ours), values, 1 if ours == "t" else 3) for ours, values in arrays.items()
    }
    t, q, p = checked["t"], checked["q"], checked.get("p")
    if len(q) != len(t) or (p is not None and p.shape != q.shape):
        shapes = {columns.name(ours): values.shape for ours, values in checked.items()}
        raise InvalidInput(str(path), "arrays", "must agree in their numbers of times, agents and axes", shapes)
    check_times(path, t, f"array {columns.name('t')}")
    rounding = storage_rounding(arrays["q"]), storage_rounding(arrays.get("p"))
    return Samples(t, q, p, tuple(map(str, range(q.shape[1]))), rounding, columns.unused(arrays, names))


def read_gsd(path: Path, columns: Columns, time_step: float | None) -> Samples:
    """Read a GSD file.

    Files of ``flocking export`` hold times and double precision in their log. Of others times are the steps of the
    frames times ``time_step``, and positions are unwrapped by the images of the particles.

    Parameters
    ----------
    path
        The file.
    columns
        Must be empty: a GSD file has no columns to name.
    time_step
        Time of one step.

    Raises
    ------
    StorageError
        When the package gsd is missing.
    InvalidInput
        When it is no GSD file, frames have different particles, the time step is missing, or positions seem to be
        wrapped into the box.
    """
    columns.check_names(("none, for GSD files have no columns",)) if columns.given else None
    try:
        import gsd.hoomd
    except ImportError:
        raise missing_package("gsd", "GSD") from None
    try:
        with gsd.hoomd.open(str(path), "r") as file:
            return _read_frames(path, file, time_step)
    except InvalidInput:
        raise
    except (RuntimeError, OSError, ValueError, TypeError, LookupError, MemoryError, ArithmeticError) as error:
        raise InvalidInput(str(path), "file", f"must be a GSD file of particles ({reason(error)})", path.name) from None


def _read_frames(path: Path, file: gsd.hoomd.HOOMDTrajectory, time_step: float | None) -> Samples:
    count = len(file)
    if not count:
        raise InvalidInput(str(path), "file", "must have frames", 0)
    most = path.stat().st_size // INDEX_ENTRY
    if count > most:
        raise InvalidInput(str(path), "frames", f"must be at most {most} in a file of this size", count)
    n = int(file[0].particles.N)
    if n < 1:
        raise InvalidInput(str(path), "particles", "must be at least one", n)
    check_size(path, count * n * 3 * 8 * 2, "its positions and velocities")
    own = OWN_TIME in file[0].log and OWN_POSITION in file[0].log
    if not own and not (time_step is not None and np.isfinite(time_step) and time_step > 0):
        raise InvalidInput(
            str(path), "time step", "must be a positive number, for frames count steps", time_step,
            "Give the time of one step with --time-step.",
        )  # fmt: skip
    m = 2 if file[0].configuration.dimensions == 2 else 3
    if own and "flocking/dimension" in file[0].log:
        m = int(file[0].log["flocking/dimension"][0])
        check_size(path, count * n * max(m, 1) * 8 * 2, "its positions and velocities")
    # What this library wrote of agents of order 1 has no velocities.
    has_velocity = (
        OWN_VELOCITY in file[0].log
        if own
        else all(file.file.chunk_exists(frame=k, name="particles/velocity") for k in (0, count - 1))
    )
    t, q, p = np.zeros(count), np.zeros((count, n, m)), np.zeros((count, n, m))
    for k in range(count):
        frame = file[k]
        if n != frame.particles.N:
            raise InvalidInput(str(path), f"frame {k}", f"must have {n} particles, as the first", frame.particles.N)
        if own:
            t[k] = frame.log[OWN_TIME][0]
            for values, name in ((q, OWN_POSITION), (p, OWN_VELOCITY))[: 1 + has_velocity]:
                # GSD has no second axis of length one.
                shape = frame.log[name].shape
                if shape != (n, m) and not (m == 1 and shape == (n,)):
                    raise InvalidInput(str(path), f"frame {k}, {name}", f"must have the shape {(n, m)}", shape)
                values[k] = frame.log[name].reshape(n, m)
            continue
        box = np.asarray(frame.configuration.box, dtype=np.float64)
        if box[3:].any():
            raise InvalidInput(str(path), f"frame {k}, box", "must be a right-angled box", box.tolist())
        t[k] = float(frame.configuration.step) * float(time_step or 0.0)
        q[k] = frame.particles.position[:, :m] + frame.particles.image[:, :m] * box[:m]
        p[k] = frame.particles.velocity[:, :m]
        moved = np.abs(q[k] - q[k - 1]).max(axis=0, initial=0.0) if k else np.zeros(m)
        if (moved > box[:m] / 2).any() and not frame.particles.image.any():
            raise InvalidInput(
                str(path), f"frame {k}", "must not move a particle by more than half the box without its image",
                float(moved.max()), "Write images, or positions that are not wrapped.",
            )  # fmt: skip
    check_times(path, t, "times of frames")
    place = finite_array(path, "position", q, 3)
    speed = _velocities(path, p) if has_velocity else None
    # GSD files hold positions and velocities in single precision.
    rounding = (0.0, 0.0) if own else (storage_rounding(q.astype(np.float32)), storage_rounding(p.astype(np.float32)))
    return Samples(t, place, speed, tuple(map(str, range(n))), rounding)


def _velocities(path: Path, p: Array) -> Array:
    return finite_array(path, "velocity", p, 3)
