"""Runs in which every agent is a process of its own."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from flocking.engine.c_export.export import c_files
from flocking.engine.driver.simulate import run_session
from flocking.engine.nodes.exported_node import check_callable
from flocking.engine.nodes.kills_and_cuts import Fault, Kill, Restart
from flocking.engine.nodes.processes import PATIENCE, AgentProcesses, Agents, LocalAgents
from flocking.engine.nodes.recording import Recording
from flocking.engine.nodes.session import NodeSession, check_nodes
from flocking.engine.runs.run import Run
from flocking.errors import InvalidInput, StorageError
from flocking.model.checks import number, one_of
from flocking.model.law import Scenario

CODES = ("python", "c")
"""What agents run: `flocking.Controller`, or the exported law."""

COMPILERS = ("cc", "gcc", "clang")
"""Programs that compile C, the first that there is."""

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC")
"""Flags of the compiler for a shared object."""
MOST_OF_OUTPUT = 500
"""Most characters of a compiler's output in an error: its first lines name the first fault."""


def compiled_law(scenario: Scenario, folder: Path) -> Path:
    """The law of a scenario, exported and compiled for this machine in double precision.

    Parameters
    ----------
    folder
        Where to write it.

    Returns
    -------
    Path
        The shared object.

    Raises
    ------
    UnsupportedLaw
        When the law is not exported.
    StorageError
        When there is no C compiler, or it fails.
    """
    for name, text in c_files(scenario).items():
        (folder / name).write_text(text)
    compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
    if compiler is None:
        raise StorageError("Agents that run C need a C compiler: install gcc, or use Python.")
    place = folder / "law.so"
    done = subprocess.run(
        [compiler, *FLAGS, "-o", str(place), str(folder / "law.c")], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise StorageError(f"The exported law does not compile: {done.stderr.strip()[:MOST_OF_OUTPUT]}")
    return place


def simulate_nodes(
    scenario: Scenario, *, code: str = "python", real_time: float | None = None, faults: Sequence[Fault] = (),
    patience: float = PATIENCE, processes: bool = True, place: str = "", spawn: bool = True,
    record: str | Path | None = None, progress: bool = True,
) -> Run:  # fmt: skip
    """Run a scenario with a process for each agent, which receives states of the others only by messages over zenoh.

    This process is the world: it moves the bodies, reads the sensors of agents, and delays, loses and disturbs messages
    as the scenario states, by the draws of the engine ``"sampled"``. In lock-step it waits for every agent, and a run
    of Python agents has the bits of `flocking.simulate`.

    Parameters
    ----------
    scenario
        The scenario; its control must be held.
    code
        ``"python"`` for `flocking.Controller`, ``"c"`` for the exported law, see `flocking.export_c`.
    real_time
        Seconds of the scenario in a second; lock-step when absent. The latency of the control is then the time in which
        an agent must answer.
    faults
        Agents that are killed or restarted, and radio links that are cut.
    patience
        Seconds in which an agent must answer in lock-step.
    processes
        Whether agents have processes of their own; all are in this one otherwise, for comparison.
    place
        Where the world listens, such as ``tcp/192.168.1.5:7447``; this machine alone when empty.
    spawn
        Whether to begin the processes here; otherwise the command to begin each is printed.
    record
        A new MCAP file for all frames and samples, which ``flocking audit`` reads.
    progress
        Whether to show a progress bar.

    Returns
    -------
    Run
        Frames, switches and ledger; its provenance states what happened to agents.

    Raises
    ------
    UnsupportedLaw, InvalidInput
        When the scenario has a part that agents cannot run by themselves, or a value is out of range.
    EngineMissing
        When zenoh is not installed, mcap for a recording, or cffi for agents that run C.
    SimulationError
        When agents do not begin, or one has no force.
    StorageError
        When C is requested and there is no compiler, or the recording cannot be written.
    """
    if not isinstance(scenario, Scenario):
        raise InvalidInput("simulate_nodes", "scenario", "must be a Scenario", scenario)
    one_of("simulate_nodes", "code", code, CODES, "must be 'python' or 'c'")
    number("simulate_nodes", "patience", patience, above=0.0)
    check_nodes(scenario, real_time=real_time, exported=code == "c")
    if not spawn and any(isinstance(fault, Kill | Restart) for fault in faults):
        raise InvalidInput(
            "simulate_nodes", "faults", "must kill and restart no agents whose processes are begun elsewhere", "others",
            "End and begin such a process on its host.",
        )  # fmt: skip
    if code == "c" and spawn:
        # Each agent would report it for itself.
        check_callable()
    with ExitStack() as stack:
        library = None
        if code == "c":
            library = compiled_law(scenario, Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="flocking-"))))
        agents: Agents = (
            AgentProcesses(scenario, library=library, place=place, spawn=spawn, stack=stack)
            if processes
            else LocalAgents(scenario, library)
        )
        # A second time: an interrupt may keep the first call from its work.
        stack.callback(agents.close)
        recording = None if record is None else stack.enter_context(Recording(Path(record)))
        session = NodeSession(
            scenario, agents, faults=faults, real_time=real_time, patience=patience, recording=recording
        )
        return run_session(session, progress=progress)
