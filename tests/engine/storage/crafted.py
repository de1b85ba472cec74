"""Checkpoints as somebody else might write them: one thing changed, everything else as it was."""

from __future__ import annotations

import copy
import io
import json
from functools import cache
from typing import Any

import numpy as np

import flocking as fk
from flocking.engine.archives.archive import read_archive, write_archive
from flocking.engine.driver.checkpoint import pack
from flocking.engine.lammps.options import LammpsOptions
from flocking.engine.lammps.restart import Restart, packed_restart
from flocking.engine.tiles.session import TilesOptions, TilesSession
from tests.engine.tiles.laws import zhou

NUMBERS = (
    None,
    True,
    "x",
    -1,
    0,
    1,
    10**6,
    2**31,
    2**63,
    10**400,
    -(10**12),
    1e308,
    float("nan"),
    float("inf"),
    [],
    {},
)
"""What a number may be changed to."""


ENGINES = {
    "exact": "exact",
    "periodic": "exact",
    "lagged": "exact",
    "quadrotor": "exact",
    "sampled": "sampled",
    "bodies": "sampled",
    "mixture": "sampled",
    "periodic held": "sampled",
    "held quadrotor": "sampled",
    "held views": "sampled",
    "delayed": "delayed",
    "messages": "delayed",
    "discrete": "discrete",
    "heading": "discrete",
    "tiles": "tiles",
    "held tiles": "tiles",
    "limited tiles": "tiles",
    "lammps": "lammps",
}
"""Groups whose checkpoints are changed, each with the engine that wrote it."""


@cache
def scenario(engine: str) -> fk.Scenario:
    """A group under a law with memory of links, which the tiled engine runs too."""
    if engine == "tiles":
        return fk.Scenario(
            zhou(1.2, 0.1), fk.start.hexagonal(40, spacing=0.9, noise=0.02, speed=0.5, seed=2), t_end=0.5
        )
    if engine == "sampled":
        return fk.Scenario(
            fk.Law(fk.Hysteresis(4.0, 0.3), [fk.Gradient(fk.Potential("(r - 3)^2")), fk.Consensus(1.0)]),
            fk.start.hexagonal(8, spacing=3.6, noise=0.2, speed=4.0, seed=29), t_end=0.5, frames=6,
            agents=fk.PointMass(damping=0.5), control=fk.Held(np.linspace(0.02, 0.03, 8), latency=0.04),
            information=fk.Messages(
                0.02, delay=0.05, jitter=0.01, loss=fk.DistanceLoss(6.0), noise=fk.OrnsteinUhlenbeck(0.01, 0.01),
                predict=True, seed=5,
            ),
        )  # fmt: skip
    if engine == "bodies":
        robots = fk.Disturbed(fk.Lagged(fk.Disturbed(fk.Unicycle(0.3, damping=0.5), 0.5, 0.03), 0.1), 0.2, 0.07, 3)
        avoid = fk.Avoid([fk.Ball([3.0, 2.0], 0.5)], range=2.5, gamma_agents=False, repulsion_gain=1.0)
        law = scenario("sampled").law
        return scenario("sampled").with_(
            agents=fk.Limited(robots, force=20.0, rate=200.0), law=fk.Law(law.graph, [*law.terms, avoid])
        )
    if engine == "held tiles":
        heard = fk.Messages(0.05, delay=0.03, jitter=0.01, loss=0.2, predict=True, expires=0.5, seed=3)
        return scenario("tiles").with_(control=fk.Held(0.02, latency=0.03), information=heard)
    if engine == "delayed":
        return scenario("sampled").with_(control=fk.Continuous(), information=fk.Delayed(0.06))
    if engine == "messages":
        return scenario("sampled").with_(control=fk.Continuous())
    if engine == "discrete":
        return fk.Scenario(
            fk.Law(fk.Hysteresis(4.0, 0.3), [fk.Gradient(fk.Potential("(r - 3)^2")), fk.Consensus(1.0)]),
            fk.start.hexagonal(8, spacing=3.6, noise=0.2, speed=4.0, seed=29), t_end=0.5, frames=6,
            agents=fk.Impulsive(damping=0.5, speed=8.0), control=fk.Held(np.linspace(0.02, 0.03, 8)),
        )  # fmt: skip
    if engine == "mixture":
        kinds = (fk.Limited(fk.PointMass(damping=0.5), force=20.0), fk.Disturbed(fk.Unicycle(0.3), 0.5, 0.03))
        return scenario("sampled").with_(agents=fk.Mixture(kinds, np.arange(8) % 2))
    if engine == "periodic held":
        return scenario("sampled").with_(space=fk.Periodic([14.0, 14.0]))
    if engine == "held views":
        headings, sampled = np.linspace(-3.0, 3.0, 8), scenario("sampled")
        law = fk.Law(fk.FieldOfView(4.0, 1.5), sampled.law.terms)
        return sampled.with_(law=law, agents=fk.PointMass(damping=0.5, headings=headings))
    if engine == "heading":
        torus = fk.Law(fk.Proximity(1.0), [fk.VelocityAverage(0.02)])
        begin = fk.start.box(8, side=3.0, speed=0.5, velocities="sphere", seed=3)
        return fk.Scenario(
            torus, begin, t_end=0.5, frames=6, agents=fk.Heading(0.5, 1.0, seed=4), control=fk.Held(0.02),
            space=fk.Periodic([3.0, 3.0]),
        )  # fmt: skip
    if engine == "limited tiles":
        return scenario("tiles").with_(agents=fk.Limited(fk.Lagged(fk.PointMass(), 0.1), force=20.0))
    if engine == "quadrotor":
        begin = fk.start.box(4, side=4.0, dimension=3, speed=0.3, seed=2)
        law = fk.Law(fk.Proximity(6.0), [fk.Gradient(fk.Potential("(r - 3)**2")), fk.Consensus(1.0)])
        return fk.Scenario(law, begin, t_end=0.5, frames=6, agents=fk.Quadrotor())
    if engine == "held quadrotor":
        heard = fk.Messages(0.02, delay=0.05, jitter=0.01, loss=0.2, seed=5)
        return scenario("quadrotor").with_(control=fk.Held(0.02, latency=0.03), information=heard)
    begin = fk.start.hexagonal(8, spacing=3.6, noise=0.2, speed=1.0, seed=5)
    made = fk.Scenario(zhou(), begin, t_end=0.5, frames=6)
    if engine == "periodic":
        return made.with_(space=fk.Periodic([14.0, 14.0]))
    if engine == "lagged":  # its potential has no pole, which a force that lags could not keep agents from
        return made.with_(
            law=scenario("sampled").law,
            agents=fk.Limited(fk.Lagged(fk.PointMass(), 0.1), force=20.0),
        )
    return made


