"""A time step from the start of a run: how fast forces change, how strong damping is, how fast agents close in."""

from __future__ import annotations

from typing import Any

import numpy as np

from flocking.engine.tiles.crowd import Crowd
from flocking.engine.tiles.pairs import tile_pairs
from flocking.model.law import Scenario
from flocking.model.terms import Gradient

SAMPLE = 4000
"""Agents looked at, evenly over the sorted order."""

PROBE = 1e-4
"""Relative change of the probes that measure stiffness."""

LARGEST = 0.1
PERIODS = 0.15
"""Step times the fastest rate of the linearised motion."""
CLOSING = 0.02
"""Share of its distance that a pair may close per step at the start."""


def choose(crowd: Crowd, scenario: Scenario, scheme: str) -> float:
    """The largest step that resolves the start: at most 0.1, and 1/100 of the run.

    The rates of the motion are bounded by sums over neighbours: the curvature of every potential at the pair's
    distance and at the closest distance met (frequency), and the gains of velocity terms (damping).
    """
    m, n = crowd.m, crowd.n
    span = scenario.t_end - scenario.start.t
    limits = [LARGEST, span / 100 if span > 0 else LARGEST]
    mass = float(np.min(scenario.agents.masses))
    damping = float(np.max(scenario.agents.damping))
    for number, lists in enumerate(crowd.lists):
        if lists is None:
            continue
        tiles = range(0, crowd.tiles, max(1, n // SAMPLE))
        i, j = tile_pairs(lists, tiles, crowd.n)
        if not len(i):
            continue
        offset = (crowd.X[:m, j] - crowd.X[:m, i]).astype(np.float64)
        r = np.sqrt((offset**2).sum(axis=0))
        inside = r < (crowd.cutoffs[number] or np.inf)
        i, j, r, offset = i[inside], j[inside], r[inside], offset[:, inside]
        if not len(i):
            continue
        degree = np.bincount(i, minlength=n)
        stiff = np.zeros(len(r))
        for term in scenario.law.pair_terms:
            if scenario.law.graph_number(term) != number:
                continue
            if isinstance(term, Gradient):
                near, far = np.maximum(r * (1 - PROBE), 1e-12), r * (1 + PROBE)
                with np.errstate(all="ignore"):
                    bend = np.abs(term.potential.slope(far) - term.potential.slope(near)) / (far - near)
                    stiff += np.where(np.isfinite(bend), bend, 0.0) + np.abs(term.potential.slope(r)) / np.maximum(
                        r, 1e-12
                    )
            else:
                damping += _gain(term) * float(degree.max())
        rate = float(np.sqrt(2.0 * np.bincount(i, stiff, minlength=n).max() / mass))
        if rate > 0:
            limits.append(PERIODS / rate)
        if scenario.law.singular_at_zero():
            speed = np.sqrt(((crowd.X[m:, j] - crowd.X[m:, i]).astype(np.float64) ** 2).sum(axis=0))
            closing = float((speed / np.maximum(r, 1e-12)).max())
            if closing > 0:
                limits.append(CLOSING / closing)
    for body in scenario.law.body_terms:
        for name, value in body.parameters.items():
            if name == "velocity_gain":
                damping += float(np.max(np.asarray(value)))
            elif name == "position_gain":
                limits.append(PERIODS / max(float(np.sqrt(np.max(np.asarray(value)))), 1e-9))
    if damping > 0:
        limits.append((1.0 if scheme == "damped" else 0.25) * mass / damping)
    return float(min(limits))


def _gain(term: Any) -> float:
    values = term.parameters
    gain = float(np.max(np.asarray(values.get("gain", 1.0))))
    weights = values.get("weights")
    if weights is None:
        return gain
    return gain * float(getattr(weights, "high", 0.0) or np.max(getattr(weights, "values", 1.0)))
