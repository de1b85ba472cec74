"""Comparison of what kernels say that bodies make of the desired forces with the declaration of the bodies."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Array, Indices, Numbers32
from flocking.engine.kernels.codegen import array_kernels
from flocking.engine.kernels.layout import Layout
from flocking.engine.tiles.kernels.body_motion import further_names
from flocking.engine.tiles.particles.particle_arrays import ParticleArrays
from flocking.errors import LawNotObeyed
from flocking.model.bodies.body import LIMIT_ROUNDS
from flocking.model.law import Scenario
from flocking.model.world.times import PER_SECOND

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
            A time from which the gusts in force blow.

        Raises
        ------
        LawNotObeyed
            When a rate is another one.
        """
        scenario, m = self.scenario, particles.m
        bodies, names = scenario.agents, further_names(particles.spec)
        columns = [f"column_{name}_{k}" for name, width in bodies.widths(m).items() for k in range(width)]
        values = {f"u{k}": particles.body_rows.controls[k, places] for k in range(m)}
        values |= {f"p{k}": particles.X[m + k, places] for k in range(m)}
        values |= {name: particles.body_rows.further[k, places] for k, name in enumerate(columns)}
        state = {name: x.astype(np.float64) for name, x in values.items()}
        state |= {f"w{k}": state[f"p{k}"] for k in range(m)} | {f"q{k}": np.zeros(len(places)) for k in range(m)}
        given = self._numbers(particles.ids[places], since)
        moved = "p" if bodies.order == 2 else "q"
        desired = [*(f"rate_{moved}{k}" for k in range(m)), *(f"rate_{name}" for name in names)]
        found = np.concatenate([particles.Y[m:, places], particles.body_rows.slopes[:, places]]).astype(np.float64)
        stated, acting = self._stated(state, given, desired)
        # What limits take away may be nearly all of a rate, whose rounding then is that of the rate before.
        free = {name: np.zeros(len(places)) for name in acting}
        reach, signs = np.zeros_like(stated), np.random.default_rng(len(places))
        for limits in (acting, free):
            about = self._stated(state, given | limits, desired, follow=False)[0]
            reach += np.abs(about)
            for name in (*(f"u{k}" for k in range(m)), *(f"p{k}" for k in range(m)), *columns):
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

    def _numbers(self, agents: Numbers32, since: float) -> dict[str, Array]:
        """Numbers of the agents that are in force from a time on, by their names in formulas."""
        scenario, m = self.scenario, self.scenario.start.dimension
        rows = self._layout.numbers(scenario.agents, since).each
        found = {f"A{k}": np.broadcast_to(np.asarray(x, dtype=np.float64), scenario.start.n)[agents]
                 for k, x in enumerate(rows)}  # fmt: skip
        elapsed = round((since - scenario.start.t) * PER_SECOND) / PER_SECOND
        drawn = scenario.agents.drawn(elapsed, scenario.start.n, m)
        for name, row in self._layout.held_rows(m).items():
            found[f"A{row}"] = drawn[name][agents] if name in drawn else np.zeros(len(agents))
        return found | {"t": np.full(len(agents), since)}

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