@cache
def records(engine: str) -> fk.Run:
    """What that group had recorded by then."""
    session = _begun(engine)
    if ENGINES[engine] in ("sampled", "delayed", "discrete") or engine == "held tiles":
        session.advance(0.25)
    return session.run("unfinished")


def _begun(engine: str) -> Any:
    options = {"engine": "tiles", "threads": 1} if ENGINES[engine] == "tiles" and engine != "tiles" else {}
    return fk.start(scenario(engine), **options)  # type: ignore[arg-type]


@cache
def checkpoint(engine: str) -> bytes:
    """A checkpoint of that group, half way."""
    if engine == "lammps":
        agents = np.random.default_rng(1).random((8, 9))
        numbers, arrays = packed_restart(Restart(agents, 0.25, 25, (0.2, 0.3, 10, 5)), LammpsOptions(step=0.01))
        return written({"engine": "lammps", **numbers}, arrays)
    if engine in ("tiles", "limited tiles"):
        session: Any = TilesSession(scenario(engine), TilesOptions(step=0.001, threads=1, observe=True))
    else:
        session = _begun(engine)
    session.advance(0.25)
    if engine == "exact":
        session._links.sliding = {**session._links.sliding, (0, 3, 4): (0.2, 0.25, 3)}
    return pack(session)


def contents(data: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    """Numbers and arrays of a checkpoint."""
    return read_archive(data)


def written(numbers: dict[str, Any], arrays: dict[str, Any]) -> bytes:
    """A checkpoint of these."""
    file = io.BytesIO()
    write_archive(file, numbers, arrays)
    return file.getvalue()


def places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to all values in plain data."""
    found = [path] if path else []
    if isinstance(value, dict | list):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        for key, x in pairs:
            found += places(x, (*path, key))
    return found


def reshaped(x: Any, rng: np.random.Generator) -> Any:
    """The same numbers, or about so many, in another shape."""
    longer = [*x.shape]
    if longer:
        axis = int(rng.integers(len(longer)))
        longer[axis] = int(rng.choice([0, 1, longer[axis] + 1, max(0, longer[axis] - 1), 5 * longer[axis] + 3]))
    return [x[None], np.resize(x, longer), x.reshape(-1), np.zeros((), x.dtype)][int(rng.integers(4))]


def retyped(x: Any, rng: np.random.Generator) -> Any:
    """The same numbers as another type."""
    kinds = ["c16", "f4", ">f8", "f2", "i1", "u8", "?", "i4", "u4", "S3", "U2", "i8,f8"]
    kind = np.dtype(str(rng.choice(kinds)))
    return np.zeros(x.shape, kind) if kind.names or kind.kind in "SU" else x.astype(kind)


def revalued(x: Any, rng: np.random.Generator) -> Any:
    """An array with some values that nobody would have written."""
    x = x.copy()
    bad = {
        "f": [np.nan, np.inf, -np.inf, 1e308, -1e300, -1.0, 0.0],
        "i": [-1, -(2**31), 2**31 - 1, 10**6, 41, 8],
        "u": [2**32 - 1, 2**31, 2**31 - 1, 41, 200],
        "b": [True, False],
    }[x.dtype.kind]
    with np.errstate(all="ignore"):
        value = np.array(bad[int(rng.integers(len(bad)))]).astype(x.dtype)
    if x.size:
        x.reshape(-1)[rng.integers(x.size, size=int(rng.choice([1, 3, x.size])))] = value
    return x


def crafted(engine: str, seed: int) -> tuple[bytes, str]:
    """A checkpoint of an engine with one thing changed, and what."""
    return changed(checkpoint(engine), seed)


def changed(data: bytes, seed: int) -> tuple[bytes, str]:
    """A checkpoint with one thing changed, and what."""
    rng = np.random.default_rng(seed)
    numbers, arrays = copy.deepcopy(contents(data))
    if rng.random() < 0.35:
        spots = places(numbers)
        path = spots[int(rng.integers(len(spots)))]
        owner = numbers
        for key in path[:-1]:
            owner = owner[key]
        owner[path[-1]] = NUMBERS[int(rng.integers(len(NUMBERS)))]
        what = f"{path} = {owner[path[-1]]!r:.40}"
    else:
        names = sorted(arrays)
        name = names[int(rng.integers(len(names)))]
        how = [reshaped, retyped, revalued][int(rng.integers(3))]
        arrays[name] = how(arrays[name], rng)
        what = f"{name} {how.__name__} {arrays[name].dtype} {arrays[name].shape}"
        if rng.random() < 0.05:
            del arrays[name]
            what = f"{name} left out"
    file = io.BytesIO()
    np.savez(file, numbers=np.frombuffer(json.dumps(numbers).encode(), np.uint8), **arrays)
    return file.getvalue(), what
