"""Flocking control: the laws of five papers as parts, run exactly and fast, and audited.

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
    from flocking.engine.compare import first_difference as first_difference
    from flocking.engine.exact import ExactSession as ExactSession
    from flocking.engine.exchange import export_run as export_run
    from flocking.engine.reference import Agent as Agent
    from flocking.engine.reference import control as control
    from flocking.engine.reference import control_of as control_of
    from flocking.engine.reference import evaluate as evaluate
    from flocking.engine.resuming import resume as resume
    from flocking.engine.run import Run as Run
    from flocking.engine.simulate import simulate as simulate
    from flocking.engine.start_files import read_start as read_start
    from flocking.engine.starting import start as start
    from flocking.engine.storage import read_run as read_run
    from flocking.engine.storage import write_run as write_run
    from flocking.errors import FlockingError as FlockingError
    from flocking.errors import InvalidInput as InvalidInput
    from flocking.errors import SimulationError as SimulationError
    from flocking.errors import StorageError as StorageError
    from flocking.model.avoidance import Avoid as Avoid
    from flocking.model.bumps import Bump as Bump
    from flocking.model.energy import Energy as Energy
    from flocking.model.graphs import Fixed as Fixed
    from flocking.model.graphs import Graph as Graph
    from flocking.model.graphs import Hysteresis as Hysteresis
    from flocking.model.graphs import Proximity as Proximity
    from flocking.model.law import Law as Law
    from flocking.model.law import Scenario as Scenario
    from flocking.model.leaders import Leader as Leader
    from flocking.model.leaders import Path as Path
    from flocking.model.leaders import Sink as Sink
    from flocking.model.leaders import Velocity as Velocity
    from flocking.model.obstacles import Ball as Ball
    from flocking.model.obstacles import Obstacle as Obstacle
    from flocking.model.obstacles import Wall as Wall
    from flocking.model.polygons import ConvexPolygon as ConvexPolygon
    from flocking.model.potentials import Potential as Potential
    from flocking.model.schedules import Schedule as Schedule
    from flocking.model.smooth_graphs import PerAgentRadii as PerAgentRadii
    from flocking.model.smooth_graphs import Smooth as Smooth
    from flocking.model.state import Agents as Agents
    from flocking.model.state import State as State
    from flocking.model.structural import structural_potential as structural_potential
    from flocking.model.terms import Consensus as Consensus
    from flocking.model.terms import Gradient as Gradient
    from flocking.model.terms import PairTerm as PairTerm
    from flocking.model.tracking import BodyTerm as BodyTerm
    from flocking.model.tracking import Compensate as Compensate
    from flocking.model.tracking import Track as Track
    from flocking.model.views import Cone as Cone
    from flocking.model.views import FieldOfView as FieldOfView
    from flocking.model.views import SmoothCone as SmoothCone
    from flocking.model.weights import HashedWeights as HashedWeights
    from flocking.model.weights import MatrixWeights as MatrixWeights
    from flocking.papers.auditing import audit as audit
    from flocking.show.animate import animate as animate
    from flocking.show.plot import plot as plot
    from flocking.study.potential_check import check_potential as check_potential
    from flocking.study.scenario_file import read_scenario as read_scenario
    from flocking.study.scenario_file import write_scenario as write_scenario
    from flocking.study.state_energy import agent_energies as agent_energies
    from flocking.study.state_energy import total_energy as total_energy
    from flocking.study.sweeps.sampling import Sample as Sample
    from flocking.study.sweeps.sweep import read_sweep as read_sweep
    from flocking.study.sweeps.sweep import sweep as sweep

__version__ = "0.1.0"

_HOMES = {
    "Agent": "engine.reference", "Agents": "model.state", "Avoid": "model.avoidance", "Ball": "model.obstacles",
    "BodyTerm": "model.tracking", "Bump": "model.bumps", "Compensate": "model.tracking", "Cone": "model.views",
    "Consensus": "model.terms", "ConvexPolygon": "model.polygons", "Energy": "model.energy",
    "ExactSession": "engine.exact", "FieldOfView": "model.views", "Fixed": "model.graphs", "FlockingError": "errors",
    "Gradient": "model.terms", "Graph": "model.graphs", "HashedWeights": "model.weights", "Hysteresis": "model.graphs",
    "InvalidInput": "errors", "Law": "model.law", "Leader": "model.leaders", "MatrixWeights": "model.weights",
    "Obstacle": "model.obstacles", "PairTerm": "model.terms", "Path": "model.leaders",
    "PerAgentRadii": "model.smooth_graphs", "Potential": "model.potentials", "Proximity": "model.graphs",
    "Run": "engine.run", "Sample": "study.sweeps.sampling", "Scenario": "model.law", "Schedule": "model.schedules",
    "SimulationError": "errors", "Sink": "model.leaders", "Smooth": "model.smooth_graphs", "SmoothCone": "model.views",
    "State": "model.state", "StorageError": "errors", "Track": "model.tracking", "Velocity": "model.leaders",
    "Wall": "model.obstacles", "agent_energies": "study.state_energy", "animate": "show.animate",
    "audit": "papers.auditing", "check_potential": "study.potential_check", "control": "engine.reference",
    "control_of": "engine.reference", "evaluate": "engine.reference", "export_run": "engine.exchange",
    "first_difference": "engine.compare", "lab": "apps.lab.server", "plot": "show.plot", "read_run": "engine.storage",
    "read_scenario": "study.scenario_file", "read_start": "engine.start_files", "read_sweep": "study.sweeps.sweep",
    "resume": "engine.resuming", "simulate": "engine.simulate", "start": "engine.starting",
    "structural_potential": "model.structural", "sweep": "study.sweeps.sweep", "total_energy": "study.state_energy",
    "write_run": "engine.storage", "write_scenario": "study.scenario_file",
}  # fmt: skip

__all__ = [*sorted(_HOMES), "papers"]


def __getattr__(name: str) -> Any:
    if name == "papers":
        return import_module("flocking.papers")
    if name in _HOMES:
        value = getattr(import_module(f"flocking.{_HOMES[name]}"), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'flocking' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
