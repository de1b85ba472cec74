"""Comparison of what bodies in kernels make of the desired forces with the declaration of the bodies."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Numbers32
from flocking.engine.adaptive_steps.state_tolerances import ORDINARY
from flocking.engine.kernels.codegen import array_kernels
from flocking.engine.kernels.layout import Layout
from flocking.engine.tiles.kernels.body_motion import further_names
from flocking.engine.tiles.particles.law_parameters import elapsed
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.errors import LawNotObeyed
from flocking.model.bodies.body import LIMIT_ROUNDS
from flocking.model.law import Scenario

NUDGE = 2.0**-20
"""Relative change of the numbers of an agent by which it is measured how much rounding them can change its rates."""

UNITS = 64.0
"""Largest accepted error in units of the rounding of the numbers that go in, whose effect is measured."""


class BodyCheck:
    """Compares rates of the columns of agents with those that their body states.

    The statement is evaluated in double precision from the scenario's own numbers, by other code than the kernel.

    Parameters
    ----------
    scenario
        Its agents are judged.
    rounding
        Machine epsilon of the state.
    """

    def __init__(self, scenario: Scenario, rounding: float) -> None:
        self.scenario, self.rounding = scenario, rounding
        self._layout = Layout(scenario.law, scenario.energy, scenario.agents, scenario.space, True)
        self._motion = array_kernels(self._layout, scenario.start.dimension).motion

    def check(self, particles: ParticleArrays, places: Indices, t: float, since: float) -> None:
        """Judge the agents at some places after a pass that left the state as it was.

        Parameters
        ----------
        particles
            The agents.
        places
            Indices of those judged.
        t
            The time.
        since
            A time from which the gusts in force blow, and whose scheduled numbers apply.

        Raises
        ------
        LawNotObeyed
            When a rate is another one.
        """
        m, bodies = particles.m, self.scenario.agents
        state, given, desired = self._asked(particles, places, t, since)
        found = np.concatenate([particles.Y[m:, places], particles.body_rows.slopes[:, places]]).astype(np.float64)
        stated, acting = self._stated(state, given, desired)
        # What limits take away may be nearly all of a rate, whose rounding then is that of the rate before.
        free = {name: np.zeros(len(places)) for name in acting}
        relative = {f"w{k}" for k in range(m)}
        reach, signs = np.zeros_like(stated), np.random.default_rng(len(places))
        for limits in (acting, free):
            about = self._stated(state, given | limits, desired, follow=False)[0]
            reach += np.abs(about)
            for name in (name for name in state if name not in relative):
                nudged = state | {name: state[name] * (1.0 + NUDGE * signs.choice([-1.0, 1.0], len(places)))}
                reach += np.abs(self._stated(nudged, given | limits, desired, follow=False)[0] - about) / NUDGE
        wrong = ~(np.abs(found - stated) <= UNITS * self.rounding * reach)
        if wrong.any():
            which, agent = np.unravel_index(int(np.argmax(wrong)), wrong.shape)
            raise LawNotObeyed(
                f"The computed motion does not follow {type(bodies).__name__}: {desired[which]} is "
                f"{found[which, agent]:.6g} and should be {stated[which, agent]:.6g}. This is an error of the "
                "engine, not of the step; use engine='exact', and report the body.",
                time=t, agents=(int(particles.ids[places[agent]]),),
            )  # fmt: skip

    def fastest_rate(self, particles: ParticleArrays, places: Indices, t: float) -> float:
        """Largest modulus of an eigenvalue of what bodies add to the motion, under the forces of the last pass.

        The rates of positions, velocities and columns are differentiated by these, at the agents at some places.

        Parameters
        ----------
        particles
            The agents, after a pass that left the state as it was.
        places
            Indices of those looked at.
        t
            The time.
        """
        m, second = particles.m, self.scenario.agents.order == 2
        state, given, desired = self._asked(particles, places, t, t)
        moving = [name for name in state if name[0] not in "uw" and (second or name[0] != "p")]
        about = self._stated(state, given, desired)[0]
        rows = np.zeros((len(places), len(moving), len(moving)))
        first = m if second else 0
        for k in range(first):
            rows[:, k, moving.index(f"p{k}")] = 1.0
        for column, name in enumerate(moving):
            size = np.abs(state[name])
            largest = float(size.max(initial=0.0))
            change = NUDGE * np.maximum(size, largest if 0.0 < largest < ORDINARY else 1.0)
            moved = self._stated(state | {name: state[name] + change}, given, desired)[0]
            rows[:, first:, column] = ((moved - about) / change).T
        finite = np.isfinite(rows).all(axis=(1, 2))
        return float(np.abs(np.linalg.eigvals(rows[finite])).max(initial=0.0))

    def _asked(
        self, particles: ParticleArrays, places: Indices, t: float, since: float
    ) -> tuple[dict[str, Array], dict[str, Array], list[str]]:
        """State and numbers of agents by their names in formulas, and the names of the rates of what they have."""
        m, bodies = particles.m, self.scenario.agents
        columns = [f"column_{name}_{k}" for name, width in bodies.widths(m).items() for k in range(width)]
        values = {f"q{k}": particles.X[k, places] for k in range(m)}
        values |= {f"p{k}": particles.X[m + k, places] for k in range(m)}
        values |= {name: particles.body_rows.further[k, places] for k, name in enumerate(columns)}
        values |= {f"u{k}": particles.body_rows.controls[k, places] for k in range(m)}
        state = {name: x.astype(np.float64) for name, x in values.items()}
        state |= {f"w{k}": state[f"p{k}"] for k in range(m)}
        given = self._numbers(particles.ids[places], since) | {"t": np.full(len(places), t)}
        moved = "p" if bodies.order == 2 else "q"
        names = [*(f"rate_{moved}{k}" for k in range(m)), *(f"rate_{x}" for x in further_names(particles.spec))]
        return state, given, names

    def _numbers(self, agents: Numbers32, since: float) -> dict[str, Array]:
        """Numbers of the agents that are in force from a time on, by their names in formulas."""
        scenario, m = self.scenario, self.scenario.start.dimension
        rows = self._layout.numbers(scenario.agents, since).each
        found = {f"A{k}": np.broadcast_to(np.asarray(x, dtype=np.float64), scenario.start.n)[agents]
                 for k, x in enumerate(rows)}  # fmt: skip
        drawn = scenario.agents.drawn(elapsed(scenario, since), scenario.start.n, m)
        for name, row in self._layout.held_rows(m).items():
            found[f"A{row}"] = drawn[name][agents] if name in drawn else np.zeros(len(agents))
        return found

    def _stated(
        self, state: dict[str, Array], given: dict[str, Array], desired: list[str], *, follow: bool = True
    ) -> tuple[Array, dict[str, Array]]:
        """Rates, shape (rates, agents), and which limits act by the names of their rows."""
        scenario, m = self.scenario, self.scenario.start.dimension
        drawn = scenario.agents.drawn(0.0, 1, m)
        limits = [f"A{row}" for name, row in self._layout.held_rows(m).items() if name not in drawn]
        P = self._layout.packed(self._layout.numbers(scenario.agents, 0.0).single)
        acting = {name: given[name] for name in limits}
        with np.errstate(all="ignore"):
            for _ in range(LIMIT_ROUNDS * len(limits) if follow else 0):
                values = self._motion(P, state | given | acting)
                acting = {name: np.where(values[f"begins_{k}"] > 0, 1.0, 0.0) for k, name in enumerate(limits)}
            values = self._motion(P, state | given | acting)
        shape = len(next(iter(state.values())))
        return np.array([np.broadcast_to(values[name], shape) for name in desired], dtype=np.float64), acting
