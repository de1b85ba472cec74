"""How the bodies of a state move under the forces of a law, on NumPy arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from flocking.engine.kernels.layout import Layout
from flocking.model.bodies.body import LIMIT_ROUNDS
from flocking.model.checks import Array
from flocking.model.state import State


def motion_of(
    layout: Layout, module: Any, state: State, P: Array, given: Mapping[str, Any], u: Array, frame: Array
) -> dict[str, Array]:
    """Kinetic energy, departure and rates of every agent, by the names of `MotionFormulas`.

    Limits act where they would begin to; what the clock sets is as at the start of a run.

    Parameters
    ----------
    layout
        The law, and what the agents are.
    module
        Its functions on arrays.
    state
        The state.
    P, given
        Parameters, and the values that formulas of an agent may use.
    u
        Desired forces of the law, shape (N, m).
    frame
        Velocity of the frame of the energy, shape (m,).
    """
    body, (n, m) = layout.bodies, state.q.shape
    values = {**given, **{f"u{k}": u[:, k] for k in range(m)}}
    values |= {f"w{k}": state.p[:, k] - frame[k] for k in range(m)}
    columns = {**state.columns, **body.missing_columns(state.columns, state.q, state.p)}
    values |= {f"column_{name}_{k}": x for name, of_agents in columns.items() for k, x in enumerate(of_agents.T)}
    rows, drawn = layout.held_rows(m), body.drawn(0.0, n, m)
    values |= {f"A{row}": drawn.get(name, np.zeros(n)) for name, row in rows.items()}
    limits = [row for name, row in rows.items() if name not in drawn]
    # Formulas of limits that do not act are evaluated as well, such as a division by the speed of an agent at rest.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(LIMIT_ROUNDS if limits else 0):
            found = module.motion(P, values)
            values |= {f"A{row}": np.where(found[f"begins_{k}"] > 0.0, 1.0, 0.0) for k, row in enumerate(limits)}
        return {name: value * np.ones(n) for name, value in module.motion(P, values).items()}
