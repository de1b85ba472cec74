"""Shi, Wang, Chu: Flocking of multi-agent systems with a dynamic virtual leader (Int. J. Control, 2009)."""

from __future__ import annotations

from flocking.papers.shi_2009.bounds import distance_bound, speed_bounds
from flocking.papers.shi_2009.closed_forms import (
    centre_motion,
    exponential_leading_part,
    exponential_motion,
    free_motion,
    jordan_form,
    ramp_motion,
    steady_velocity_error,
)
from flocking.papers.shi_2009.pictures import figure, figures
from flocking.papers.shi_2009.system import potential, scenario, scenarios
from flocking.papers.shi_2009.table import equations, errata
from flocking.papers.shi_2009.theorems import claims

KEY = "shi-2009"
TITLE = "Flocking of multi-agent systems with a dynamic virtual leader"
AUTHORS = "H. Shi, L. Wang, T. Chu"
YEAR = 2009

__all__ = [
    "AUTHORS",
    "KEY",
    "TITLE",
    "YEAR",
    "centre_motion",
    "claims",
    "distance_bound",
    "equations",
    "errata",
    "exponential_leading_part",
    "exponential_motion",
    "figure",
    "figures",
    "free_motion",
    "jordan_form",
    "potential",
    "ramp_motion",
    "scenario",
    "scenarios",
    "speed_bounds",
    "steady_velocity_error",
]
