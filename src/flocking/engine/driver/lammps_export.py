"""Export of a scenario as input files for LAMMPS."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from flocking.engine.fixed_step.step_counts import steps_between
from flocking.engine.lammps.bodies import AXES
from flocking.engine.lammps.deck import make_deck
from flocking.engine.lammps.images import LOOK_EVERY, MOST_IMAGES, images_of, periods_of
from flocking.engine.lammps.steps import chosen_step
from flocking.engine.storage.atomic_files import put, storage_errors
from flocking.errors import InvalidInput, StorageError, escaped
from flocking.formula.safe_digits import given_text
from flocking.model.checks import number
from flocking.model.law import Scenario

EVEN = 1e-9
"""Relative difference of frame distances that counts as rounding: times are sums of about 10^6 roundings of 1e-16."""
RESTART_STEPS = 1000
"""Least number of steps between two restart files, so that writing them takes a small share of the time."""


def export_deck(scenario: Scenario, folder: str | Path, *, step: float | None = None) -> Path:
    """Write a scenario as input files for LAMMPS: ``in.flocking``, ``data.flocking`` and tables.

    Run it with ``mpiexec -n 64 lmp -in in.flocking``. Frames go to ``frames.lammpstrj``.

    Parameters
    ----------
    folder
        A new or empty folder.
    step
        Largest time step; it is shortened slightly so that frame times coincide with steps. Chosen by default.

    Returns
    -------
    Path
        The input deck.

    Raises
    ------
    UnsupportedLaw
        If a part has no translation.
    InvalidInput
        If the step is not positive, or the frames are not evenly spaced from the start on.
    StorageError
        If the folder is not empty or cannot be written.
    """
    deck = make_deck(scenario)
    step = chosen_step(scenario, scenario.start) if step is None else number("export_deck", "step", step, above=0.0)
    folder = Path(folder)
    h, each, count = _clock(scenario, step)
    space = scenario.space
    most = int(np.abs(images_of(space, scenario.start.q)).max(initial=0))
    if most > MOST_IMAGES:
        raise InvalidInput(
            "export_deck", "start", f"must be within {MOST_IMAGES} lengths of the box on axes that repeat", most,
            "Start from an image: q % L.",
        )  # fmt: skip
    repeating = np.flatnonzero(periods_of(space, deck.dimension))
    # Dumps name positions "xu" that are not moved into the box.
    columns = [
        *(f"{AXES[k]}u" if k in repeating else AXES[k] for k in range(deck.dimension)),
        *(f"v{AXES[k]}" for k in range(deck.dimension if deck.order == 2 else 0)),
    ]
    packages = "LEPTON and DPD-BASIC" if deck.order == 2 else "LEPTON, DPD-BASIC and BROWNIAN"
    lines = [
        f"# {escaped(scenario.name) or 'flock'}: {scenario.start.n} agents until t = {given_text(scenario.t_end)}, "
        "written by flocking.",
        "# Run it by: mpiexec -n 64 lmp -in in.flocking. Frames go to frames.lammpstrj.",
        f"# LAMMPS of July 2025 or newer with the packages {packages}. Equation numbers refer to the papers.",
        "# Units of length, time and mass are those of the scenario.", "",
        *deck.world(), "", *deck.agents("data.flocking"), "", *deck.law(ranks=2), "",
        f"timestep {h!r}", f"thermo {each}", "thermo_style custom step time atoms ke pe",
        f"dump frames all custom {each} frames.lammpstrj id {' '.join(columns)}",
        "dump_modify frames sort id format float %.17g",
        *_watched_images([AXES[k] for k in repeating]),
        f"restart {max(each, RESTART_STEPS)} restart.1 restart.2", f"run {count}",
    ]  # fmt: skip
    with storage_errors(
        folder, "write the deck", full="The folder is incomplete; free some space or choose another folder."
    ):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise StorageError(f"{folder}: not an empty folder. Choose another one; nothing is ever overwritten.")
        files = {
            "in.flocking": "\n".join(lines) + "\n",
            "data.flocking": deck.data_text(scenario.start),
            **deck.tables(),
        }
        for name, text in files.items():
            put(folder / name, text.encode())
    return folder / "in.flocking"


def _watched_images(axes: list[str]) -> list[str]:
    """Commands that end a run before LAMMPS has no room for images along ``axes``."""
    if not axes:
        return []
    lines = ["# LAMMPS counts images from -512 to 511 and then goes round: the run ends with an error before that."]
    for a in axes:
        lines += [
            f"compute image_{a} all property/atom i{a}", f"compute most_{a} all reduce maxabs c_image_{a}",
            f"variable most_{a} equal c_most_{a}",
            f"fix images_{a} all halt {LOOK_EVERY} v_most_{a} > {MOST_IMAGES} error hard",
        ]  # fmt: skip
    return lines


def _clock(scenario: Scenario, step: float) -> tuple[float, int, int]:
    """Time step, number of steps between frames, and total number of steps."""
    start, times = scenario.start.t, scenario.frame_times
    span = scenario.t_end - start
    gaps = np.diff(times)
    gap = float(gaps[0]) if len(gaps) else span
    even = (times[:1] == start).all() and np.allclose(gaps, gap, rtol=EVEN)
    each = steps_between(0.0, gap, step)
    h = gap / each
    count = round(span / h) if h else 0
    if not even or abs(count * h - span) > EVEN * span:
        raise InvalidInput(
            "export_deck", "frames", "must be evenly spaced from the start to the end", [float(t) for t in times[:4]],
            "Give a number of frames.",
        )  # fmt: skip
    return h, each, count
