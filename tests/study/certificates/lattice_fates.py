"""What runs next to an equilibrium show of promises about its linearisation."""

from __future__ import annotations

import numpy as np

import flocking as fk
from flocking.study.certificates.certificate import Certificates
from flocking.study.certificates.linear.near_equilibrium import NearEquilibrium

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
