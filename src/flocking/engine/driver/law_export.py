"""Export of the law of a scenario as self-contained C99."""

from __future__ import annotations

from pathlib import Path

from flocking.engine.c_export.export import c_files
from flocking.engine.storage.atomic_files import NOTHING_WRITTEN, complete_folder, put, storage_errors
from flocking.errors import StorageError
from flocking.model.law import Scenario


def export_c(
    scenario: Scenario, folder: str | Path, *, float32: bool = False, neighbours: int | None = None,
    limit: float | None = None, name: str = "law",
) -> Path:  # fmt: skip
    """Write the control law of a scenario as self-contained C99, for a flight computer.

    The folder gets a header and a source that need no library and no heap, an example, a CMake file, and a README with
    the formulas and where they come from. The source is printed from the statements from which the compiled kernels
    are, operation by operation; in double precision it gives the bits of `flocking.Controller` where the law needs no
    elementary functions other than roots. Agents keep what they last heard of their neighbours, as
    `flocking.Messages` states: the newest sample of each counts, is discarded when it expires, and is moved on with its
    velocity if the scenario's messages are.

    Parameters
    ----------
    scenario
        The scenario; its law must be distributed, and its graphs must link by distances, by constant headings, or along
        velocities.
    folder
        A new or empty folder; it appears with all its files, or not at all.
    float32
        Whether numbers are of single precision.
    neighbours
        Largest number of neighbours whose states are kept; all others of the group when absent.
    limit
        Largest force; longer ones are scaled back. None for no limit.
    name
        Begin of all names in C.

    Returns
    -------
    Path
        The source file.

    Raises
    ------
    UnsupportedLaw
        When the law is not distributed or has a part that is not exported; the message names it.
    InvalidInput
        When a value is out of range.
    StorageError
        When the folder is not empty or cannot be written.
    """
    files = c_files(scenario, float32=float32, neighbours=neighbours, limit=limit, name=name)
    folder = Path(folder)
    with storage_errors(folder, "write the law", full=NOTHING_WRITTEN):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise StorageError(f"{folder}: not an empty folder. Choose another one; nothing is ever overwritten.")
        with complete_folder(folder.resolve()) as fresh:
            for file, text in files.items():
                put(fresh / file, text.encode())
    return folder / f"{name}.c"
