"""Messages to pages about scenarios, values and stored runs."""

from __future__ import annotations

from flocking.apps.lab.experiment.experiment import Experiment
from flocking.apps.lab.live.hub import Message
from flocking.apps.lab.panels.catalogue import about, challenges
from flocking.apps.lab.panels.controls import values_of
from flocking.apps.lab.panels.ready_terms import TERMS
from flocking.engine.runs.run import Run
from flocking.model.terms.avoidance import ObstacleTerm
from flocking.show.frames import changed_later

REGROUPED: Message = {
    "kind": "told",
    "message": "Begun anew with the settings that the run began with, since agents had been removed or added.",
}
"""Message where a run that begins anew does not keep its settings: these were of another group."""


def scenario_message(name: str, experiment: Experiment, speed: float) -> dict[str, object]:
    """What is open.

    Parameters
    ----------
    name
        The name that it was opened by.
    experiment
        The experiment.
    speed
        Simulated time per second.
    """
    scenario = experiment.scenario
    return {
        "kind": "scenario", "name": name, "seed": experiment.original.seed, "n": scenario.start.n,
        "d": scenario.start.dimension, "start": float(scenario.start.t), "end": float(scenario.t_end),
        "engine": experiment.engine, "speed": speed, "terms": list(TERMS), "challenges": challenges(),
        **about(name, scenario),
    }  # fmt: skip


def values_message(experiment: Experiment) -> Message:
    """The values that hold in the scenario of an ``experiment``."""
    found = values_of(experiment.scenario, experiment.base)
    return {"kind": "values", "values": [[path, value] for path, value in found]}


def stored_message(run: Run) -> Message:
    """A stored run: its times, its energy over time, and what of its earlier moments is not known."""
    trace = run.trace
    drawn = any(isinstance(term, ObstacleTerm) for term in run.scenario.law.terms) or run.scenario.law.leaders
    return {
        "kind": "stored", "name": run.scenario.name or "without a name", "status": run.status,
        "note": " ".join(changed_later(run, float(run.t[0]))) if drawn else "", "t": [float(t) for t in run.t],
        "times": [float(x) for x in trace["time"]], "energy": [float(x) for x in trace["energy"]],
    }  # fmt: skip
