"""Whether a run keeps a log of what agents used, and how much memory that takes."""

from __future__ import annotations

import numpy as np

from flocking.engine.runs.message_log import TICK_PARTS, USE_PARTS
from flocking.engine.runs.recorder import MOST_LINKED
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.records import TilesRecorder
from flocking.errors import InvalidInput, SimulationError
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.times import PER_SECOND

USUAL_LOG_BYTES = 256 * 2**20
"""A log is kept unasked if by the neighbours at the start it takes no more, as for link matrices of frames."""

MOST_LOG_BYTES = 8 * 2**30
"""Largest memory of a log that is not written to disk meanwhile; as for frames."""

WORD = 8
"""Bytes of a number of the log."""


LOOKED_AT = 128
"""Agents whose neighbours are counted: their mean is that of all within a tenth, for a millisecond's work."""


def expected_log_bytes(scenario: Scenario) -> float:
    """About the size of the log of a run whose agents keep as many neighbours as they have within reach at the start.

    Parameters
    ----------
    scenario
        Its control is held; of at most `MOST_LINKED` agents.
    """
    control, start = scenario.control, scenario.start
    assert isinstance(control, Held)
    span = round((scenario.t_end - start.t) * PER_SECOND)
    acts = float(control.schedule(start.n).count_until(span).astype(np.float64).sum())
    rows = np.unique(np.linspace(0, start.n - 1, min(start.n, LOOKED_AT)).astype(np.int64))
    near = np.linalg.norm(scenario.space.displacement(start.q[None] - start.q[rows, None]), axis=-1)
    neighbours = 0.0
    for graph in scenario.law.graphs:
        if graph.moves:
            reach = np.broadcast_to(np.asarray(graph.break_radius, dtype=np.float64), start.n)[rows, None]
            neighbours += float((near < reach).sum(axis=1).mean()) - 1.0
        else:
            neighbours += float(graph.links_in(scenario.space, start.q, scenario.agents.headings).sum(axis=1).mean())
    return WORD * acts * (len(TICK_PARTS) + start.dimension + len(USE_PARTS) * neighbours)


def why_no_log(scenario: Scenario, options: TilesOptions) -> str:
    """Why a run under held control keeps no log of what agents used, in words; empty where it keeps one.

    Parameters
    ----------
    scenario
        Its control is held.
    options
        Options of the engine.

    Raises
    ------
    InvalidInput
        When a log is asked for that cannot be kept.
    """
    if options.log is False:
        return "log=False"
    why = ""
    if scenario.start.n > MOST_LINKED:
        why = f"the group has {scenario.start.n:,} agents, and logs are kept of at most {MOST_LINKED:,}"
    elif options.precision != "float64":
        why = f"precision={options.precision!r}: a second computation needs the motion to more digits"
    if options.log is None and not why and (size := expected_log_bytes(scenario)) > USUAL_LOG_BYTES:
        why = f"it would take {size / 2**30:.3g} GiB by the neighbours at the start; log=True keeps it"
    if options.log and why:
        raise InvalidInput("TilesOptions", "log", "must be left out here", True, f"No log can be kept: {why}.")
    return why


def check_log_fits(scenario: Scenario) -> None:
    """Refuse a log that does not fit into memory, for runs that are not written to disk meanwhile.

    Raises
    ------
    InvalidInput
        When by the neighbours at the start it would take more than `MOST_LOG_BYTES`.
    """
    size = expected_log_bytes(scenario)
    if size > MOST_LOG_BYTES:
        raise InvalidInput(
            "TilesOptions", "log", f"must give a log of at most {MOST_LOG_BYTES / 2**30:g} GiB of memory",
            f"{size / 2**30:.3g} GiB by the neighbours at the start",
            "Save the run while it goes on with save=folder (--out FOLDER), or give log=False.",
        )  # fmt: skip


class HeldRecorder(TilesRecorder):
    """Collects the records of a run under held control.

    Parameters
    ----------
    scenario, options
        What is simulated, and with which options of the engine.
    """

    def __init__(self, scenario: Scenario, options: TilesOptions) -> None:
        super().__init__(
            scenario, options.precision, keep_frames=options.keep_frames, observe=options.observe,
            with_log=bool(options.log),
        )  # fmt: skip
        self._scenario = scenario

    def check_fits(self) -> None:
        """Refuse frames and a log that do not fit into memory.

        Raises
        ------
        InvalidInput
            When frames do not, or see `check_log_fits`.
        """
        super().check_fits()
        if self.log is not None:
            check_log_fits(self._scenario)


def check_log_size(size: float, time: float) -> None:
    """Stop a run whose log has outgrown its memory: more agents are linked than at the start.

    Parameters
    ----------
    size
        Memory of the log in bytes.
    time
        The time reached.

    Raises
    ------
    SimulationError
        When it takes more than `MOST_LOG_BYTES`.
    """
    if size > MOST_LOG_BYTES:
        raise SimulationError(
            f"The log of what agents used takes more than {MOST_LOG_BYTES / 2**30:g} GiB of memory. Save the run while "
            "it goes on with save=folder (--out FOLDER), or give log=False.",
            time=time,
        )  # fmt: skip
