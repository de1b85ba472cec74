"""Samples that agents have sent, as far back as anybody may use them, and how far they may be from the truth."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import Array, Indices, Numbers32, Reals
from flocking.engine.fixed_step.threads import Workers
from flocking.engine.tiles.held.news import News, is_plain, loss_numbers, older_places
from flocking.engine.tiles.held.past_speeds import Speeds
from flocking.engine.tiles.kernels.heard_samples import HeardSamples
from flocking.engine.tiles.kernels.measure_kernel import MeasureKind, measure_kernel
from flocking.engine.tiles.simd.aligned_memory import aligned
from flocking.errors import InvalidInput
from flocking.formula.native.functions import native
from flocking.model.law import Scenario
from flocking.model.world.information import Messages
from flocking.model.world.losses import DistanceLoss, GilbertElliott, Loss
from flocking.model.world.noises import Noise
from flocking.model.world.times import NANOSECOND, PER_SECOND, Instants

MOST_ROWS = 1 << 32
"""Number of rows of samples that 32 bits can distinguish."""

SURE = 1e-6
"""Share by which a bound on a deviation is enlarged, above the rounding of the sums that it is made of."""


@native
def _reordered(first, last, rows, order, n, target):  # type: ignore[no-untyped-def]
    """Copy rows of agents in a new order."""
    for row in range(first, last):
        old = order[row if row < n else n - 1]
        for k in range(rows.shape[1]):
            target[row, k] = rows[old, k]


class Taking(NamedTuple):
    """Arguments of the kernel that takes samples, see `flocking.engine.tiles.kernels.measure_kernel.measure_kernel`."""

    marked: Numbers32
    agents: Reals
    target: Reals
    ids: Numbers32
    numbers: NDArray[np.uint64]
    errors: Array
    memory: Array
    sizes: Array


class SampleStore:
    """Samples of agents in sorted order.

    Parameters
    ----------
    scenario
        Its information is messages.
    q, p
        Positions and velocities at the start by place, pads included, shape (size, m).
    n
        Number of agents here, of which the scenario may have more.
    dtype
        Precision of the state.
    memory_limit
        Largest memory of the samples in bytes.
    workers
        Threads to use.

    Attributes
    ----------
    rows
        Samples: places in order, each with a row for each agent, the last of them with the start; shape
        ((depth + 1) size, 2m).
    errors
        Errors of each agent's newest sample in units of the standard deviation, shape (2m, size).
    off
        Largest deviations of a position and a velocity from the truth at each place, shape (depth + 1, 2).
    """

    def __init__(
        self, scenario: Scenario, agents: Reals, n: int, dtype: type[np.float32] | type[np.float64],
        memory_limit: float, workers: Workers,
    ) -> None:  # fmt: skip
        messages = scenario.information
        assert isinstance(messages, Messages)
        self.messages, self.n, self.workers = messages, n, workers
        self.size, columns = agents.shape
        m = columns // 2
        schedule = messages.schedule(scenario.start.n)
        self.schedule = schedule
        self.alike = schedule.alike
        self._times = schedule.of_one if self.alike else schedule
        self.delay, self.jitter = (round(x * PER_SECOND) for x in (messages.delay, messages.jitter))
        self.expires = messages.expires_in_nanoseconds
        least, most = int(schedule.period.min()), int(schedule.period.max())
        # The newest sample that has arrived is younger than this, unless messages are lost.
        self.oldest = self.delay + self.jitter + most + int(schedule.phase.max())
        if self.expires is not None:
            lossy = messages.loss is not None and not messages.loss.ideal
            self.oldest = self.expires if lossy else min(self.expires, self.oldest)
        self.depth = -(-self.oldest // least) + 2
        self._agent_bytes, self._memory_limit = columns * np.dtype(dtype).itemsize, memory_limit
        self.check_room()
        self._rooms: dict[str, Reals] = {"rows": aligned(((self.depth + 2) * self.size, columns), dtype)}
        self.rows: Reals = self._rooms["rows"][: (self.depth + 1) * self.size]
        self.rows[:] = 0.0
        self.rows[self.depth * self.size :] = agents
        noise, loss = messages.noise, messages.loss
        self.noise: Noise | None = None if noise is None or noise.ideal else noise
        self.loss: Loss | None = None if loss is None or loss.ideal else loss
        rounded = (messages.resolution > 0.0, messages.velocity_resolution > 0.0)
        memories = [0.0 if noise is None else noise.memory(float(x) * NANOSECOND) for x in np.unique(schedule.period)]
        self.correlated = self.noise is not None and any(memories)
        self.errors: Array = np.zeros((columns, self.size if self.correlated else 0))
        exact = self.noise is None and not any(rounded)
        self.truth: Reals = self.rows
        if isinstance(self.loss, DistanceLoss) and not exact:
            self.truth = self.rows.copy()
        self.off: Array = np.zeros((self.depth + 1, 2))
        self.speeds = Speeds()
        self.kind = MeasureKind(m, self.noise is not None, self.correlated, rounded, np.dtype(dtype).name)
        self._measure = measure_kernel(self.kind).measure
        self.exact = exact
        self._marks: tuple[tuple[int, int], Numbers32] | None = None
        self.numbers = loss_numbers(self.loss)
        self._older = older_places(self.loss, self.jitter, least)

    def check_room(self) -> None:
        """Refuse more samples than there is memory for.

        Raises
        ------
        InvalidInput
            When there are.
        """
        needs = (self.depth + 2.0) * self.size * self._agent_bytes
        if needs > self._memory_limit or (self.depth + 1) * self.size >= MOST_ROWS:
            raise InvalidInput(
                "Messages", "expires", f"must leave few enough samples: {self.depth} of each agent take "
                f"{needs / 2**30:.3g} GiB", self.messages.expires, "Shorten it, or raise memory_limit.",
            )  # fmt: skip

    def heard(self, dimension: int, repeats: tuple[int, ...], shared: tuple[int, ...]) -> HeardSamples:
        """What of the messages determines the control kernel.

        Parameters
        ----------
        dimension
            Number of axes.
        repeats
            Axes of space that repeat.
        shared
            Graphs whose tiles share one list, by their index.
        """
        loss = self.loss
        flips = isinstance(loss, GilbertElliott) and loss.to_bad + loss.to_good > 1.0
        return HeardSamples(
            dimension, repeats, self.alike, "" if loss is None else type(loss).__name__,
            bool(getattr(loss, "paired", False)), self.jitter > 0, self.expires is not None, self.messages.predict,
            flips, is_plain(loss), shared,
        )  # fmt: skip

    @property
    def keeps_truth(self) -> bool:
        """Whether true states are kept beside the samples."""
        return self.truth is not self.rows

    def reorder(self, order: Numbers32) -> None:
        """Sort the samples.

        Parameters
        ----------
        order
            Place of each agent before the sort, shape (n,).
        """
        both = self.keeps_truth
        for name in ("rows", "truth") if both else ("rows",):
            setattr(self, name, self._sorted(name, order))
        if not both:
            self.truth = self.rows
        if self.correlated:
            self.errors[:, : self.n] = self.errors[:, order]

    def _sorted(self, name: str, order: Numbers32) -> Reals:
        """Samples in a new order, place by place, each into the room that the one beside it has left.

        Fresh memory for all of them would take longer to get than the samples to sort.
        """
        old, size = getattr(self, name), self.size
        room = self._rooms.get(name)
        if room is None or not np.shares_memory(old[:1], room):
            self._rooms[name] = room = aligned((len(old) + size, old.shape[1]), old.dtype.type)
            room[: len(old)] = old
            old = room[: len(old)]
        ahead = bool(np.shares_memory(old[:1], room[:1]))
        new = room[size:] if ahead else room[:-size]
        places = range(len(old) // size)
        for place in reversed(places) if ahead else places:
            here = slice(place * size, (place + 1) * size)
            self.workers.each(_reordered, size, old[here], order, self.n, new[here])
        return new

    def memory(self) -> dict[str, object]:
        """What the samples go on from, see `recall`; not copied."""
        return {
            "rows": self.rows, "truth": self.truth if self.keeps_truth else None, "errors": self.errors,
            "off": self.off, "speeds": self.speeds.table,
        }  # fmt: skip

    def recall(self, rows: Reals, truth: Reals | None, errors: Array, off: Array, speeds: Array) -> None:
        """Go on with the arrays of a checkpoint.

        Parameters
        ----------
        rows, truth, errors, off
            See the attributes; ``truth`` is None where the samples are the truth.
        speeds
            Rows of `Speeds`.
        """
        self._rooms.clear()
        self.rows, self.errors, self.off = rows.copy(), errors.copy(), off.copy()
        self.truth = self.rows if truth is None else truth.copy()
        self.speeds.rows = speeds.tolist()

    def due(self, now: int) -> NDArray[np.bool_]:
        """Who takes a sample at the nanosecond ``now``, shape (N,), or (1,) where all do it together."""
        return self._times.falls_on(now)

    def measure(self, now: int, agents: Reals, ids: Numbers32) -> None:
        """Take the samples that are due at the nanosecond ``now``.

        Parameters
        ----------
        agents
            The true state, shape (size, 2m).
        ids
            Number of the agent at each place, shape (size,).
        """
        due = self.due(now)
        if not due.any():
            return
        size, messages, here = self.size, self.messages, self.filled
        marked = self._all_due() if self.alike else np.zeros(size, np.int32)
        if not self.alike:
            marked[here] = due[ids[here]]
        numbers = (self._times.count_until(now) - 1).astype(np.int64)
        if self.alike:
            place = int(numbers[0]) % self.depth
            target = self.rows[place * size : (place + 1) * size]
            if self.exact:
                target[:] = agents
                return
            each = numbers.astype(np.uint64)
        else:
            target = np.zeros_like(agents)
            each = np.zeros(size, np.uint64)
            each[here] = np.maximum(numbers[ids[here]], 0)
        memory = np.zeros(1)
        if self.correlated:
            assert self.noise is not None
            periods = self._times.period
            found = {int(x): self.noise.memory(int(x) * NANOSECOND) for x in np.unique(periods)}
            memory = np.array([found[int(periods[0])]]) if self.alike else np.zeros(size)
            if not self.alike:
                memory[here] = np.array([found[int(x)] for x in periods])[ids[here]]
        sizes = np.array([
            self.noise.position if self.noise else 0.0, self.noise.velocity if self.noise else 0.0,
            messages.resolution, messages.velocity_resolution,
        ])  # fmt: skip
        largest = self._largest(self._taken(Taking(marked, agents, target, ids, each, self.errors, memory, sizes)))
        if self.alike:
            if self.keeps_truth:
                self.truth[place * size : (place + 1) * size] = agents
            self.off[place] = largest
            return
        where = np.flatnonzero(marked)
        places = numbers[ids[where]] % self.depth
        self.rows[places * size + where] = target[where]
        # Places of agents with other periods are written at other times: the largest deviations until now count.
        self.off[:] = np.maximum(self.off, largest)

    def _all_due(self) -> Numbers32:
        """Marks of all agents, shape (size,): kept, as writing them anew would take a while."""
        here = self.filled
        if isinstance(here, slice):
            if self._marks is None or self._marks[0] != (self.size, here.stop):
                marked: Numbers32 = np.zeros(self.size, np.int32)
                marked[here] = 1
                self._marks = ((self.size, here.stop), marked)
            return self._marks[1]
        return here.astype(np.int32)

    def _taken(self, taking: Taking) -> Array:
        """Take samples; the largest deviations of a position and a velocity, shape (2,)."""
        tiles, seed = len(taking.marked) // 16, self.messages.seed
        off = np.zeros((tiles, 2))
        self.workers.each(self._measure, tiles, *taking, seed & 0xFFFFFFFF, seed >> 32, off)
        # One column after the other: NumPy goes through rows of two numbers many times more slowly.
        found: Array = np.sqrt([off[:, k].max(initial=0.0) for k in range(2)])
        return found

    def _largest(self, off: Array) -> Array:
        """The largest deviations of all processes from those here."""
        return off

    @property
    def filled(self) -> slice | NDArray[np.bool_]:
        """The places at which there are agents."""
        return slice(0, self.n)

    def own(self, now: int, agents: Reals, ids: Numbers32) -> Reals:
        """What each agent knows of itself at the nanosecond ``now``, shape (size, 2m).

        Parameters
        ----------
        agents, ids
            As for `measure`.
        """
        if self.messages.self_known != "measured":
            return agents
        taken = self._times.count_until(now)
        size = self.size
        if self.alike:
            place = (int(taken[0]) - 1) % self.depth if taken[0] else self.depth
            return self.rows[place * size : (place + 1) * size]
        places = np.where(taken > 0, (taken - 1) % self.depth, self.depth)[ids]
        return np.ascontiguousarray(self.rows[places * size + np.arange(size)])

    def own_numbers(self, now: int, agents: Indices) -> Indices:
        """Numbers of the newest own samples of ``agents`` at the nanosecond ``now``, -1 for the start."""
        taken = self._times.count_until(now).astype(np.int64) - 1
        return np.asarray(np.full(len(agents), taken[0]) if self.alike else taken[agents])

    def news(self, now: int, ids: Numbers32, tested: int = 0, ahead: int = 1) -> News:
        """What may have arrived by the nanosecond ``now``.

        Parameters
        ----------
        ids
            Number of the agent at each place, shape (size,).
        tested, ahead
            See `News`.
        """
        schedule, messages = self._times, self.messages
        counts: Instants = schedule.count_until(now - self.delay)
        begun = schedule.phase + (counts - 1) * schedule.period
        ages = now - begun
        fresh = np.full(len(counts), self.depth, dtype=np.int64)
        if self.expires is not None:
            fresh = np.where(ages < self.expires, (self.expires - 1 - ages) // schedule.period + 1, 0)
        slots = np.where(counts > 0, (counts - 1) % self.depth, 0)
        some = slice(0, 1) if self.alike else ids
        known = self.expires is None or now < self.expires
        return News(
            float(now), counts[some].astype(np.uint32), slots[some].astype(np.uint32), ages[some].astype(np.float64),
            schedule.period[some].astype(np.float64), fresh[some].astype(np.uint32), int(known), self.depth, self.size,
            float(self.delay), float(self.jitter), messages.seed & 0xFFFFFFFF, messages.seed >> 32, self.numbers,
            self.truth, tested, ahead, self._older,
        )  # fmt: skip

    def settled(self, now: int) -> int:
        """How many samples of each agent, all alike, will never arrive after the nanosecond ``now`` if not by then."""
        return int(self._times.count_until(now - self.delay - self.jitter)[0])

    def see_speed(self, now: int, frame: Array, top: float) -> None:
        """Take the largest speed ``top`` in a ``frame`` during the step that begins at the nanosecond ``now``."""
        self.speeds.add(now, frame, top, now - self.oldest - int(self.schedule.period.max()))

    def deviation(self, now: int | None) -> float:
        """Bound on the distance of what is known of an agent from where it is, for samples in use.

        Parameters
        ----------
        now
            Nanosecond; None for any time at the speeds of the past.
        """
        age = (self.oldest if now is None else min(self.oldest, now)) * NANOSECOND
        place, speed = self.off.max(axis=0)
        rate = self.speeds.bound(predict=self.messages.predict) + (speed if self.messages.predict else 0.0)
        found = float(place) + age * float(rate)
        if self.messages.self_known == "measured":
            period = float(self.schedule.period.max() + self.schedule.phase.max()) * NANOSECOND
            found += float(place) + period * self.speeds.bound(predict=False)
        return found * (1.0 + SURE)
