"""What claims and certificates state where the rest frame of the world is physical."""

from __future__ import annotations

from dataclasses import replace

from flocking.model.law import Scenario
from flocking.study.claims.claim import Measure
from flocking.study.evidence import Evidence


def frame_words(scenario: Scenario) -> str:
    """That rest is physical in the world of a ``scenario``, and why; empty where it is not."""
    world = scenario.rest_frame
    return f"the rest frame of the world is physical: {world}" if world else ""


def frame_note(e: Evidence) -> str:
    """`frame_words` of the scenario of a run."""
    return frame_words(e.run.scenario)


def with_frame(e: Evidence, measured: Measure) -> Measure:
    """What was ``measured``, with `frame_note` at the end of its note."""
    found = frame_note(e)
    return replace(measured, note=f"{measured.note}; {found}") if found else measured
