"""Scenarios of the papers in other units of length, time and mass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import flocking as fk
from flocking.formula.grammar import Formula
from flocking.papers import paper, paper_of


def _with(pattern: str, **parts: Formula) -> Formula:
    return Formula(pattern, "units").with_parts({name: formula.tree for name, formula in parts.items()})


@dataclass
class Units:
    """What is called 1 of a length, a time and a mass."""

    length: float = 1.0
    time: float = 1.0
    mass: float = 1.0
    leaders: dict[int, fk.Leader] = field(default_factory=dict)

    @property
    def energy(self) -> float:
        return self.mass * (self.length / self.time) ** 2

    def potential(self, psi: fk.Potential) -> fk.Potential:
        """E psi(r/L)."""
        inner = psi.formula.with_parts({"r": Formula("r/unit_length", "units").tree})
        numbers = {**psi.parameters, "unit_length": self.length, "unit_energy": self.energy}
        return fk.Potential(_with("unit_energy*PSI", PSI=inner), parameters=numbers)

    def leader(self, given: fk.Leader | None) -> fk.Leader | None:
        """The leader; one that several terms share is made once."""
        if given is None:
            return None
        if id(given) not in self.leaders:
            self.leaders[id(given)] = self._leader(given)
        return self.leaders[id(given)]

    def _leader(self, given: fk.Leader) -> fk.Leader:
        if isinstance(given, fk.Sink):
            return fk.Sink(self.length * given.point)
        if isinstance(given, fk.Velocity):
            return fk.Velocity(self.length / self.time * given.value, start=self.length * given.start)
        assert isinstance(given, fk.Path)
        later = {"t": Formula("t/unit_time", "units").tree}
        formulas = [_with("unit_speed*PSI", PSI=formula.with_parts(later)) for formula in given.formulas]
        numbers = {"unit_speed": self.length / self.time, "unit_time": self.time}
        return fk.Path(formulas, start=self.length * given.start, **numbers)

    def graph(self, graph: fk.Graph) -> fk.Graph:
        """The graph; gaps are lengths as radii are."""
        lengths = {name: getattr(graph, name) for name in ("radius", "gap") if hasattr(graph, name)}
        return replace(graph, **{name: self.length * value for name, value in lengths.items()}) if lengths else graph

    def term(self, term: object) -> object:
        """A term of a law of the papers."""
        drag, stiffness = self.mass / self.time, self.mass / self.time**2
        if isinstance(term, fk.Gradient):
            return replace(term, potential=self.potential(term.potential))
        if isinstance(term, fk.Consensus):
            return replace(term, gain=drag * term.gain)
        if isinstance(term, fk.Track):
            own = 1.0 / self.mass if term.per_mass else 1.0
            return replace(
                term, leader=self.leader(term.leader), position_gain=own * stiffness * term.position_gain,
                velocity_gain=own * drag * term.velocity_gain,
            )  # fmt: skip
        if isinstance(term, fk.Avoid):
            balls = [fk.Ball(self.leader(x.centre), self.length * x.radius) for x in term.obstacles]
            return replace(
                term, obstacles=balls, leader=self.leader(term.leader), range=self.length * term.range,
                repulsion=self.potential(term.repulsion), attraction=self.potential(term.attraction),
                damping_gain=drag * term.damping_gain, offset=self.length * term.offset,
            )  # fmt: skip
        assert isinstance(term, fk.Compensate)
        return term

    def scenario(self, given: fk.Scenario) -> fk.Scenario:
        """The scenario in these units, without its name: papers' claims are about their own numbers."""
        law = fk.Law(self.graph(given.law.graph), [self.term(term) for term in given.law.terms])
        start = fk.State(self.length * given.start.q, self.length / self.time * given.start.p)
        bodies = fk.PointMass(self.mass * given.agents.masses, self.mass / self.time * given.agents.damping)
        energy = replace(
            given.energy, leader=self.leader(given.energy.leader), unlinked=self.energy * given.energy.unlinked
        )
        return replace(
            given, law=law, start=start, agents=bodies, energy=energy, t_end=self.time * given.t_end, name=""
        )


def short(name: str, duration: float, seed: int = 1, **options: object) -> fk.Scenario:
    """The beginning of a paper's scenario; ``options`` go to its system."""
    made: Callable[..., fk.Scenario] = paper(paper_of(name)).scenarios()[name]
    return made(seed, **options).with_(t_end=duration, frames=41)


def verdicts(run: fk.Run) -> dict[str, str]:
    """What the general claims say about a run."""
    return {result.claim.key: str(result.verdict) for result in fk.audit(run).results}
