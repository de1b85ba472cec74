"""Flocking control: the laws of ten papers as parts, run exactly and fast, and audited.

>>> import flocking as fk
>>> psi = fk.Potential("1/r + 1/(R - r)", R=4)
>>> law = fk.Law(fk.Hysteresis(radius=4, gap=0.1), [fk.Gradient(psi), fk.Consensus(1.0)])
>>> begin = fk.start.box(10, side=8, speed=4, seed=1, connected_under=law.graph)
>>> run = fk.simulate(fk.Scenario(law, begin, t_end=1))
>>> run.status
'finished'
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from flocking import papers as papers
    from flocking.apps.lab.server import lab as lab
    from flocking.engine.driver.ensembles import simulate_many as simulate_many
    from flocking.engine.driver.law_export import export_c as export_c
    from flocking.engine.driver.nodes import simulate_nodes as simulate_nodes
    from flocking.engine.driver.registry import register_engine as register_engine
    from flocking.engine.driver.registry import unregister_engine as unregister_engine
    from flocking.engine.driver.resuming import resume as resume
    from flocking.engine.driver.simulate import simulate as simulate
    from flocking.engine.driver.starting import start as start
    from flocking.engine.exact.session import ExactSession as ExactSession
    from flocking.engine.reference.control import Agent as Agent
    from flocking.engine.reference.control import control as control
    from flocking.engine.reference.control import control_of as control_of
    from flocking.engine.reference.control import evaluate as evaluate
    from flocking.engine.reference.controller import Controller as Controller
    from flocking.engine.runs.compare import first_difference as first_difference
    from flocking.engine.runs.run import Run as Run
    from flocking.engine.storage.export_formats import export_run as export_run
    from flocking.engine.storage.start_files import read_start as read_start
    from flocking.engine.storage.stored_runs import read_run as read_run
    from flocking.engine.storage.stored_runs import write_run as write_run
    from flocking.errors import FlockingError as FlockingError
    from flocking.errors import InvalidInput as InvalidInput
    from flocking.errors import SimulationError as SimulationError
    from flocking.errors import StorageError as StorageError
    from flocking.model.library import *  # noqa: F403
    from flocking.papers.auditing import audit as audit
    from flocking.papers.margins import margins as margins
    from flocking.papers.potential_definitions import check_potential as check_potential
    from flocking.show.animate import animate as animate
    from flocking.show.plot import plot as plot
    from flocking.show.sweep_pictures import plot_sweep as plot_sweep
    from flocking.study.certificates.certify import certify as certify
    from flocking.study.departed_energy.departed import departed_causes as departed_causes
    from flocking.study.message_logs.replay import replay as replay
    from flocking.study.nets.winding import winding as winding
    from flocking.study.potentials.state_energy import agent_energies as agent_energies
    from flocking.study.potentials.state_energy import total_energy as total_energy
    from flocking.study.scenario_files.scenario_file import read_scenario as read_scenario
    from flocking.study.scenario_files.scenario_file import write_scenario as write_scenario
    from flocking.study.sweeps.sampling import Sample as Sample
    from flocking.study.sweeps.sweep import read_sweep as read_sweep
    from flocking.study.sweeps.sweep import sweep as sweep

__version__ = "0.1.0"

_HOMES = {
    "Agent": "engine.reference.control", "ExactSession": "engine.exact.session", "FlockingError": "errors",
    "InvalidInput": "errors", "Run": "engine.runs.run", "Sample": "study.sweeps.sampling",
    "SimulationError": "errors", "StorageError": "errors", "agent_energies": "study.potentials.state_energy",
    "animate": "show.animate", "audit": "papers.auditing", "certify": "study.certificates.certify",
    "check_potential": "papers.potential_definitions",
    "Controller": "engine.reference.controller",
    "control": "engine.reference.control", "control_of": "engine.reference.control",
    "departed_causes": "study.departed_energy.departed",
    "evaluate": "engine.reference.control", "export_c": "engine.driver.law_export",
    "export_run": "engine.storage.export_formats",
    "first_difference": "engine.runs.compare", "lab": "apps.lab.server", "margins": "papers.margins",
    "plot": "show.plot", "plot_sweep": "show.sweep_pictures",
    "read_run": "engine.storage.stored_runs", "read_scenario": "study.scenario_files.scenario_file",
    "read_start": "engine.storage.start_files", "read_sweep": "study.sweeps.sweep",
    "register_engine": "engine.driver.registry", "replay": "study.message_logs.replay",
    "resume": "engine.driver.resuming",
    "simulate": "engine.driver.simulate", "simulate_nodes": "engine.driver.nodes",
    "simulate_many": "engine.driver.ensembles", "start": "engine.driver.starting",
    "sweep": "study.sweeps.sweep", "total_energy": "study.potentials.state_energy",
    "unregister_engine": "engine.driver.registry", "winding": "study.nets.winding",
    "write_run": "engine.storage.stored_runs",
    "write_scenario": "study.scenario_files.scenario_file",
}  # fmt: skip
"""Modules of all names but those of `flocking.model.library`, each imported at its first use."""


if not TYPE_CHECKING:  # Type checkers know the names above, and refuse others.

    def __getattr__(name: str) -> Any:
        if name == "papers":
            return import_module("flocking.papers")
        if name in _HOMES:
            value = getattr(import_module(f"flocking.{_HOMES[name]}"), name)
            globals()[name] = value
            return value
        library = None if name.startswith("_") and name != "__all__" else import_module("flocking.model.library")
        if name == "__all__":
            return sorted([*_HOMES, *(each for each in vars(library) if not each.startswith("_")), "papers"])
        if hasattr(library, name):
            return getattr(library, name)
        raise AttributeError(f"module 'flocking' has no attribute {name!r}")

    def __dir__() -> list[str]:
        return sorted({*globals(), *__getattr__("__all__")})
