"""The search for margins: a grid from the ideal world outwards, then bisection of every first failure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from flocking.engine.driver.simulate import start
from flocking.engine.interruption import interrupted
from flocking.errors import FlockingError, InvalidInput
from flocking.model.checks import integer, number
from flocking.model.law import Scenario
from flocking.study.claims.audit import check_claims
from flocking.study.claims.claim import Claim
from flocking.study.confidence_intervals import check_level
from flocking.study.margins.brackets import STEP_TO_IDEAL, Count, between, bracket, open_everywhere, open_from_ideal
from flocking.study.margins.computed_runs import HYPOTHESIS, Conclusions
from flocking.study.margins.fingerprints import fingerprint, has_foreign_parts
from flocking.study.margins.margin_table import Margins, Varied, counts_of
from flocking.study.margins.quantities import Quantity, base_period, checked_levels, default_levels, quantity_named
from flocking.study.margins.worlds import IDEAL, Worlds, world_in_words
from flocking.study.sweeps.recorded_content import digest_of

ROUNDED = 1.0 - 1e-3
"""Factor for the rounding of levels, which are powers of STEP_TO_IDEAL apart."""

MOST_RUNS = 4000
"""Most runs of a table, unless another number is given."""

MOST_ROUNDS = 12
"""Rounds of bisection at most: the width of a bracket falls by a factor of a thousand in ten."""

STEPS_TO_IDEAL = 3
"""Levels that are tried between the ideal world and the first level of a grid where a conclusion is refuted there, the
last 64 times nearer: one that nothing but the ideal world keeps would be sought without end.
"""

Verdicts = dict[str, str]


def reason_of(error: Exception) -> str:
    """Why something was refused, in words.

    Parameters
    ----------
    error
        What was raised.

    Raises
    ------
    KeyboardInterrupt
        When it is an interruption.
    """
    if interrupted(error):
        raise KeyboardInterrupt from error
    return str(error) if isinstance(error, FlockingError) else f"{type(error).__name__}: {error}"


class Search:
    """Runs made so far, and the levels that are tried next.

    Parameters
    ----------
    worlds
        Makes the scenarios.
    claims
        Claims whose conclusions are read from every run.
    seeds
        The seeds.
    share, width
        As `find_margins` takes them.
    most_runs
        Largest number of runs.
    sweep
        Makes runs: takes names of worlds, digests of their scenarios by seed, and the name of a folder; gives verdicts
        by world and seed, and whether all were made.
    """

    def __init__(
        self, worlds: Worlds, claims: Sequence[Claim], seeds: Sequence[int], share: float, width: float,
        most_runs: int,
        sweep: Callable[[Sequence[str], Mapping[int, str], str], tuple[dict[tuple[str, int], Verdicts], bool]],
    ) -> None:  # fmt: skip
        self._worlds, self._claims, self._seeds = worlds, claims, tuple(seeds)
        self._share, self._width, self._most, self._sweep = share, width, most_runs, sweep
        self.levels: dict[str, set[float]] = {name: set() for name in worlds.quantities}
        self.found: dict[str, dict[int, Verdicts]] = {}
        self.runs, self.status = 0, "finished"
        self.refused: dict[str, dict[float, str]] = {name: {} for name in worlds.quantities}
        """Levels by quantity at which some scenario cannot be made, with the reason."""
        self._prints: dict[tuple[str, int], str] = {}
        self._foreign = has_foreign_parts(worlds(world=IDEAL, seed=self._seeds[0]))
        self._first: dict[str, float] = {}

    def run(self, grids: Mapping[str, Sequence[float]]) -> None:
        """Make the runs of the grids, then bisect."""
        requested = {name: list(grid) for name, grid in grids.items()}
        for name, grid in grids.items():
            inner = [level for level in grid if level > 0.0] or [0.0]
            self._first[name] = max(inner) if self._worlds.quantities[name].falling else min(inner)
        for turn in range(MOST_ROUNDS + 1):
            names = [IDEAL] if turn == 0 else []
            for world in names:
                self._print(world)
            possible = {name: [x for x in levels if self._can(name, x)] for name, levels in requested.items()}
            names += [f"{name}={level!r}" for name, levels in possible.items() for level in levels]
            if not any((names, *requested.values())) or not self._make(names, turn):
                return
            for name, levels in possible.items():
                self.levels[name] |= set(levels)
            requested = self._next()
        if any(requested.values()):
            self.status = f"{MOST_ROUNDS} rounds of bisection did not suffice"

    def _make(self, names: Sequence[str], turn: int) -> bool:
        groups: dict[tuple[int, ...], list[str]] = {}
        for name in names:
            groups.setdefault(self._different(name), []).append(name)
        size = sum(len(seeds) * len(found) for seeds, found in groups.items())
        if not turn and size > self._most:
            rule = f"must be at least {size}, the runs of the ideal world and of the first levels"
            raise InvalidInput("margins", "most_runs", rule, self._most, "Allow more, or name fewer levels or seeds.")
        if self.runs + size > self._most:
            self.status = f"{self._most} runs did not suffice"
            return False
        for part, (seeds, group) in enumerate(groups.items()):
            # All seeds, not only those that are run: a run may stand for the equal scenarios of others.
            digests = {s: digest_of(" ".join(self._prints[world, s] for world in group)) for s in self._seeds}
            made, complete = self._sweep(group, {s: digests[s] for s in seeds}, f"{turn:02d}-{part}")
            for (world, seed), verdicts in made.items():
                self.found.setdefault(world, {})[seed] = verdicts
            self.runs += len(made)
            if not complete:
                self.status = "interrupted"
                return False
        return True

    def _print(self, world: str) -> None:
        """Note the fingerprints of the scenarios of a world, one for each seed."""
        for seed in self._seeds:
            if (world, seed) not in self._prints:
                self._prints[world, seed] = fingerprint(self._worlds(world=world, seed=seed))

    def _can(self, name: str, level: float) -> bool:
        """Whether the scenarios of a level can be made; if not, the reason is noted and the other levels go on."""
        try:
            self._print(f"{name}={level!r}")
        except Exception as error:
            self.refused[name][level] = reason_of(error)
            return False
        return True

    def _different(self, world: str) -> tuple[int, ...]:
        """The first seed of each different scenario: runs without anything random are made once."""
        seen: dict[str, int] = {}
        for seed in self._seeds:
            own = f" {seed}" if self._foreign else ""
            seen.setdefault(self._prints[world, seed] + own, seed)
        return tuple(seen.values())

    def _next(self) -> dict[str, list[float]]:
        requested: dict[str, list[float]] = {}
        for name, quantity in self._worlds.quantities.items():
            new: dict[float, None] = {}
            for key, count in self.ideal.items():
                if not count.shown(self._share):
                    continue
                counts = self.counts(name)[key]
                where = bracket(counts, self._share, falling=quantity.falling)
                # Runs between levels that leave it open would leave it open too.
                if open_everywhere(counts) or open_from_ideal(counts, where):
                    continue
                if not where.lower and self._is_near(where.upper, quantity, name):
                    continue
                if where.width > self._width:
                    level = between(where, falling=quantity.falling)
                    if where.lower is None and self._base_is_unknown(quantity, name):
                        level = quantity.unvaried
                    level = None if level is None else quantity.resolved(level)
                    if level is not None and level not in self.levels[name] and level not in self.refused[name]:
                        new[level] = None
            if new:
                requested[name] = sorted(new)
        return requested

    def _base_is_unknown(self, quantity: Quantity, name: str) -> bool:
        """Whether the base world, in which nothing of the quantity is varied, can be tried and was not."""
        base = quantity.unvaried
        return base is not None and base not in self.levels[name] and base not in self.refused[name]

    def base_in_words(self, name: str) -> str:
        """The base world of a quantity in words, where runs were made there; else empty."""
        base = self._worlds.quantities[name].unvaried
        if base is None or base not in self.levels[name]:
            return ""
        return world_in_words(self._worlds(world=f"{name}={base!r}", seed=self._seeds[0]))

    def _is_near(self, level: float | None, quantity: Quantity, name: str) -> bool:
        """Whether a level is as near to the ideal world as is looked."""
        first, most = self._first[name], STEP_TO_IDEAL**STEPS_TO_IDEAL * ROUNDED
        if level is None or first == 0.0:
            return False
        return level >= first * most if quantity.falling else level * most <= first

    @property
    def ideal(self) -> dict[str, Count]:
        """Counts in the ideal world, of the runs that meet the hypotheses."""
        return {key: self._count(IDEAL, key) for key in self._keys}

    @property
    def _keys(self) -> list[str]:
        """Conclusions that apply to some ideal run."""
        ideal = self.found.get(IDEAL, {})
        applies = [c.key for c in self._claims]
        return [key for key in applies if any(self._meets(seed, key) for seed in ideal)]

    def _meets(self, seed: int, key: str) -> bool:
        ideal = self.found.get(IDEAL, {})
        # Of seeds whose scenarios are equal one was run.
        same = (run for run in ideal if self._prints[IDEAL, run] == self._prints[IDEAL, seed])
        verdicts = ideal.get(seed if seed in ideal else next(same, seed), {})
        # A run that failed has no verdicts: it counts as open. A hypothesis that is left open is not met.
        return verdicts.get(key + HYPOTHESIS, "") in ("holds", "")

    def _count(self, world: str, key: str) -> Count:
        made = self.found.get(world, {})
        return counts_of([verdicts.get(key, "") for seed, verdicts in made.items() if self._meets(seed, key)])

    def counts(self, name: str) -> dict[str, dict[float, Count]]:
        """Counts of a quantity by conclusion and level."""
        tried = sorted(self.levels[name])
        return {key: {level: self._count(f"{name}={level!r}", key) for level in tried} for key in self._keys}


def find_margins(
    make: Callable[[int], Scenario],
    claims: Sequence[Claim],
    vary: Sequence[Quantity | str],
    *,
    seeds: Sequence[int],
    levels: Mapping[str, Sequence[float]] | None = None,
    period: float | None = None,
    share: float = 1.0,
    width: float = 0.1,
    confidence: float = 0.95,
    most_runs: int = MOST_RUNS,
    out: str | Path | None = None,
    workers: int | None = None,
    cluster: str | None = None,
    progress: bool = True,
) -> Margins:
    """Margins of the conclusions of claims, on runs of scenarios in worlds that are further and further from ideal.

    Parameters
    ----------
    make
        Makes the scenario of a seed.
    claims
        Claims whose conclusions are read from every run, whether or not their hypotheses are met.
    vary
        The quantities, or their names.
    seeds
        Seeds of the starts and of what is random about messages and bodies; the same at every level.
    levels
        Levels of the first grid by name of the quantity; the quantity's own when absent.
    period
        Period of the base world; that of the scenario, or one of about a thousand ticks, when absent.
    share
        Share of the runs that must show a conclusion at a level, above 0, at most 1.
    width
        Width of a bracket, as a share of its larger end, at which bisection ends.
    confidence
        Level of confidence of the intervals.
    most_runs
        Largest number of runs, at least those of the first levels; where they do not suffice, brackets stay wider.
    out
        Folder of the results. The same call goes on with those that it holds.
    workers, cluster, progress
        As for `flocking.study.sweeps.sweep.sweep`.

    Raises
    ------
    InvalidInput
        When an argument breaks a rule.
    StorageError
        When ``out`` holds other results, or cannot be written.
    """
    from flocking.study.sweeps.sweep import sweep as make_runs
    from flocking.study.sweeps.sweep import versions
    from flocking.study.sweeps.worker_pool import pool

    chosen = {q.name: q for q in (quantity_named(one) if isinstance(one, str) else one for one in vary)}
    seeds = tuple(integer("margins", "seeds", seed, least=0) for seed in seeds)
    if not chosen or not seeds:
        raise InvalidInput("margins", "vary" if seeds else "seeds", "must not be empty", [])
    if len(set(seeds)) < len(seeds):
        raise InvalidInput("margins", "seeds", "must not hold a seed twice", list(seeds)[:8])
    check_level(confidence, "margins", "confidence")
    claims = check_claims("margins", claims)
    if number("margins", "share", share, above=0.0) > 1:
        raise InvalidInput("margins", "share", "must be at most 1", share)
    if number("margins", "width", width, above=0.0) >= 1:
        raise InvalidInput("margins", "width", "must be below 1", width)
    if period is not None:
        number("margins", "period", period, above=0.0)
    integer("margins", "most_runs", most_runs, least=1)
    for name in levels or {}:
        if name not in chosen:
            raise InvalidInput("margins", "levels", f"must be of what is varied: {', '.join(chosen)}", name)
    first = make(seeds[0])
    if not isinstance(first, Scenario):
        raise InvalidInput("margins", "scenario", "must be a Scenario", first)
    base = base_period(first) if period is None else float(period)
    worlds = Worlds(make, chosen, base)
    grids: dict[str, list[float]] = {}
    refused: dict[str, str] = {}
    words: dict[str, str] = {}
    for name, quantity in chosen.items():
        try:
            given = (levels or {}).get(name)
            grid = default_levels(quantity, first, base) if given is None else checked_levels(name, given, quantity)
            for level in (grid[0], grid[-1]):
                scenario = worlds(world=f"{name}={level!r}", seed=seeds[0])
                start(scenario)
            grids[name], words[name] = grid, world_in_words(scenario)
        except Exception as error:
            if isinstance(error, InvalidInput) and (levels or {}).get(name) is not None:
                if error.owner == "margins":
                    raise
                rule = f"must be of worlds that there are, in which {error.owner}: {error.parameter} {error.rule}"
                raise InvalidInput("margins", f"levels[{name!r}]", rule, error.value, error.fix) from error
            refused[name] = reason_of(error)
    worlds = Worlds(make, {name: chosen[name] for name in grids}, base)
    folder = None if out is None else Path(out)
    audit = Conclusions(tuple(claims))
    about = {
        "scenario": fingerprint(first), "period": base, "claims": [claim.key for claim in claims],
        "quantities": {name: q.meaning for name, q in chosen.items()},
    }  # fmt: skip

    failures: dict[str, str] = {}

    def runs_of(
        names: Sequence[str], some: Mapping[int, str], place: str
    ) -> tuple[dict[tuple[str, int], Verdicts], bool]:
        table = make_runs(
            worlds, grid={"world": list(names)}, seeds=list(some), measures=(), audit=audit,
            record={**about, "scenarios": {f"seed {seed}": digest for seed, digest in some.items()}},
            out=None if folder is None else folder / "runs" / place,
            progress=progress, most_runs=most_runs, shared=shared, gives_up=True,
        )  # fmt: skip
        found = {}
        for index, row in table.rows.items():
            task = table.plan.task(index)
            world = str(task.parameters["world"])
            found[world, task.seed] = row["verdicts"]
            if row["status"] == "failed":
                failures.setdefault(world, row["message"])
        return found, table.status == "finished"

    search = Search(worlds, claims, seeds, share, width, most_runs, runs_of)
    with pool(workers, cluster) as shared:
        search.run(grids)
    varied = tuple(
        Varied(name, q.meaning, words[name], search.counts(name), q.falling, search.base_in_words(name))
        for name, q in worlds.quantities.items()
    )
    statements = {claim.key: claim.statement for claim in claims if claim.key in search.ideal}
    return Margins(
        first.name, statements, search.ideal, varied, refused, share, width, confidence, seeds, search.runs,
        search.status, versions(), {name: levels for name, levels in search.refused.items() if levels}, failures,
    )  # fmt: skip
