"""Linear consensus in the world that a scenario declares: held control, and messages that are late, lost or noisy."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from flocking.arrays import Array, Indices, Links
from flocking.model.law import Scenario
from flocking.model.world.control import Held
from flocking.model.world.information import Instant, Messages
from flocking.model.world.losses import Bernoulli
from flocking.model.world.noises import WhiteNoise
from flocking.model.world.times import PER_SECOND, nanoseconds
from flocking.study.certificates.certificate import Hypothesis, until_failed
from flocking.study.certificates.consensus_certificates import LinearConsensus
from flocking.study.certificates.enclosed_matrices import UNIT, unit_of_rates
from flocking.study.certificates.random_recursion import RandomRecursion

LARGEST_SYSTEM, LARGEST_RANDOM = 400, 200
"""Components of an axis, all that is stored counted, up to which spectra and growths by chance are enclosed."""

NUMBER_ERROR = 64.0 * UNIT
"""Relative error of periods, gains, masses and their products."""


@dataclass(frozen=True, eq=False)
class SampledConsensus:
    """Linear consensus of agents that act together at ticks, on samples that are taken at the same ticks.

    Parameters
    ----------
    consensus
        The linear law, whose hypotheses hold.
    """

    consensus: LinearConsensus

    @property
    def scenario(self) -> Scenario:
        """The scenario."""
        return self.consensus.scenario

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """What must hold of the world, in the order of the checks; later ones assume earlier ones."""
        return until_failed(self._held, self._messages, self._loss, self._memory, self._noise, self._size)

    @property
    def holds(self) -> bool:
        """Whether all hypotheses hold."""
        return all(h.holds for h in self.hypotheses)

    @cached_property
    def leaves_out(self) -> tuple[Hypothesis, ...]:
        """What must hold for agents to act together on present, exact samples, lost ones left out; of any law."""
        return until_failed(self._held, self._messages, self._loss, self._present)

    def _present(self) -> Hypothesis:
        statement = "messages arrive at once and exact, and a lost one is left out"
        messages = self.messages
        if messages is None or not self.probability:
            return Hypothesis(statement, False, "none is lost")
        if self.delayed_samples:
            return Hypothesis(statement, False, f"they are {self.delayed_samples} periods late")
        if self.uses_older_samples or int(messages.expires_in_nanoseconds or 0) > self._ticks:
            return Hypothesis(statement, False, "older ones are used")
        noise = messages.noise
        return Hypothesis(
            statement, noise is None or noise.ideal, "so" if noise is None or noise.ideal else noise.summary
        )

    @property
    def messages(self) -> Messages | None:
        """The messages; None where the present is known."""
        information = self.scenario.information
        return information if isinstance(information, Messages) else None

    def _held(self) -> Hypothesis:
        statement = "all agents act at the same times, at once, and hold their force"
        control = self.scenario.control
        if type(control) is not Held:
            return Hypothesis(statement, False, control.summary or "control is continuous")
        ticks = control.schedule(self.n)
        if np.ptp(ticks.period) or np.any(ticks.phase) or np.any(control.latency):
            return Hypothesis(statement, False, "periods differ, or there is a phase or a latency")
        return Hypothesis(statement, True, f"every {self.period:g}")

    def _messages(self) -> Hypothesis:
        statement = "samples are taken at the same times, arrive after whole periods, and are not rounded or moved on"
        information = self.scenario.information
        if type(information) is Instant:
            return Hypothesis(statement, True, "the present is known")
        messages = self.messages
        if type(messages) is not Messages:
            return Hypothesis(statement, False, information.summary)
        times = messages.schedule(self.n)
        if np.any(times.period != self._ticks) or np.any(times.phase):
            return Hypothesis(statement, False, "samples and actions are not taken together")
        late = int(nanoseconds("Messages", "delay", messages.delay))
        if messages.jitter or late % self._ticks:
            return Hypothesis(statement, False, "the delay is not a whole number of periods")
        if messages.predict or messages.resolution or messages.velocity_resolution:
            return Hypothesis(statement, False, "samples are rounded or moved on")
        return Hypothesis(statement, True, f"{self.delayed_samples} periods late")

    def _loss(self) -> Hypothesis:
        statement = "messages are lost independently, with one probability"
        loss = None if self.messages is None else self.messages.loss
        if loss is None or loss.ideal:
            return Hypothesis(statement, True, "none is lost")
        if type(loss) is not Bernoulli:
            return Hypothesis(statement, False, loss.summary)
        return Hypothesis(statement, loss.probability < 1.0, loss.summary)

    def _memory(self) -> Hypothesis:
        statement = "a lost message is left out of the sum, or the sample before it is used, positions alone"
        messages = self.messages
        if messages is None:
            return Hypothesis(statement, True, "none is lost")
        if messages.expires is not None:
            age = int(messages.expires_in_nanoseconds or 0)
            if age <= self.delayed_samples * self._ticks:
                return Hypothesis(statement, False, "samples expire before they arrive")
            if self.probability and age > (self.delayed_samples + 1) * self._ticks:
                return Hypothesis(statement, False, "a lost sample is replaced by older ones for a time")
        if self.uses_older_samples and self.order == 2:
            return Hypothesis(statement, False, "lost positions and velocities are replaced by older ones")
        return Hypothesis(statement, True, "older ones are used" if self.uses_older_samples else "left out")

    def _noise(self) -> Hypothesis:
        noise = None if self.messages is None else self.messages.noise
        fits = noise is None or noise.ideal or type(noise) is WhiteNoise
        return Hypothesis(
            "errors of samples are independent", fits, "none" if noise is None or noise.ideal else noise.summary
        )

    def _size(self) -> Hypothesis:
        size = self.n * self.order * (self.delayed_samples + 1) + (
            int(self._links.sum()) if self.uses_older_samples else 0
        )
        most = LARGEST_RANDOM if self.probability else LARGEST_SYSTEM
        return Hypothesis(f"at most {most} numbers are stored for an axis", size <= most, f"{size}")

    @property
    def n(self) -> int:
        """Number of agents."""
        return self.scenario.start.n

    @property
    def _links(self) -> Links:
        start = self.scenario.start
        return np.asarray(start.links if start.links is not None else self.scenario.law.graph.initial(start.q))

    @property
    def _ticks(self) -> int:
        """The period in nanoseconds."""
        control = self.scenario.control
        assert isinstance(control, Held)
        return int(control.schedule(self.n).period[0])

    @property
    def period(self) -> float:
        """The period."""
        return self._ticks / PER_SECOND

    @cached_property
    def delayed_samples(self) -> int:
        """The delay in whole periods."""
        if self.messages is None:
            return 0
        return int(nanoseconds("Messages", "delay", self.messages.delay)) // self._ticks

    @property
    def probability(self) -> float:
        """Probability that a message is lost."""
        loss = None if self.messages is None else self.messages.loss
        return loss.probability if isinstance(loss, Bernoulli) else 0.0

    @property
    def paired(self) -> bool:
        """Whether both directions of a link are lost together."""
        loss = None if self.messages is None else self.messages.loss
        return isinstance(loss, Bernoulli) and loss.paired

    @property
    def uses_older_samples(self) -> bool:
        """Whether an older sample is used where one is lost."""
        return bool(self.probability) and self.messages is not None and self.messages.expires is None

    @property
    def sigma(self) -> tuple[float, float]:
        """Standard deviations of measured positions and velocities along an axis."""
        noise = None if self.messages is None else self.messages.noise
        return (noise.position, noise.velocity) if isinstance(noise, WhiteNoise) else (0.0, 0.0)

    @property
    def own_measured(self) -> bool:
        """Whether agents know their own state by their own sample."""
        return self.messages is not None and self.messages.self_known == "measured"

    @property
    def _stores_errors(self) -> bool:
        """Whether the errors of samples that agents have used of themselves are still to reach their neighbours."""
        return self.own_measured and self.delayed_samples > 0

    @property
    def order(self) -> int:
        """2 where positions and velocities are agreed on, 1 where one of them is."""
        return 1 if self.consensus.is_first else 2

    @property
    def what(self) -> str:
        """What is agreed on first of all."""
        return "velocities" if self.consensus.only_velocities else "positions"

    @property
    def holds_common_motion(self) -> bool:
        """Whether `recursion` holds how all move together, no disagreement: samples that are late or kept change it."""
        return self.delayed_samples > 0 or self.uses_older_samples

    @property
    def motion(self) -> str:
        """What the components of `recursion` are, in words."""
        return "disagreement and common motion" if self.holds_common_motion else "disagreement"

    @cached_property
    def frequency(self) -> float:
        """The unit of velocities over lengths for order 2, near the root of the gain of positions; 1 for order 1."""
        return unit_of_rates(float(self.consensus.place_gain.lo)) if self.order == 2 else 1.0

    def recursion(self, period: float) -> RandomRecursion:
        """One axis of the disagreement from tick to tick, at a period that may differ from the declared one.

        Components are positions (velocities, where those alone are agreed on) and, for order 2, velocities over
        `frequency`, so that nothing depends on the unit of time, now and as many periods ago as messages are late, then
        what is stored of each neighbour whose messages are lost. All are relative to the position of agent 0, and its
        velocity where late positions do not determine a common motion.
        Where agents know themselves by their samples and these are late to others, what is stored of earlier ticks are
        the samples with their errors: an agent has used the error of its sample before its neighbours do.

        Parameters
        ----------
        period
            The period; the delay keeps its number of periods.
        """
        links, block = np.argwhere(self._links), self.n * self.order
        size = block * (self.delayed_samples + 1) + (len(links) if self.uses_older_samples else 0)
        builder = _Builder(size, self.n * self.order)
        steady = np.zeros((size, size))
        steady[:block, :block] = np.eye(block)
        if self.order == 2:
            steady[: self.n, self.n : block] = period * self.frequency * np.eye(self.n)
        for k in range(self.delayed_samples):
            steady[(k + 1) * block : (k + 2) * block, k * block : (k + 1) * block] = np.eye(block)
        if self._stores_errors:
            for component in range(block):
                unit = 1.0 if component < self.n else 1.0 / self.frequency
                builder.always({block + component: 1.0}, {}, {component: unit})
        memory = size - len(links)
        if self.uses_older_samples:
            steady[memory:, memory:] = np.eye(len(links))
        groups = self._groups(links)
        for members in groups:
            for link in members:
                i, j = (int(x) for x in links[link])
                if self.uses_older_samples:
                    self._remember(builder, period, i, j, memory + link)
                else:
                    self._couple(builder, period, i, j)
        full = builder.recursion(steady, len(groups[0]), 1.0 - self.probability, self._error)
        return self._reduced(full)

    @property
    def _error(self) -> float:
        gains = (
            [self.consensus.first_gain] if self.order == 1 else [self.consensus.place_gain, self.consensus.rate_gain]
        )
        return NUMBER_ERROR + max(float(g.hi - g.lo) / float(g.lo) for g in gains)

    def _groups(self, links: Indices) -> list[list[int]]:
        """Links that are lost together, as rows of ``links``."""
        if not self.paired:
            return [[k] for k in range(len(links))]
        number = {(int(i), int(j)): k for k, (i, j) in enumerate(links)}
        return [[number[i, j], number[j, i]] for i, j in number if i < j]

    @property
    def _error_signs(self) -> tuple[float, float]:
        """How errors of one tick act at that tick: the agent's own in its own state, its neighbours' in theirs."""
        return (-1.0 if self.own_measured else 0.0), (0.0 if self._stores_errors else 1.0)

    def _couple(self, builder: _Builder, period: float, i: int, j: int) -> None:
        """The force on i of a neighbour j whose message may be lost."""
        n, late = self.n, self.n * self.order * self.delayed_samples
        own, other = self._error_signs
        if self.order == 1:
            gain = float(self.consensus.first_gain.lo)
            builder.add({i: period * gain}, _difference(i, late + j), {j: other, i: own})
            return
        often, step = self.frequency, period * self.frequency
        place, rate = float(self.consensus.place_gain.lo) / often**2, float(self.consensus.rate_gain.lo) / often
        out_of = {late + j: place, i: -place, late + n + j: rate, n + i: -rate}
        noise = {j: other * place, i: own * place, n + j: other * rate / often, n + i: own * rate / often}
        builder.add({i: 0.5 * step * step, n + i: step}, out_of, noise)

    def _remember(self, builder: _Builder, period: float, i: int, j: int, place: int) -> None:
        """The force on i of what it stores of j, and of what a new sample changes if it arrives."""
        gain, late = float(self.consensus.first_gain.lo), self.n * self.delayed_samples
        own, other = self._error_signs
        builder.always({i: period * gain}, _difference(i, place), {i: own})
        builder.add({i: period * gain, place: 1.0}, _difference(place, late + j), {j: other})

    def _reduced(self, full: RandomRecursion) -> RandomRecursion:
        n, block = self.n, self.n * self.order
        ones = np.zeros((2, full.size))
        for k in range(self.delayed_samples + 1):
            ones[0, k * block : k * block + n] = 1.0
        if self.uses_older_samples:
            ones[0, (self.delayed_samples + 1) * block :] = 1.0
        ones[1, n:block] = 1.0
        if self.order == 2 and not self.holds_common_motion:
            return full.without(ones, (0, n))
        return full.without(ones[:1], (0,))

    def noise_shares(self) -> Array:
        """Standard deviation of each component of the noise of `recursion`, shape (W,)."""
        place, rate = self.sigma
        if self.order == 1:
            return np.full(self.n, rate if self.consensus.only_velocities else place)
        return np.repeat([place, rate], self.n)


Row = dict[int, float]
"""Numbers of a sparse vector by component."""


def _difference(less: int, more: int) -> Row:
    return {less: -1.0, more: 1.0}


class _Builder:
    """Collects the columns and rows of a recursion.

    Parameters
    ----------
    size
        Number of components.
    sources
        Number of components of the noise.
    """

    def __init__(self, size: int, sources: int) -> None:
        self._size, self._sources = size, sources
        self._random: list[tuple[Row, Row, Row]] = []
        self._certain: list[tuple[Row, Row, Row]] = []

    def add(self, into: Row, out_of: Row, noise: Row) -> None:
        """Add what acts if a message arrives: which components change, of what, and of what noise."""
        self._random.append((into, out_of, noise))

    def always(self, into: Row, out_of: Row, noise: Row) -> None:
        """Add what acts in every step."""
        self._certain.append((into, out_of, noise))

    def recursion(self, steady: Array, width: int, present: float, error: float) -> RandomRecursion:
        """The recursion, with groups of ``width`` in the order in which they were added."""
        into, out_of, noise = self._matrices(self._random)
        always_into, always_out_of, always_noise = self._matrices(self._certain)
        return RandomRecursion(
            steady, always_into, always_out_of, always_noise, into, out_of, noise, width, present, error
        )

    def _matrices(self, rows: list[tuple[Row, Row, Row]]) -> tuple[Array, Array, Array]:
        found = [np.zeros((len(rows), width)) for width in (self._size, self._size, self._sources)]
        for k, parts in enumerate(rows):
            for matrix, part in zip(found, parts, strict=True):
                matrix[k, list(part)] = list(part.values())
        return found[0].T.copy(), found[1], found[2]
