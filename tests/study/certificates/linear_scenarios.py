"""Random scenarios of linear consensus: ideal, held, late, lost, noisy, directed."""

from __future__ import annotations

from numpy.random import Generator

import flocking as fk
from flocking.study.certificates.consensus_certificates import LinearConsensus
from tests.study.certificates.draws import coefficients_of, places_of


def _law(shape: Generator, rng: Generator, n: int, *, first: bool, moving: bool = False) -> fk.Law:
    graph: fk.Graph = fk.Complete()
    if shape.random() < 0.7:
        graph = fk.Fixed.random_connected(n, 0.6, int(rng.integers(1000)))
    if moving and shape.random() < 0.5:
        radius = float(rng.uniform(0.5, 3.0))
        graph = fk.Proximity(radius) if shape.random() < 0.5 else fk.Hysteresis(radius, 0.3 * radius)
    spring = fk.Gradient(fk.Potential("a*r**2/2", a=float(coefficients_of(shape, rng).uniform(0.1, 3))))
    terms: list[object] = [spring] if first or shape.random() < 0.6 else []
    if not first:
        terms.append(fk.Consensus(float(rng.uniform(0.1, 3))))
    return fk.Law(graph, terms)


def _agreeing(shape: Generator, rng: Generator) -> fk.Scenario:
    n, m = int(rng.integers(2, 9)), int(shape.integers(1, 3))
    first = bool(shape.random() < 0.5)
    law = _law(shape, rng, n, first=first, moving=True)
    bodies = fk.SingleIntegrator() if first else fk.PointMass(float(rng.uniform(0.5, 2)))
    p = rng.normal(size=(n, m)) * (not first)
    return fk.Scenario(law, fk.State(places_of(rng, n, m, 3.0), p), t_end=4.0, frames=6, bodies=bodies)


def _base(shape: Generator, rng: Generator, most: int = 5) -> tuple[fk.Scenario, bool]:
    n, first = int(rng.integers(2, most + 1)), bool(shape.random() < 0.5)
    law = _law(shape, rng, n, first=first)
    bodies = fk.SingleIntegrator() if first else fk.PointMass(float(rng.uniform(0.5, 2)))
    start = fk.State(rng.normal(size=(n, 1)), rng.normal(size=(n, 1)) * (not first))
    return fk.Scenario(law, start, t_end=1.0, bodies=bodies), first


def _longest_period(base: fk.Scenario) -> float:
    return float(LinearConsensus(base).period().lo)


def _sampled(shape: Generator, rng: Generator) -> fk.Scenario:
    base, first = _base(shape, rng)
    period = round(float(rng.uniform(0.4, 1.3)) * _longest_period(base), 6)
    late = int(rng.integers(0, 3)) if first else 0
    information = fk.Instant() if not late else fk.Messages(period, delay=round(late * period, 9))
    return base.with_(t_end=100 * period, frames=3, control=fk.Held(period), information=information)


def _delayed(shape: Generator, rng: Generator) -> fk.Scenario:
    base, _ = _base(shape, rng)
    tau = float(rng.uniform(0.3, 1.3)) * float(LinearConsensus(base).delay().lo)
    both = bool(rng.random() < 0.7)
    return base.with_(t_end=40.0 * tau, frames=3, information=fk.Delayed(tau, self_delayed=both))


def _lossy(shape: Generator, rng: Generator) -> fk.Scenario:
    base, first = _base(shape, rng, 4)
    period = round(float(rng.uniform(0.2, 0.9)) * _longest_period(base), 6)
    late = int(rng.integers(0, 2)) if first else 0
    loss = fk.Bernoulli(float(rng.uniform(0.05, 0.6)), paired=bool(rng.random() < 0.4))
    keeps = first and rng.random() < 0.5
    expires = None if keeps else round((late + 1) * period, 9)
    world = fk.Messages(
        period, delay=round(late * period, 9), loss=loss, expires=expires, seed=int(rng.integers(2**31))
    )  # fmt: skip
    return base.with_(t_end=30 * period, frames=3, control=fk.Held(period), information=world)


def _noisy(shape: Generator, rng: Generator) -> fk.Scenario:
    base, first = _base(shape, rng)
    period = round(float(rng.uniform(0.2, 0.7)) * _longest_period(base), 6)
    noise = fk.WhiteNoise(float(rng.uniform(0.01, 0.2)), float(rng.uniform(0.01, 0.2)))
    late = int(rng.integers(0, 2)) if first else 0
    known = str(rng.choice(["true", "measured"]))
    world = fk.Messages(
        period, delay=round(late * period, 9), noise=noise, self_known=known, seed=int(rng.integers(2**31))
    )  # fmt: skip
    return base.with_(t_end=400 * period, frames=401, control=fk.Held(period), information=world)


def _directed(shape: Generator, rng: Generator) -> fk.Scenario:
    n, first = int(rng.integers(2, 8)), bool(shape.random() < 0.5)
    # A spanning tree from agent 0, and some links more.
    edges = {(k, int(rng.integers(k))) for k in range(1, n)}
    edges |= {(i, j) for i in range(n) for j in range(n) if i != j and rng.random() < 0.3 * rng.random()}
    terms: list[object] = [fk.Gradient(fk.Potential("a*r**2/2", a=float(rng.uniform(0.1, 2))))]
    if not first:
        terms.append(fk.Consensus(float(rng.uniform(0.3, 3))))
    bodies = fk.SingleIntegrator() if first else fk.PointMass(float(rng.uniform(0.5, 2)))
    start = fk.State(rng.normal(size=(n, 1)), rng.normal(size=(n, 1)) * (not first))
    law = fk.Law(fk.Fixed(n, tuple(sorted(edges)), directed=True), terms)
    base = fk.Scenario(law, start, t_end=6.0, frames=3, bodies=bodies)
    way, found = shape.random(), fk.certify(base)
    period, delay = (found[key].bound for key in ("directed_period", "directed_delay"))
    if way < 0.5 and period is not None:
        held = round(float(rng.uniform(0.4, 1.4)) * period.lo, 6)
        return base.with_(t_end=150 * held, control=fk.Held(held))
    if way < 0.6 and delay is not None:
        tau = float(rng.uniform(0.3, 1.4)) * delay.lo
        return base.with_(t_end=40 * tau, information=fk.Delayed(tau, self_delayed=True))
    if way < 0.8 and period is not None:
        held = round(float(rng.uniform(0.2, 0.9)) * period.lo, 6)
        loss = fk.Bernoulli(float(rng.uniform(0.05, 0.6)))
        world = fk.Messages(held, loss=loss, expires=held, seed=int(rng.integers(2**31)))
        return base.with_(t_end=30 * held, control=fk.Held(held), information=world)
    return base


MAKERS = {
    "agreeing": _agreeing, "sampled": _sampled, "delayed": _delayed, "lossy": _lossy, "noisy": _noisy,
    "directed": _directed,
}  # fmt: skip
"""Kinds of scenarios of linear consensus."""
