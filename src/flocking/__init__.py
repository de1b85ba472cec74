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
    from flocking.engine.driver.resuming import resume as resume
    from flocking.engine.driver.simulate import simulate as simulate
    from flocking.engine.driver.starting import start as start
    from flocking.engine.exact.session import ExactSession as ExactSession
    from flocking.engine.reference.control import Agent as Agent
    from flocking.engine.reference.control import control as control
    from flocking.engine.reference.control import control_of as control_of
    from flocking.engine.reference.control import evaluate as evaluate
    from flocking.engine.runs.compare import first_difference as first_difference
    from flocking.engine.runs.run import Run as Run
    from flocking.engine.storage.exchange import export_run as export_run
    from flocking.engine.storage.start_files import read_start as read_start
    from flocking.engine.storage.stored_runs import read_run as read_run
    from flocking.engine.storage.stored_runs import write_run as write_run
    from flocking.errors import FlockingError as FlockingError
    from flocking.errors import InvalidInput as InvalidInput
    from flocking.errors import SimulationError as SimulationError
    from flocking.errors import StorageError as StorageError
    from flocking.model.energy import Energy as Energy
    from flocking.model.graphs.distance_graphs import Fixed as Fixed
    from flocking.model.graphs.distance_graphs import Graph as Graph
    from flocking.model.graphs.distance_graphs import Hysteresis as Hysteresis
    from flocking.model.graphs.distance_graphs import Proximity as Proximity
    from flocking.model.graphs.smooth_graphs import PerAgentRadii as PerAgentRadii
    from flocking.model.graphs.smooth_graphs import Smooth as Smooth
    from flocking.model.graphs.views import Cone as Cone
    from flocking.model.graphs.views import FieldOfView as FieldOfView
    from flocking.model.graphs.views import SmoothCone as SmoothCone
    from flocking.model.graphs.weights import HashedWeights as HashedWeights
    from flocking.model.graphs.weights import MatrixWeights as MatrixWeights
    from flocking.model.law import Law as Law
    from flocking.model.law import Scenario as Scenario
    from flocking.model.leaders_and_obstacles.leaders import Leader as Leader
    from flocking.model.leaders_and_obstacles.leaders import Path as Path
    from flocking.model.leaders_and_obstacles.leaders import Sink as Sink
    from flocking.model.leaders_and_obstacles.leaders import Velocity as Velocity
    from flocking.model.leaders_and_obstacles.obstacles import Ball as Ball
    from flocking.model.leaders_and_obstacles.obstacles import Obstacle as Obstacle
    from flocking.model.leaders_and_obstacles.obstacles import Wall as Wall
    from flocking.model.leaders_and_obstacles.polygons import ConvexPolygon as ConvexPolygon
    from flocking.model.potentials.bumps import Bump as Bump
    from flocking.model.potentials.potential import Potential as Potential
    from flocking.model.potentials.structural_potential import structural_potential as structural_potential
    from flocking.model.state import Agents as Agents
    from flocking.model.state import State as State
    from flocking.model.terms.avoidance import Avoid as Avoid
    from flocking.model.terms.body_terms import BodyTerm as BodyTerm
    from flocking.model.terms.body_terms import Compensate as Compensate
    from flocking.model.terms.body_terms import Track as Track
    from flocking.model.terms.pair_terms import Consensus as Consensus
    from flocking.model.terms.pair_terms import Gradient as Gradient
    from flocking.model.terms.pair_terms import PairTerm as PairTerm
    from flocking.model.terms.schedules import Schedule as Schedule
    from flocking.papers.auditing import audit as audit
    from flocking.show.animate import animate as animate
    from flocking.show.plot import plot as plot
    from flocking.study.potentials.potential_check import check_potential as check_potential
    from flocking.study.potentials.state_energy import agent_energies as agent_energies
    from flocking.study.potentials.state_energy import total_energy as total_energy
    from flocking.study.scenario_files.scenario_file import read_scenario as read_scenario
    from flocking.study.scenario_files.scenario_file import write_scenario as write_scenario
    from flocking.study.sweeps.sampling import Sample as Sample
    from flocking.study.sweeps.sweep import read_sweep as read_sweep
    from flocking.study.sweeps.sweep import sweep as sweep

__version__ = "0.1.0"

_HOMES = {
    "Agent": "engine.reference.control", "Agents": "model.state", "Avoid": "model.terms.avoidance",
    "Ball": "model.leaders_and_obstacles.obstacles", "BodyTerm": "model.terms.body_terms",
    "Bump": "model.potentials.bumps", "Compensate": "model.terms.body_terms", "Cone": "model.graphs.views",
    "Consensus": "model.terms.pair_terms", "ConvexPolygon": "model.leaders_and_obstacles.polygons",
    "Energy": "model.energy", "ExactSession": "engine.exact.session", "FieldOfView": "model.graphs.views",
    "Fixed": "model.graphs.distance_graphs", "FlockingError": "errors", "Gradient": "model.terms.pair_terms",
    "Graph": "model.graphs.distance_graphs", "HashedWeights": "model.graphs.weights",
    "Hysteresis": "model.graphs.distance_graphs", "InvalidInput": "errors", "Law": "model.law",
    "Leader": "model.leaders_and_obstacles.leaders", "MatrixWeights": "model.graphs.weights",
    "Obstacle": "model.leaders_and_obstacles.obstacles", "PairTerm": "model.terms.pair_terms",
    "Path": "model.leaders_and_obstacles.leaders", "PerAgentRadii": "model.graphs.smooth_graphs",
    "Potential": "model.potentials.potential", "Proximity": "model.graphs.distance_graphs", "Run": "engine.runs.run",
    "Sample": "study.sweeps.sampling", "Scenario": "model.law", "Schedule": "model.terms.schedules",
    "SimulationError": "errors", "Sink": "model.leaders_and_obstacles.leaders",
    "Smooth": "model.graphs.smooth_graphs", "SmoothCone": "model.graphs.views", "State": "model.state",
    "StorageError": "errors", "Track": "model.terms.body_terms", "Velocity": "model.leaders_and_obstacles.leaders",
    "Wall": "model.leaders_and_obstacles.obstacles", "agent_energies": "study.potentials.state_energy",
    "animate": "show.animate", "audit": "papers.auditing", "check_potential": "study.potentials.potential_check",
    "control": "engine.reference.control", "control_of": "engine.reference.control",
    "evaluate": "engine.reference.control", "export_run": "engine.storage.exchange",
    "first_difference": "engine.runs.compare", "lab": "apps.lab.server", "plot": "show.plot",
    "read_run": "engine.storage.stored_runs", "read_scenario": "study.scenario_files.scenario_file",
    "read_start": "engine.storage.start_files", "read_sweep": "study.sweeps.sweep",
    "resume": "engine.driver.resuming", "simulate": "engine.driver.simulate", "start": "engine.driver.starting",
    "structural_potential": "model.potentials.structural_potential", "sweep": "study.sweeps.sweep",
    "total_energy": "study.potentials.state_energy", "write_run": "engine.storage.stored_runs",
    "write_scenario": "study.scenario_files.scenario_file",
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
