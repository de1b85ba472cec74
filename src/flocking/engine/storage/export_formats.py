"""Runs for other programs: GSD (OVITO, freud), extended XYZ, NPZ, and tables of observables (CSV, Parquet)."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray
from flocking.engine.runs.columns import LOG
from flocking.engine.runs.run import OF_VELOCITIES, Run
from flocking.engine.storage.atomic_files import NOTHING_WRITTEN, storage_errors, write_through
from flocking.engine.storage.left_overs import partial_file, remove_files_left_over
from flocking.engine.storage.new_folders import check_path
from flocking.errors import InvalidInput, StorageError
from flocking.model import observables
from flocking.model.checks import Array
from flocking.model.serial import ForeignPart, to_data
from flocking.model.state import State

MARGIN = 1.1
"""Ratio of the box of an export to the extent of the motion, so that no program wraps a position."""


def export_run(run: Run, path: str | Path, *, to: str | None = None) -> Path:
    """Write a run in the format of another program.

    Parameters
    ----------
    run
        The run.
    path
        The file; an existing one is replaced, and what a link leads to. All but GSD is written to devices and pipes.
    to
        ``"gsd"`` (positions in single precision as its schema requires; times, and positions and velocities in double
        precision, in the log), ``"xyz"`` (extended XYZ), ``"npz"`` (all arrays), ``"csv"`` or ``"parquet"``
        (observables of every frame). By default determined by the suffix of ``path``. Agents of order 1 have no
        velocities of their own: a run holds zeros in their place, which no file states as measured; they are left out.

    Raises
    ------
    InvalidInput
        If the format is unknown, the run is none, or the file no path.
    StorageError
        If the file cannot be written or the format needs a package that is not installed.
    """
    if not isinstance(run, Run):
        raise InvalidInput(
            "export_run", "run", "must be a Run", run, "Use fk.simulate(scenario) or fk.read_run(folder)."
        )
    check_path("export_run", "path", path)
    path = Path(path)
    form = (path.suffix.removeprefix(".") if to is None else str(to)).lower()
    if form not in FORMATS:
        given = path.name if to is None else to
        raise InvalidInput("export_run", "to", f"must be one of {', '.join(FORMATS)}, or the suffix of the file", given)
    with storage_errors(path, f"write {form}", full=NOTHING_WRITTEN):
        remove_files_left_over(path)
        FORMATS[form](run, path)
    return path


def observable_table(run: Run) -> dict[str, Array]:
    """Observables of every frame, by name, shape (F,) each.

    Time, number of links, flocks and share of the largest, closest pair, order, the mean position and velocity by axis,
    which are those of the centre of mass, and the largest difference from that velocity. Links are pairs of which one
    agent senses the other. Without link matrices, links and flocks are those recorded during the run, or missing, as
    links are where they are one-way, of which each counts in the record; without frames, the table contains the
    recorded observables.
    What is made of velocities is missing for agents of order 1, which have none of their own.
    """
    from collections import defaultdict

    rows: dict[str, list[float]] = defaultdict(list)
    masses = run.scenario.agents.masses
    linked = run.links.shape[1:] == (run.n, run.n)
    seen, moving = run.observables, _has_velocities(run)
    if seen is not None and len(seen) and not len(run.t):
        names = [name for name in seen.dtype.names or () if moving or name not in OF_VELOCITIES]
        return {name: seen[name].astype(np.float64) for name in names}
    observed = seen if seen is not None and not linked and np.array_equal(seen["time"], run.t) else None
    for k in range(len(run.t)):
        state = State(run.q[k], run.p[k], float(run.t[k]))
        rows["time"].append(state.t)
        if linked:
            links = run.links_at(k)
            rows["links"].append(int(np.count_nonzero(links | links.T)) // 2)
            rows["flocks"].append(observables.flocks(links))
            rows["largest_flock"].append(observables.density(links))
        elif observed is not None:
            if not run.scenario.law.graph.directed:
                rows["links"].append(round(observed["neighbours"][k] * run.n / 2))
            rows["flocks"].append(observed["flocks"][k])
            rows["largest_flock"].append(observed["density"][k])
        rows["closest_pair"].append(observables.closest_pair(state, run.scenario.space)[0])
        if moving:
            rows["order"].append(observables.order(state))
            rows["velocity_spread"].append(observables.velocity_spread(state, masses))
        q, p = observables.mean_position(state, masses), observables.mean_velocity(state, masses)
        for axis, name in enumerate(axis_names(len(q))):
            rows[f"mean_{name}"].append(float(q[axis]))
            if moving:
                rows[f"mean_v{name}"].append(float(p[axis]))
    return {name: np.array(values, dtype=np.float64) for name, values in rows.items()}


def _has_velocities(run: Run) -> bool:
    """Whether the velocities of a run are those of the agents: of order 1 they are zeros in their place."""
    return run.scenario.agents.order > 1


def axis_names(m: int) -> list[str]:
    """Names of the axes of ``m``-dimensional space: x, y, z, or x1, x2, ... beyond three."""
    return list("xyz"[:m]) if m <= 3 else [f"x{k + 1}" for k in range(m)]


def _write_csv(run: Run, path: Path) -> None:
    table = observable_table(run)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table)
    writer.writerows([repr(float(x)) for x in row] for row in zip(*table.values(), strict=True))
    write_through(path, text.getvalue().encode())


def _write_parquet(run: Run, path: Path) -> None:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise missing_package("pyarrow", "Parquet") from None
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(pyarrow.table({k: pyarrow.array(v) for k, v in observable_table(run).items()}), sink)
    write_through(path, sink.getvalue().to_pybytes())


def _write_npz(run: Run, path: Path) -> None:
    try:
        scenario = json.dumps(to_data(run.scenario))
    except ForeignPart:
        scenario = ""
    file, columns = io.BytesIO(), dict[str, AnyArray]()
    columns |= {f"column_{name}": values for name, values in run.columns.items()}
    if _has_velocities(run):
        columns["p"] = run.p
    if run.observables is not None:
        columns["observables"] = run.observables
    np.savez_compressed(
        file, allow_pickle=False, t=run.t, q=run.q, links=run.links, switches=run.switches, trace=run.trace,
        scenario=np.array(scenario), provenance=np.array(json.dumps(run.provenance, default=str)),
        status=np.array(run.status), **columns, **_log_arrays(run),
    )  # fmt: skip
    write_through(path, file.getvalue())


def _log_arrays(run: Run) -> dict[str, AnyArray]:
    """The log of what agents used when they acted, under the names that stored runs give it."""
    return {} if run.log is None else dict(zip(LOG, (run.log.ticks, run.log.forces, run.log.uses), strict=True))


def _write_xyz(run: Run, path: Path) -> None:
    lines = []
    m = min(run.q.shape[2], 3)
    _check_space(run)
    further = "".join(f":{name}:R:{values.shape[2]}" for name, values in run.columns.items())
    box, moving = _xyz_box(run), _has_velocities(run)
    named = f"species:S:1:pos:R:3{':velo:R:3' * moving}{further}"
    for k, (t, q, p) in enumerate(zip(run.t, run.q, run.p, strict=True)):
        lines += [str(run.n), f"Properties={named} Time={float(t)!r} {box}"]
        rows = np.zeros((run.n, 6))
        rows[:, :m], rows[:, 3 : 3 + m] = q, p
        rows = np.hstack([rows[:, : 6 if moving else 3], *(values[k] for values in run.columns.values())])
        lines += ["A " + " ".join(repr(x) for x in row) for row in rows.tolist()]
    write_through(path, ("\n".join(lines) + "\n").encode())


def _xyz_box(run: Run) -> str:
    """Periodic axes, and the box if there is one: open axes get a length that contains the run."""
    space = run.scenario.space
    if space.is_open:
        return 'pbc="F F F"'
    sides = np.diag((*_box(run), 0.0, 0.0)[:3]).ravel().tolist()
    repeats = [np.isfinite(x) for x in space.lengths] + [False] * 3
    return f'Lattice="{" ".join(map(repr, sides))}" pbc="{" ".join("T" if x else "F" for x in repeats[:3])}"'


def _box(run: Run) -> list[float]:
    """Lengths of a box about the origin, one per axis: the periods of space, or a length for all positions."""
    length = float(2 * MARGIN * np.abs(run.q).max(initial=0.0)) or 1.0
    lengths = run.scenario.space.lengths or (np.inf,) * run.q.shape[2]
    return [x if np.isfinite(x) else length for x in lengths]


def _write_gsd(run: Run, path: Path) -> None:
    try:
        import gsd.hoomd
    except ImportError:
        raise missing_package("gsd", "GSD") from None
    _check_space(run)
    # What a link leads to is replaced, as of other formats; frames are found again in a file alone.
    path = path.resolve() if path.is_symlink() else path
    if path.exists() and not path.is_file() and not path.is_dir():
        raise StorageError(f"{path}: GSD is written to files only. Choose another name.")
    m = run.q.shape[2]
    sides, space = _box(run), run.scenario.space
    # In the plane the box has no third side; for one axis the box is a square.
    sides = [sides[0], sides[m - 1], 0.0] if m < 3 else sides
    masses = np.broadcast_to(np.asarray(run.scenario.agents.masses, dtype=np.float64), run.n)
    linked, moving = run.links.shape[1:] == (run.n, run.n), _has_velocities(run)
    partial = partial_file(path)
    try:
        with gsd.hoomd.open(str(partial), "w") as file:
            for k in range(len(run.t)):
                frame = gsd.hoomd.Frame()
                frame.configuration.step = k
                frame.configuration.dimensions = 3 if m == 3 else 2
                frame.configuration.box = [*sides, 0, 0, 0]
                frame.particles.N = run.n
                frame.particles.types = ["A"]
                frame.particles.mass = masses.astype(np.float32)
                # Positions in the box; the unwrapped ones are in the log.
                frame.particles.position = _in_space(space.displacement(run.q[k]))
                if moving:
                    frame.particles.velocity = _in_space(run.p[k])
                if linked:
                    i, j = np.nonzero(np.triu(run.links[k] | run.links[k].T))
                    frame.bonds.N, frame.bonds.types = len(i), ["link"]
                    frame.bonds.group = np.stack([i, j], axis=1).astype(np.uint32)
                    frame.bonds.typeid = np.zeros(len(i), dtype=np.uint32)
                frame.log = {
                    "flocking/time": np.array([run.t[k]]),
                    "flocking/dimension": np.array([m]),
                    "particles/flocking/position": np.ascontiguousarray(run.q[k]),
                }
                if moving:
                    frame.log["particles/flocking/velocity"] = np.ascontiguousarray(run.p[k])
                for name, values in run.columns.items():
                    frame.log[f"particles/flocking/{name}"] = np.ascontiguousarray(values[k])
                file.append(frame)
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def _in_space(values: Array) -> NDArray[np.float32]:
    """Vectors padded with zeros to three axes, in single precision."""
    found = np.zeros((len(values), 3), dtype=np.float32)
    found[:, : values.shape[1]] = values
    return found


def _check_space(run: Run) -> None:
    if run.q.shape[2] > 3:
        raise InvalidInput(
            "export_run", "to", "must be npz, csv or parquet for more than 3 dimensions", run.q.shape[2],
            "GSD and XYZ have three axes.",
        )  # fmt: skip


def missing_package(package: str, form: str, extra: str = "export") -> StorageError:
    """The error of a file format whose package is not installed.

    Parameters
    ----------
    package
        Name of the package.
    form
        Name of the format.
    extra
        The extra of this library that installs the package.
    """
    return StorageError(f"{form} needs the package {package}: pip install 'flocking[{extra}]'.")


FORMATS: dict[str, Callable[[Run, Path], None]] = {
    "gsd": _write_gsd, "xyz": _write_xyz, "npz": _write_npz, "csv": _write_csv, "parquet": _write_parquet,
}  # fmt: skip
"""Writers by the name of their format."""
