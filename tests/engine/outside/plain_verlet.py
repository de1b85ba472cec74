"""An engine from outside the library, in one file: velocity Verlet on NumPy arrays, for small groups."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

import flocking as fk
from flocking.engine import interruption
from flocking.engine.archives.data_checks import Integer, Names, Real, Row, Table
from flocking.engine.protocol.engine import Engine
from flocking.engine.protocol.session import Packed, Session, Stored
from flocking.engine.runs.fidelity import Approaches, Fidelity, LedgerRule
from flocking.engine.runs.recorder import Recorder
from flocking.engine.runs.run import Closest
from flocking.errors import InvalidInput, UnsupportedLaw
from flocking.model.checks import number

LEDGER_SHARE = 0.05


@dataclass(frozen=True)
class PlainOptions:
    step: float = 0.01

    def __post_init__(self) -> None:
        number("PlainOptions", "step", self.step, above=0.0)


class PlainSession(Session):
    engine = "plain-verlet"
    saves_when_interrupted = True

    def __init__(self, scenario: fk.Scenario, options: PlainOptions, plant: fk.Law | None = None) -> None:
        self.scenario, self.plant, self.options = scenario, plant, options
        span = scenario.t_end - scenario.start.t
        self.h = span / max(1, math.ceil(span / options.step - 1e-9)) if span else options.step
        self.steps, self.records = 0, Recorder(scenario)
        self.at, self.p, self.top = scenario.start.q, scenario.start.p, 0.0
        self.links = scenario.law.graph.start_links(self.at) if scenario.start.links is None else scenario.start.links
        self.row = (self.time, *self._energies(), 0.0, 0.0, 0.0, 0.0)
        self._record()

    @property
    def time(self) -> float:  # type: ignore[override]
        return self.scenario.start.t + self.steps * self.h

    @property
    def state(self) -> fk.State:
        return fk.State(self.at, self.p, self.time, self.links)

    def _told(self, law: fk.Law | None = None, p: Any = None) -> Any:
        state = fk.State(self.at, self.p if p is None else p, self.time, self.links)
        return fk.evaluate(law or self.scenario.law, state, agents=self.scenario.agents, energy=self.scenario.energy)

    def _energies(self) -> tuple[float, float]:
        told, n = self._told(), len(self.at)
        apart = 0.5 * (n * (n - 1) - int(self.links.sum())) * self.scenario.energy.unlinked
        return told.storage + told.kinetic + apart, told.kinetic

    def accelerations(self, p: Any = None) -> Any:
        velocities, agents = self.p if p is None else p, self.scenario.agents
        force = self._told(self.plant, velocities).u - np.reshape(agents.damping, (-1, 1)) * velocities
        return force / np.reshape(agents.masses, (-1, 1))

    def reached(self, to: float) -> bool:
        return self.time >= to - 1e-9 * self.h

    def advance(self, to: float, seconds: float = math.inf) -> None:
        stop = time.monotonic() + seconds
        while not self.reached(to):
            interruption.check()
            self._step()
            if time.monotonic() >= stop:
                return

    def _powers(self) -> Any:
        told = self._told()
        return np.array([float((self._told(self.plant).u * self.p).sum()), told.dissipation, told.supply])

    def _step(self) -> None:
        before, a = self._powers(), self.accelerations()
        half = self.p + 0.5 * self.h * a
        self.at = self.at + self.h * half
        self.steps += 1
        self.p = half + 0.5 * self.h * self.accelerations(half + 0.5 * self.h * a)
        integrals = np.array(self.row[3:6]) + 0.5 * self.h * (before + self._powers())
        energy = self._energies()[0]
        self.links = self.scenario.law.graph.update(self.at, self.links)
        after, kinetic = self._energies()
        self.row = (self.time, after, kinetic, *map(float, integrals), self.row[6] + after - energy)
        self._record()

    def _record(self) -> None:
        self.records.trace.append(self.row)
        self.top = max(self.top, float(np.linalg.norm(self.p, axis=1).max()))
        distance = np.sqrt(((self.at[:, None] - self.at) ** 2).sum(axis=2)) + np.where(np.eye(len(self.at)), np.inf, 0)
        for name, pairs in (("closest_linked", self.links | self.links.T), ("closest_unlinked", ~self.links)):
            among = np.where(pairs, distance, np.inf)
            i, j = (int(k) for k in np.unravel_index(int(among.argmin()), among.shape))
            if among[i, j] < vars(self.records)[name].distance:
                setattr(self.records, name, Closest(float(among[i, j]), self.time, (min(i, j), max(i, j))))
        if self.records.due(self.time):
            self.records.frame(self.time, self.at, self.p, self.links)

    def replace(self, *, law: fk.Law | None = None, state: fk.State | None = None) -> None:
        if state is not None and state.q.shape != self.at.shape:
            raise InvalidInput("PlainSession", "state", "must keep the number of agents", state.q.shape)
        before = self._energies()[0]
        self.scenario = self.scenario.with_(law=law or self.scenario.law)
        if state is not None:
            self.at, self.p = state.q, state.p
            self.links = self.links if state.links is None else state.links
        after, kinetic = self._energies()
        self.row = (self.time, after, kinetic, *self.row[3:6], self.row[6] + after - before)
        self.records.trace.append(self.row)

    @property
    def fidelity(self) -> Fidelity:
        near = Approaches("all", 2.0 * self.top * self.h)
        return Fidelity(self.engine, approaches=near, ledger=LedgerRule("share", LEDGER_SHARE), fixed_step=self.h)

    def pack(self) -> Packed:
        near = [[c.distance, c.time, *c.pair] for c in self.closest_pairs]
        kept = {"steps": self.steps, "step": self.h, "row": self.row, "top": self.top, "near": near}
        return {**kept, "options": asdict(self.options)}, {"q": self.at, "p": self.p, "links": self.links}

    @classmethod
    def unpack(cls, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> PlainSession:
        numbers, arrays = packed
        n, m = stored.scenario.start.q.shape
        near, any_number = Row([Real(finite=False)] * 2 + [Integer(-1, n - 1)] * 2), Real(finite=False)
        Names({"steps": Integer(), "step": Real(least=0.0), "row": Row([Real()] * 7), "top": any_number,
               "near": Row([near, near]), "options": Names({"step": Real(least=0.0)})}).check(numbers, "")  # fmt: skip
        place = Table("f8", (n, m))
        Names({"q": place, "p": place, "links": Table("?", (n, n))}).check(arrays, "")
        found: Any = numbers
        session = cls(stored.scenario, PlainOptions(**found["options"]), stored.plant)
        session.steps, session.h, session.row, session.top = (
            found["steps"],
            found["step"],
            (*found["row"],),
            found["top"],
        )
        session.at, session.p, session.links = arrays["q"], arrays["p"], arrays["links"]
        session.records = Recorder(stored.scenario)
        session.records.recall(stored.counts, stored.read)
        linked, unlinked = (Closest(d, t, (i, j)) for d, t, i, j in found["near"])
        session.records.closest_linked, session.records.closest_unlinked = linked, unlinked
        return session


class PlainEngine(Engine):
    name = "plain-verlet"
    summary = "velocity Verlet on NumPy arrays, for small groups"
    options = PlainOptions

    def check(self, scenario: fk.Scenario, plant: fk.Law | None = None) -> None:
        if scenario.agents.order != 2:
            raise UnsupportedLaw("plain-verlet runs agents of order 2 alone. Use engine='exact'.")

    def open(self, scenario: fk.Scenario, options: object, *, plant: fk.Law | None = None) -> Session:
        assert isinstance(options, PlainOptions)
        self.check(scenario, plant)
        return PlainSession(scenario, options, plant)

    def unpack(self, packed: Packed, stored: Stored, changes: Mapping[str, object]) -> Session:
        return PlainSession.unpack(packed, stored, changes)


ENGINE = PlainEngine()
