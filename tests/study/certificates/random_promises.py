"""Random scenarios of all kinds of certificates, run and held against what was promised.

``python -m tests.study.certificates.random_promises 20000`` prints counts, broken promises and the median tightness of
every certificate, after every thousand scenarios and at the end. Scenario k is the same in every call.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

import flocking as fk
from flocking.errors import UnsupportedLaw
from flocking.study.certificates.certificate import Certificates
from flocking.study.certificates.certify import certify
from flocking.study.certificates.comparison import Comparison, compare

UNSTATED = 1e-6
"""Relative excess that the errors of a run without stated errors explain: its tolerance is 1e-9."""

FALLEN = 1e-2
"""Share of its first value to which a disagreement must fall where it is promised that it does."""


@dataclass
class Tally:
    """What was found.

    Parameters
    ----------
    scenarios, runs
        Scenarios that were certified, and runs of them that were held against a promise.
    granted, held
        Certificates that were granted, and comparisons with runs, by key.
    tightness
        Observed over promised, by key.
    broken
        Seed, key and description of every promise that a run broke.
    refused
        Errors that ended a scenario, by their kind.
    """

    scenarios: int = 0
    runs: int = 0
    granted: Counter[str] = field(default_factory=Counter)
    held: Counter[str] = field(default_factory=Counter)
    tightness: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    broken: list[tuple[int, str, str]] = field(default_factory=list)
    refused: Counter[str] = field(default_factory=Counter)

    def __str__(self) -> str:
        lines = [f"{self.scenarios} scenarios, {self.runs} runs held against {sum(self.held.values())} promises; "
                 f"{len(self.broken)} broken; ended by errors: {dict(self.refused)}"]  # fmt: skip
        for key, count in sorted(self.granted.items()):
            values = self.tightness.get(key)
            median = "" if not values else f", median tightness {np.median(values):.3f}"
            lines.append(f"  {key}: granted {count}, held against a run {self.held[key]}{median}")
        return "\n".join([*lines, *(f"  BROKEN {each}" for each in self.broken)])


def tallied(seeds: range, *, report: int | None = None) -> Tally:
    """Certify and run the scenarios of some seeds.

    Parameters
    ----------
    seeds
        The seeds.
    report
        Print the tally after so many of them.
    """
    tally = Tally()
    for number, seed in enumerate(seeds):
        add(tally, seed)
        if report and (number + 1) % report == 0:
            print(tally, flush=True)
    return tally


def add(tally: Tally, seed: int) -> None:
    """Certify and run the scenario of one seed."""
    try:
        scenario = random_scenario(seed)
    except fk.InvalidInput as error:
        tally.refused[f"scenario: {type(error).__name__}"] += 1
        return
    found = certify(scenario)
    tally.scenarios += 1
    tally.granted.update(c.key for c in found.granted)
    try:
        run = fk.simulate(scenario, progress=False)
    except fk.SimulationError as error:
        tally.refused[type(error).__name__] += 1
        run = error.run
        if run is None or not len(run.t):
            return
    except (fk.InvalidInput, UnsupportedLaw) as error:
        tally.refused[type(error).__name__] += 1
        return
    tally.runs += 1
    for row in compare(found, run):
        tally.held[row.key] += 1
        tally.tightness[row.key].append(row.tightness)
        if row.kept is False or (row.kept is None and beyond(row)):
            tally.broken.append((seed, row.key, f"promised {row.promised:.12g}, observed {row.observed:.12g}"))
    for key, kept, words in fates(found, run):
        tally.held[key] += 1
        if not kept:
            tally.broken.append((seed, key, words))


def beyond(row: Comparison) -> bool:
    """Whether a promise is broken by more than errors of the run explain that it does not state."""
    return abs(row.observed - row.promised) > UNSTATED * max(abs(row.promised), 1.0)


def fates(found: Certificates, run: fk.Run) -> list[tuple[str, bool, str]]:
    """Whether a disagreement falls that is promised to, and grows that is promised to grow."""
    rows, scenario = [], run.scenario
    if not run.finished:
        return rows
    # Positions of agents that agree on velocities alone stay apart.
    values = run.q if scenario.agents.order == 1 else run.p
    spread = np.sqrt(((values - values.mean(axis=1, keepdims=True)) ** 2).sum(axis=(1, 2)))
    for key in ("growth_in_world", "delay_in_world"):
        each = found[key]
        exact = isinstance(scenario.information, fk.Instant | fk.Delayed) or not scenario.information.loss
        if not exact or spread[0] < 1e-6:
            continue
        if each.granted and key == "growth_in_world":
            ticks = (scenario.t_end - scenario.start.t) / float(np.max(scenario.control.period))
            # Powers of a matrix exceed those of its spectral radius for a while.
            if each.bound.hi**ticks < 1e-4 * FALLEN:
                rows.append((key, bool(spread[-1] < FALLEN * spread[0]), f"{spread[-1] / spread[0]:.3g} of the start"))
        elif "it does not fall" in each.reason or "it is not stable" in each.reason:
            moving = np.sqrt((values**2).sum(axis=(1, 2))) if "common motion" in each.reason else spread
            rows.append((key, bool(moving[-1] > 1e-9 * moving[0]), f"{moving[-1] / moving[0]:.3g} of the start"))
    return rows


SHARES = {"energetic": 0.52, "aligning": 0.12, "agreeing": 0.1, "sampled": 0.08, "filtered": 0.1, "obstructed": 0.08}
"""Kinds of scenarios, by the kind of theorem that speaks of them, and their shares."""


def random_scenario(seed: int) -> fk.Scenario:
    """The scenario of a seed."""
    rng = np.random.default_rng([seed, 21])
    return _MAKERS[int(rng.choice(len(SHARES), p=list(SHARES.values())))](rng)


def kind_of(seed: int) -> str:
    """The kind of the scenario of a seed, a key of `SHARES`."""
    return list(SHARES)[int(np.random.default_rng([seed, 21]).choice(len(SHARES), p=list(SHARES.values())))]


def _places(rng: Generator, n: int, m: int, size: float) -> np.ndarray:
    q = rng.uniform(-0.5, 0.5, (n, m)) * size
    way = rng.random()
    if way < 0.1:  # On a line, evenly.
        q[:] = 0.0
        q[:, 0] = np.arange(n) * size / (2 * n)
    elif way < 0.14 and n > 1:
        q[1] = q[0]
    elif way < 0.2 and n > 1:
        q[1] = q[0] + 10.0 ** -rng.uniform(1, 9)
    elif way < 0.25:
        q += 10.0 ** rng.uniform(2, 5)
    return q


def _gain(rng: Generator) -> float:
    way = rng.random()
    if way < 0.08:
        return 0.0
    return float(10 ** rng.uniform(-4, 3)) if way < 0.2 else float(rng.uniform(0.05, 3.0))


POTENTIALS = (
    ("a/r + b*r**2", 1.0), ("a*exp(-r) + b*r**2", 1.0), ("a*log(r**2) + b/r**2", 1.0), ("b*r**2", 1.0),
    ("a*(r - 1)**2*exp(-r)", 1.0), ("where(r < 1, a*(r - 1)**2, b*(r - 1)**2)", 1.0),
    ("-a*exp(-r**2) + b*abs(r - 1)", 1.0),
    ("a/r - b/r**2 + r", 0.2),
)  # fmt: skip
"""Formulas, and the share of the drawn numbers that they take: the last is not bounded from below."""


def _pair_law(rng: Generator, n: int) -> tuple[fk.Graph, list[object]]:
    radius = float(rng.uniform(1.5, 5.0))
    a, b = float(rng.uniform(0.05, 4.0)), float(rng.uniform(0.05, 4.0))
    way = int(rng.integers(7))
    if way == 0:
        barrier = fk.Potential("a/r + b/(R - r)", a=a, b=b, R=radius)
        return fk.Hysteresis(radius, float(rng.uniform(0.01, 0.6) * radius)), [fk.Gradient(barrier)]
    formula, share = POTENTIALS[int(rng.integers(len(POTENTIALS)))]
    drawn = (("a", share * a), ("b", share * b))
    numbers = {name: x for name, x in drawn if f"{name}*" in formula or f"{name}/" in formula}
    gradient = fk.Gradient(fk.Potential(formula, **numbers))
    if way == 1:
        return fk.Hysteresis(radius, float(rng.uniform(0.0, 0.6) * radius)), [gradient]
    if way == 2:
        return fk.Proximity(radius), [gradient]
    if way == 3:
        return fk.Complete(), [gradient]
    if way == 4:
        soft = fk.Potential("a*exp(-r) + b*r**2/4", a=a, b=b)
        return fk.Smooth(radius, float(rng.uniform(0.1, 0.9))), [fk.Gradient(soft)]
    edges = [(i, j) for i in range(n) for j in range(i + 1, n) if rng.random() < 0.7]
    return fk.Fixed(n, tuple(edges)), [gradient]


def _leader(rng: Generator, m: int) -> fk.Leader:
    way = int(rng.integers(4))
    if way == 0:
        return fk.Sink(rng.normal(size=m))
    if way == 1:
        return fk.Velocity(rng.normal(size=m), start=rng.normal(size=m))
    if way == 2:
        return fk.Path([*["cos(t)", "sin(2*t)", "t/2"][:m]])
    return fk.Path([*["where(t < 0.4, 1, 2)", "0", "0"][:m]])


def _energetic(rng: Generator) -> fk.Scenario:
    n, m = int(rng.choice([1, 2, 2, 3, 4, 5, 6])), int(rng.choice([1, 2, 2, 3]))
    graph, terms = _pair_law(rng, n)
    first = rng.random() < 0.15
    q = _places(rng, n, m, float(rng.uniform(1.0, 6.0)))
    p = rng.normal(size=(n, m)) * float(rng.choice([0.0, 0.1, 1.0, 3.0])) + rng.normal(size=m)
    masses = rng.uniform(0.2, 3.0, n) if rng.random() < 0.4 else float(rng.uniform(0.5, 2.0))
    bodies: object
    if first:
        p, bodies = np.zeros((n, m)), fk.SingleIntegrator(masses)
    else:
        if rng.random() < 0.75:
            over = fk.Proximity(2.0) if rng.random() < 0.15 else None
            terms.append(fk.Consensus(_gain(rng), over=over))
        damping = float(rng.uniform(0.0, 2.0)) if rng.random() < 0.2 else 0.0
        if damping and rng.random() < 0.4:
            terms.append(fk.Compensate())
        if rng.random() < 0.35:
            knows = float(rng.integers(2))
            gains = rng.uniform(0, 2, n) if rng.random() < 0.3 else _gain(rng)
            terms.append(fk.Track(_leader(rng, m), gains, _gain(rng), knows, per_mass=bool(rng.random() < 0.3)))
        bodies = fk.PointMass(masses, damping)
        if rng.random() < 0.1:
            bodies = fk.Limited(bodies, force=float(10 ** rng.uniform(0, 2)), speed=float(10 ** rng.uniform(0, 1)))
    world: dict[str, object] = {}
    way = rng.random()
    if way < 0.04 and not first:
        world["control"] = fk.Held(float(rng.uniform(0.02, 0.2)))
    elif way < 0.08:
        world["information"] = fk.Delayed(float(rng.uniform(0.05, 0.5)))
    elif way < 0.1 and not first and isinstance(bodies, fk.PointMass):
        bodies = fk.Disturbed(bodies, 0.5, 0.1)
    begin = float(rng.choice([0.0, 0.0, -3.0, 100.0]))
    end = begin + float(rng.uniform(0.3, 2.5))
    return fk.Scenario(fk.Law(graph, terms), fk.State(q, p, begin), t_end=end, frames=13, bodies=bodies, **world)


def _aligning(rng: Generator) -> fk.Scenario:
    n, m = int(rng.integers(1, 7)), int(rng.integers(1, 4))
    terms: list[object] = [fk.CuckerSmale(_gain(rng) / n, float(rng.uniform(0, 2)), float(10 ** rng.uniform(-1, 1)))]
    if rng.random() < 0.3:
        terms.append(fk.Consensus(float(rng.uniform(0.0, 0.3))))
    p = rng.normal(size=(n, m)) * float(10 ** rng.uniform(-2, 0.5))
    graph = fk.Complete() if rng.random() < 0.6 else fk.Fixed.complete(n)
    start = fk.State(_places(rng, n, m, 3.0), p)
    bodies = fk.PointMass(float(10 ** rng.uniform(-1, 1)))
    return fk.Scenario(fk.Law(graph, terms), start, t_end=float(rng.uniform(0.5, 8)), frames=21, bodies=bodies)


def _consensus_law(rng: Generator, n: int, *, first: bool, moving: bool = False) -> fk.Law:
    graph: fk.Graph = fk.Complete()
    if rng.random() < 0.7:
        graph = fk.Fixed.random_connected(n, 0.6, int(rng.integers(1000)))
    if moving and rng.random() < 0.5:
        radius = float(rng.uniform(0.5, 3.0))
        graph = fk.Proximity(radius) if rng.random() < 0.5 else fk.Hysteresis(radius, 0.3 * radius)
    terms: list[object] = (
        []
        if not first and rng.random() < 0.4
        else [fk.Gradient(fk.Potential("a*r**2/2", a=float(rng.uniform(0.1, 3))))]
    )
    if not first:
        terms.append(fk.Consensus(float(rng.uniform(0.1, 3))))
    return fk.Law(graph, terms)


def _agreeing(rng: Generator) -> fk.Scenario:
    n, m = int(rng.integers(2, 7)), int(rng.integers(1, 3))
    first = bool(rng.random() < 0.5)
    law = _consensus_law(rng, n, first=first, moving=True)
    bodies = fk.SingleIntegrator() if first else fk.PointMass(float(rng.uniform(0.5, 2)))
    p = rng.normal(size=(n, m)) * (not first)
    return fk.Scenario(law, fk.State(_places(rng, n, m, 3.0), p), t_end=4.0, frames=21, bodies=bodies)


def _sampled(rng: Generator) -> fk.Scenario:
    n = int(rng.integers(2, 5))
    first = bool(rng.random() < 0.5)
    law = _consensus_law(rng, n, first=first)
    bodies = fk.SingleIntegrator() if first else fk.PointMass(float(rng.uniform(0.5, 2)))
    start = fk.State(rng.normal(size=(n, 1)), rng.normal(size=(n, 1)) * (not first))
    base = fk.Scenario(law, start, t_end=1.0, bodies=bodies)
    found = fk.certify(base)
    share = float(rng.uniform(0.4, 1.3))
    if rng.random() < 0.3 and found["delay"].bound is not None:
        tau = share * found["delay"].bound.lo
        length = min(120.0 * tau, 60.0)
        return base.with_(t_end=length, frames=3, information=fk.Delayed(tau, self_delayed=bool(rng.random() < 0.7)))
    period = round(share * found["control_period"].bound.lo, 6)
    late = int(rng.integers(0, 3)) if first else 0
    information = fk.Instant() if not late else fk.Messages(period, delay=round(late * period, 9))
    return base.with_(t_end=150 * period, frames=3, control=fk.Held(period), information=information)


def _filtered(rng: Generator) -> fk.Scenario:
    n, m = int(rng.choice([2, 2, 3, 4, 6])), int(rng.integers(1, 4))
    most = rng.uniform(0.5, 5.0, n)
    control = fk.SafetyFilter(
        float(10 ** rng.uniform(-1.7, 0)), distance=0.5, acceleration=most, gain=float(10 ** rng.uniform(-1, 1.5)),
        form=str(rng.choice(["sampled", "stopping", "stopping", "continuous"])),
    )  # fmt: skip
    graph = fk.Fixed.complete(n)
    law = fk.Law(graph, [fk.Gradient(fk.Potential("a*r**2/2", a=float(10 ** rng.uniform(-1, 1.5))))])
    q, p = rng.normal(size=(n, m)) * 2.0 * n ** (1 / m), rng.normal(size=(n, m)) * float(rng.uniform(0, 2))
    return fk.Scenario(
        law, fk.State(q, p), t_end=6.0, frames=5, control=control, bodies=fk.PointMass(rng.uniform(0.5, 2.0, n))
    )


def _obstructed(rng: Generator) -> fk.Scenario:
    n = int(rng.integers(1, 5))
    obstacles = (fk.Ball([0.0, 0.0], float(rng.uniform(0.3, 1.0))), fk.Wall([-4.0, 0.0], [1.0, 0.2]))
    avoid = fk.Avoid(
        obstacles[: int(rng.integers(1, 3))], range=float(rng.uniform(0.8, 1.6)),
        repulsion_gain=float(10 ** rng.uniform(0.5, 2)), damping_gain=float(rng.choice([0.0, 1.0])),
        repulsion=fk.Potential("(r - d)**2/2", d=float(rng.uniform(1.6, 3.0))), gamma_agents=False,
        fading_damping=bool(rng.random() < 0.5),
    )  # fmt: skip
    graph = fk.Proximity(float(rng.uniform(0.5, 3))) if rng.random() < 0.5 else fk.Complete()
    terms: list[object] = [fk.Gradient(fk.Potential("a*r**2/2", a=float(rng.uniform(0.0, 1.0)))), avoid]
    if rng.random() < 0.5:
        terms.append(fk.Consensus(_gain(rng)))
    if rng.random() < 0.4:
        terms.append(fk.Track(fk.Sink([0.3, 0.0]), 0.3, float(rng.uniform(0, 1))))
    angles = rng.uniform(0, 2 * np.pi, n)
    q = np.column_stack([np.cos(angles), np.sin(angles)]) * rng.uniform(1.2, 2.8, n)[:, None]
    p = rng.normal(size=(n, 2)) * float(rng.uniform(0, 3))
    bodies = fk.PointMass(rng.uniform(0.5, 2, n), float(rng.choice([0.0, 0.3])))
    return fk.Scenario(fk.Law(graph, terms), fk.State(q, p), t_end=3.0, frames=41, bodies=bodies)


_MAKERS = (_energetic, _aligning, _agreeing, _sampled, _filtered, _obstructed)


if __name__ == "__main__":
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    begin = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    print(tallied(range(begin, begin + count), report=1000))
