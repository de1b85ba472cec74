"""The transition of large groups, as later work found it: a study of long runs, with stored results.

Vectorial noise, forward update, speed 0.5 and density 2 (Gregoire, Chate 2004; Chate, Ginelli, Gregoire, Raynaud 2008).
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np

from flocking.errors import InvalidInput
from flocking.model.checks import Array, integer, number
from flocking.model.parts.seeds import seeded
from flocking.papers.vicsek_1995 import system
from flocking.papers.vicsek_1995.closed_forms import binder_cumulant
from flocking.papers.vicsek_1995.density_waves import Waves, waves_of
from flocking.papers.vicsek_1995.large_groups import HeadingGroup
from flocking.study.confidence_intervals import Interval, mean_interval

FILE = "transition.json"
"""Results of the stored study."""

SETTLING = 0.2
"""Share of a run before values are taken."""

BINS = 40
"""Bins of a histogram of the order parameter over [0, 1]."""

LOW, HIGH = 0.2, 0.4
"""Values of v_a below and above which a group of the study counts as disordered and as ordered."""

SIZES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32)
"""Sides of the boxes in which agents are counted."""

FITTED = (4.0, 130.0)
"""Mean numbers in a box between which the exponent of the fluctuations is fitted: larger boxes feel the torus."""

PARTS = 20
"""Parts of a run from which the interval of the cumulant is taken."""

FEWEST_RUNS = 5
"""Fewest runs of one setting that are drawn anew for the interval of their cumulant."""

DRAWS = 4000
"""Number of such draws: the ends of the interval change by about a hundredth with their seed."""

BLOCKS = 10
"""Blocks of snapshots from which the interval of the exponent is taken."""


@dataclass(frozen=True)
class Point:
    """Values of the order parameter at one noise.

    Parameters
    ----------
    side, noise, updates, seed
        L, eta, number of updates, and seed.
    mean, cumulant
        Mean of v_a and its cumulant G, see `closed_forms.binder_cumulant`.
    histogram
        Share of the values in each of `BINS` bins over [0, 1].
    passages
        How often v_a went from below `LOW` to above `HIGH`, or back.
    moments
        Means of v_a^2 and v_a^4 over each of `PARTS` equal parts of the run, shape (parts, 2); none in old studies.
    noise_kind
        ``"vectorial"`` or ``"angular"``.
    """

    side: float
    noise: float
    updates: int
    seed: int
    mean: float
    cumulant: float
    histogram: tuple[float, ...]
    passages: int
    moments: tuple[tuple[float, float], ...] = ()
    noise_kind: str = "vectorial"

    @property
    def shares(self) -> tuple[float, float]:
        """Shares of the values below `LOW`, and above `HIGH`."""
        edges = np.linspace(0.0, 1.0, BINS + 1)
        shares = np.asarray(self.histogram)
        return float(shares[edges[1:] <= LOW + 1e-9].sum()), float(shares[edges[:-1] >= HIGH - 1e-9].sum())


@dataclass(frozen=True)
class Fluctuations:
    """Numbers of agents in boxes of an ordered group.

    Parameters
    ----------
    side, noise, updates, seed
        L, eta, number of updates, and seed.
    means
        Mean number in a box of each of `SIZES`.
    deviations
        Standard deviation of the number, for each of `BLOCKS` blocks of snapshots, shape (blocks, sizes).
    """

    side: float
    noise: float
    updates: int
    seed: int
    means: tuple[float, ...]
    deviations: tuple[tuple[float, ...], ...]

    @property
    def exponent(self) -> tuple[float, Interval]:
        """Exponent of the deviation in the mean number, fitted by least squares of logarithms, with its 95 % interval.

        Blocks are taken as independent. The interval does not include a bend of the curve.
        """
        x = np.log(np.asarray(self.means))
        chosen = (x >= np.log(FITTED[0])) & (x <= np.log(FITTED[1]))
        slopes = np.array([np.polyfit(x[chosen], np.log(np.asarray(row))[chosen], 1)[0] for row in self.deviations])
        return float(slopes.mean()), mean_interval(slopes)


@seeded
def measured_waves(side: float, noise: float, updates: int, seed: int = 0, noise_kind: str = "vectorial") -> Waves:
    """The strongest wave after some updates of a large group from random headings.

    Parameters
    ----------
    side, noise, updates, seed, noise_kind
        As of `Point`.
    """
    group = _group(side, noise, seed, noise_kind)
    group.update(updates)
    wave, strength, across, order, profile, local = waves_of(*group.state(), side)
    group.close()
    return Waves(side, noise, updates, seed, noise_kind, wave, strength, across, order, tuple(profile.tolist()),
                 tuple(local.tolist()))  # fmt: skip


def _group(side: float, noise: float, seed: int, noise_kind: str = "vectorial") -> HeadingGroup:
    agents = round(system.LATER_DENSITY * side**2)
    return HeadingGroup(system.group(
        agents, side, noise, seed=seed, duration=1, speed=system.LATER_SPEED, noise_kind=noise_kind, update="forward",
    ))  # fmt: skip


@seeded
def order_values(side: float, noise: float, updates: int, seed: int = 0, noise_kind: str = "vectorial") -> Array:
    """V_a after each of the first updates of a large group, shape (updates,).

    Parameters
    ----------
    side, noise, updates, seed, noise_kind
        L, eta, number of updates, seed of the start and of the noise, by name also ``rng``, and kind of the noise.
    """
    count = integer("order_values", "updates", updates, least=1)
    group = _group(number("order_values", "side", side, above=0.0), noise, seed, noise_kind)
    found = np.empty(count)
    for k in range(count):
        group.update()
        found[k] = group.order
    group.close()
    return found


@seeded
def point_of(side: float, noise: float, seed: int, values: Array, noise_kind: str = "vectorial") -> Point:
    """What is stored of a series of the order parameter.

    Parameters
    ----------
    side, noise, seed
        L, eta and seed.
    values
        V_a after each update, shape (updates,).
    noise_kind
        Kind of the noise.
    """
    late = np.asarray(values, dtype=np.float64)[int(SETTLING * len(values)) :]
    histogram = np.histogram(late, np.linspace(0.0, 1.0, BINS + 1))[0] / len(late)
    phase = np.where(late > HIGH, 1, np.where(late < LOW, -1, 0))
    known = phase[phase != 0]
    moments = tuple((float((part**2).mean()), float((part**4).mean())) for part in np.array_split(late, PARTS))
    return Point(
        side, noise, len(values), seed, float(late.mean()), binder_cumulant(late), tuple(float(x) for x in histogram),
        int(np.count_nonzero(np.diff(known))), moments, noise_kind,
    )  # fmt: skip


def counted(q: Array, side: float, sizes: Sequence[float] = SIZES) -> list[tuple[float, float]]:
    """Mean, and mean square, of the number of agents in boxes of each size.

    Parameters
    ----------
    q
        Positions in the box of the torus, shape (N, 2).
    side
        L; boxes that do not fit a whole number of times leave a strip out.
    sizes
        Sides of the boxes.
    """
    found = []
    for size in sizes:
        along = int(side // size)
        place = (np.asarray(q) / size).astype(np.int64)
        inside = (place < along).all(axis=1)
        numbers = np.bincount(place[inside, 0] * along + place[inside, 1], minlength=along**2).astype(np.float64)
        found.append((float(numbers.mean()), float((numbers**2).mean())))
    return found


@seeded
def fluctuations_of(side: float, noise: float, seed: int, updates: int, rows: Array) -> Fluctuations:
    """What is stored of counts.

    Parameters
    ----------
    side, noise, seed, updates
        L, eta, seed and number of updates.
    rows
        Of every snapshot what `counted` gives, shape (snapshots, sizes, 2); a multiple of `BLOCKS` of them.
    """
    blocks = np.asarray(rows).reshape(BLOCKS, -1, len(SIZES), 2).mean(axis=1)
    means = blocks[:, :, 0].mean(axis=0)
    deviations = np.sqrt(blocks[:, :, 1] - blocks[:, :, 0] ** 2)
    return Fluctuations(
        side, noise, updates, seed, tuple(float(x) for x in means),
        tuple(tuple(float(x) for x in row) for row in deviations),
    )  # fmt: skip


@seeded
def measured_fluctuations(
    side: float, noise: float, *, settling: int = 1200, snapshots: int = 100, apart: int = 30, seed: int = 7
) -> Fluctuations:  # fmt: skip
    """Fluctuations of an ordered group.

    Parameters
    ----------
    side, noise
        L and eta.
    settling, snapshots, apart
        Updates before the first snapshot, number of snapshots, a multiple of `BLOCKS`, and updates between two.
    seed
        Seed of the start and of the noise; by name also ``rng``.
    """
    group = _group(side, noise, seed)
    group.update(settling)
    rows = []
    for _ in range(snapshots):
        group.update(apart)
        rows.append(counted(group.state()[0], side))
    group.close()
    return fluctuations_of(side, noise, seed, settling + snapshots * apart, np.array(rows))


@dataclass(frozen=True)
class Study:
    """The stored study.

    Parameters
    ----------
    points
        Order parameters at several noises and sides.
    fluctuations
        Fluctuations in an ordered group.
    waves
        Waves of the density at the end of some runs.
    """

    points: tuple[Point, ...]
    fluctuations: Fluctuations
    waves: tuple[Waves, ...] = ()

    def at(self, side: float, noise_kind: str = "vectorial") -> tuple[Point, ...]:
        """Points of one side and kind of noise, by the noise.

        Parameters
        ----------
        side, noise_kind
            L, and the kind.
        """
        found = (p for p in self.points if p.side == side and p.noise_kind == noise_kind)
        return tuple(sorted(found, key=lambda p: p.noise))

    def sides(self, noise_kind: str = "vectorial") -> tuple[float, ...]:
        """Sides of which there are points, in order.

        Parameters
        ----------
        noise_kind
            The kind of noise.
        """
        return tuple(sorted({p.side for p in self.points if p.noise_kind == noise_kind}))

    def text(self) -> str:
        """The study as JSON."""
        return json.dumps(asdict(self))


@lru_cache(maxsize=1)
def stored_study() -> Study:
    """The study that comes with the package."""
    data = json.loads(files("flocking.papers.vicsek_1995").joinpath(FILE).read_text(encoding="utf-8"))
    points = tuple(
        Point(**{**row, "histogram": tuple(row["histogram"]), "moments": tuple(map(tuple, row.get("moments", ())))})
        for row in data["points"]
    )
    waves = tuple(
        Waves(**{**row, **{name: tuple(row[name]) for name in ("wave", "profile", "local")}})
        for row in data.get("waves", ())
    )
    kept = data["fluctuations"]
    deviations = tuple(tuple(row) for row in kept["deviations"])
    return Study(points, Fluctuations(**{**kept, "means": tuple(kept["means"]), "deviations": deviations}), waves)


def pooled_cumulant(points: Sequence[Point]) -> tuple[float, Interval]:
    """The cumulant of several runs together, with its 95 % interval.

    The interval is that of the jackknife over the parts of the runs, which takes parts as independent; from
    `FEWEST_RUNS` runs on the wider ends of that and of a bootstrap, which draws runs and then parts of each, so that
    what a run does not visit counts. Where a run passes between the phases seldom, that of a few runs is too narrow.

    Parameters
    ----------
    points
        Runs of one side, noise and kind of noise, with stored moments.

    Raises
    ------
    InvalidInput
        When there are none, or they are of different settings.
    """
    rows = np.array([row for point in points for row in point.moments])
    if not len(rows) or len({(p.side, p.noise, p.noise_kind) for p in points}) != 1:
        raise InvalidInput(
            "pooled_cumulant", "points", "must be runs of one side and noise with stored moments", len(points)
        )

    def cumulant(chosen: Array) -> float:
        second, fourth = chosen.mean(axis=0)
        return float(1.0 - fourth / (3.0 * second**2))

    of_all, count = cumulant(rows), len(rows)
    left = np.array([cumulant(np.delete(rows, k, axis=0)) for k in range(count)])
    found = mean_interval(count * of_all - (count - 1) * left)
    if len(points) < FEWEST_RUNS:
        return of_all, found
    rng, runs = np.random.default_rng(0), [np.array(point.moments) for point in points]
    drawn = [
        cumulant(np.concatenate([each[rng.integers(0, len(each), len(each))] for each in (
            runs[k] for k in rng.integers(0, len(runs), len(runs))
        )]))
        for _ in range(DRAWS)
    ]  # fmt: skip
    low, high = np.quantile(drawn, [0.025, 0.975])
    return of_all, Interval(
        min(found.low, float(low)), max(found.high, float(high)), "wider of a jackknife and a bootstrap over runs"
    )


HISTOGRAMS = 24.0
"""Side of the groups whose histograms are drawn beside the one of the lowest cumulant."""


def shown_histograms(study: Study) -> tuple[Point, ...]:
    """The point of the lowest cumulant, and of one side those beside the largest fall of the mean.

    Parameters
    ----------
    study
        The study.
    """
    points = study.at(HISTOGRAMS)
    fall = int(np.argmin(np.diff([p.mean for p in points])))
    return (lowest(study), *points[max(fall - 1, 0) : fall + 2])


def lowest(study: Study) -> Point:
    """The point of the lowest cumulant.

    Parameters
    ----------
    study
        The study.
    """
    return min(study.points, key=lambda p: p.cumulant)


def strongest(study: Study, noise_kind: str) -> Waves:
    """The stored wave of the largest strength of a kind of noise.

    Parameters
    ----------
    study, noise_kind
        The study, and the kind.
    """
    return max((wave for wave in study.waves if wave.noise_kind == noise_kind), key=lambda wave: wave.strength)
