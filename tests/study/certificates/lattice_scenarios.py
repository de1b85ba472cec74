"""Random scenarios that start next to an equilibrium of their potentials, and what their runs show of promises."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

import flocking as fk
from flocking.study.certificates.certificate import Certificates
from flocking.study.certificates.linear.near_equilibrium import NearEquilibrium

POTENTIALS = ("a/r + b*r**2", "a*exp(-2*r) + b*r", "b*(r - 1)**2*(1 + a*r)", "a/r**2 - a/r + b*r**2/8")
"""Formulas with a least value."""

MOVED = 1e-5
"""How far agents start from the equilibrium: small, so that what is linear tells how they move."""


def linearised(shape: Generator, rng: Generator) -> fk.Scenario:
    """A patch of a triangular lattice, slightly moved away from the equilibrium to which it leads."""
    n, first = int(rng.integers(2, 8)), bool(shape.random() < 0.5)
    formula = POTENTIALS[int(shape.integers(len(POTENTIALS)))]
    psi = fk.Potential(formula, a=float(rng.uniform(0.5, 3)), b=float(rng.uniform(0.5, 3)))
    places = np.array([[x + 0.5 * (y % 2), y * np.sqrt(0.75)] for y in range(3) for x in range(3)])[:n]
    weighted = shape.random() < 0.3
    graph: fk.Graph = (
        fk.Smooth(4.0, 0.6) if weighted else fk.Complete() if shape.random() < 0.6 else fk.Hysteresis(4.0, 0.2)
    )
    terms: list[object] = [fk.Gradient(psi)]
    if not first:
        terms.append(fk.Consensus(float(rng.uniform(0.3, 2))))
    bodies = fk.SingleIntegrator() if first else fk.PointMass(float(rng.uniform(0.5, 2)))
    start = fk.State(places + 0.05 * rng.normal(size=places.shape), np.zeros_like(places))
    base = fk.Scenario(fk.Law(graph, terms), start, t_end=1.0, frames=2, bodies=bodies)
    near = NearEquilibrium(base)
    if not near.hypotheses[-1].holds:
        return base
    moved = near.equilibrium.q + MOVED * rng.normal(size=places.shape)
    base = base.with_(start=fk.State(moved, np.zeros_like(places)))
    found = fk.certify(base)
    way = shape.random()
    period, delay, rate = (found[f"equilibrium_{key}"].safe_lower for key in ("period", "delay", "decay_rate"))
    if way < 0.5 and period is not None:
        held = round(float(rng.uniform(0.3, 0.98)) * period, 9)
        return base.with_(t_end=60 * held, control=fk.Held(held))
    if way < 0.65 and delay is not None:
        tau = float(rng.uniform(0.3, 0.98)) * delay
        return base.with_(t_end=20 * tau, information=fk.Delayed(tau, self_delayed=True))
    return base.with_(t_end=min(4.0 / rate, 20.0) if rate is not None else 1.0)


MAKERS = {"linearised": linearised}
"""Kinds of scenarios next to an equilibrium."""


NONLINEAR = 1e-2
"""Relative share of what is not linear, of deformations of a hundred thousandth."""

SMALLEST = 1e-9
"""Deformations that runs of a tolerance of 1e-9 resolve."""


def deformation_fates(found: Certificates, run: fk.Run) -> list[tuple[str, bool, str, float | None]]:
    """Key, whether it was kept, what was seen and the tightness, of promises about deformations of an equilibrium."""
    rows: list[tuple[str, bool, str, float | None]] = []
    equilibrium = next((c for c in found if c.key == "equilibrium"), None)
    if equilibrium is None or not equilibrium.granted:
        return rows
    near = NearEquilibrium(run.scenario)
    first, last = (_deformation(near, np.asarray(run.q[k], dtype=np.float64)) for k in (0, -1))
    if not 1e-7 < first < 1e-3:
        # The start is not next to the equilibrium.
        return rows
    time, scenario = float(run.t[-1] - run.t[0]), run.scenario
    words = f"{last:.6g} of {first:.6g}"
    if not scenario.imperfections:
        each = found["equilibrium_decay_rate"]
        if each.granted and near.order == 1:
            most = first * np.exp(-each.bound.lo * time)
            kept = last <= most * (1.0 + NONLINEAR) + SMALLEST
            tight = float(last / most) if most > 100 * SMALLEST else None
            rows.append((each.key, bool(kept), f"{words}, at most {most:.6g}", tight))
        return rows
    key = "equilibrium_period" if isinstance(scenario.control, fk.Held) else "equilibrium_delay"
    each, value = found[key], float(np.max(getattr(scenario.control, "period", 0.0)))
    value = value or float(getattr(scenario.information, "tau", np.inf))
    if each.granted and value < each.bound.lo:
        # Of order 1 and held control nothing grows from tick to tick; elsewhere transients may.
        most = 1.0 + NONLINEAR if near.order == 1 and key.endswith("period") else 30.0
        rows.append((key, bool(last <= most * first + SMALLEST), words, None))
    return rows


def _deformation(near: NearEquilibrium, q: np.ndarray) -> float:
    """Size of the displacement from the equilibrium that translations and rotations leave, by the best fit."""
    at = near.equilibrium.q
    a, b = q - q.mean(axis=0), at - at.mean(axis=0)
    u, _, v = np.linalg.svd(a.T @ b)
    signs = np.ones(len(u))
    signs[-1] = np.sign(np.linalg.det(u @ v))
    return float(np.linalg.norm(a @ (u * signs) @ v - b))
