"""Lines of the control kernel that find the newest sample of each neighbour that has arrived, without memory of links.

A sample is called by its number counted from 1; 0 is the exact state that everyone has of everyone at the start. The
search begins at the newest sample that may have arrived and goes back. Whether a message is lost and how late it is are
the functions of seed, agents and number that `flocking.model.world` states. The sample found at the time before is kept
beside each entry of a list, and the search goes back no further: a shortcut that changes nothing, for a message that
has arrived stays arrived. Samples that were looked at when even the latest of their messages had to be there are not
looked at again, for one that was lost stays lost. Where messages are never late by chance, the state of the channel of
Gilbert and Elliott at the newest sample is kept beside the entry too, so that the next sample needs one draw, not a
look back. All rows of a tile are searched before forces are summed: a processor then works at several draws at once.
Older samples are used in no order, so that no processor loads them ahead by itself: where all agents take samples at
the same times, the newest of them are fetched for a whole tile that comes later, else those of a row after its search.
"""

from __future__ import annotations

from dataclasses import dataclass

from flocking.engine.kernels.displacements import nearest_image_line
from flocking.model.world.random_numbers import PURPOSE_SHIFT, Purpose
from flocking.model.world.times import NANOSECOND

LOSSES = ("", "Bernoulli", "GilbertElliott", "DistanceLoss")
"""Names of the losses that kernels draw; empty where nothing is lost."""

BEST, KNOWN, BAD = 0x3FFFFFFF, 0x40000000, 0x80000000
"""Parts of what is kept beside an entry: number of the sample used, whether the state of the channel at the newest
sample that was looked at is known, and whether it is bad."""


_SLOT_LINES = (
    "slot = select(behind > slot0, slot0 + depth - behind, slot0 - behind)",
    "slot = select((best == np.uint32(0)) | (behind >= depth), spread(depth), slot)",
)
"""Lines that find the places of samples from their numbers."""

_SPOT_LINES = ("store(spots, 0, slot * size + j)",)
"""Lines that find the rows of samples from their places."""

_FETCH_LINES = (
    "later = min(tile + np.int64(news.ahead), np.int64(news.size) // 16 - 1) * 16",
    "for back in range(1, min(np.int64(news.fresh[0]), np.int64(news.older) + 1)):",
    "    place = np.int64(news.slots[0]) - back",
    "    place = place + np.int64(news.depth) if place < 0 else place",
    "    store(spots, 0, numbers_from(place * np.int64(news.size) + later))",
    "    fetch_ahead(S, spots, 0)",
)
"""Lines that fetch older samples of the agents of a tile that comes later."""


@dataclass(frozen=True)
class HeardSamples:
    """What of the messages determines the source of a kernel; numbers reach it when it is called.

    Parameters
    ----------
    dimension
        Number of axes.
    repeats
        Axes of space that repeat.
    alike
        Whether all agents take their samples at the same times.
    loss
        One of `LOSSES`.
    paired
        Whether both directions of a link lose alike.
    jitter
        Whether messages are late by a drawn time.
    expires
        Whether samples are discarded.
    predict
        Whether samples are moved on.
    flips
        Whether a channel of Gilbert and Elliott that is not drawn anew changes its state.
    plain
        Whether the loss is of the commonest form: all is lost in a bad channel and nothing in a good one, or the
        distance counts by its square.
    shared
        Graphs whose tiles share one list, by their index: no sample is kept beside its entries, which stand for the
        agents of every tile.
    """

    dimension: int
    repeats: tuple[int, ...]
    alike: bool
    loss: str
    paired: bool
    jitter: bool
    expires: bool
    predict: bool
    flips: bool
    plain: bool
    shared: tuple[int, ...]

    @property
    def draws(self) -> bool:
        """Whether it is a matter of chance whether a message has arrived."""
        return bool(self.loss) or self.jitter

    @property
    def looks_once(self) -> bool:
        """Whether a message that has not arrived when its sample is first looked at never does."""
        return self.alike and not self.jitter

    def searches_first(self, number: int) -> bool:
        """Whether samples of a graph's neighbours are searched before its forces are summed, see `rows_lines`.

        Parameters
        ----------
        number
            Index of the graph.
        """
        return self.draws and number not in self.shared

    def imports(self) -> str:
        """Import lines of the generated module."""
        return (
            "\nfrom flocking.engine.tiles.simd.counter_random import drawn_unit\n"
            "from flocking.engine.tiles.simd.row_transposition import fetch_ahead\n"
            "from flocking.engine.tiles.simd.reductions import bits_of\n"
            "from flocking.engine.tiles.simd.vectors import double_of, nearest_of\n"
        )

    def uniform_lines(self) -> list[str]:
        """Lines before the loop over the tiles."""
        lines = ["spots = np.empty(16, np.uint32)", "depth, size = np.uint32(news.depth), np.uint32(news.size)"]
        if self.loss == "DistanceLoss":
            lines += ["own_spots = np.empty(16, np.uint32)"]
        if self.keeps_channels:
            lines += [
                "newer = news.tested > 0 and np.int64(news.counts[0]) == news.tested + 1",
                "same = news.tested > 0 and np.int64(news.counts[0]) == news.tested",
                f"flags_kept = np.uint32({KNOWN | BAD} if same else 0)",
            ]
        return lines

    def tile_lines(self) -> list[str]:
        """Lines before the loops over the neighbours of a tile: where its agents were at their newest sample."""
        if self.loss != "DistanceLoss":
            return []
        mine = ", ".join(f"{x}{k}_mine" for x in "qp" for k in range(self.dimension))
        return [
            "store(own_spots, 0, np.uint32(news.slots[0]) * size + i)",
            f"{mine} = gather_agents(news.truth, own_spots, 0, ALL)",
        ]

    @property
    def keeps_channels(self) -> bool:
        """Whether states of channels are kept beside entries."""
        return self.loss == "GilbertElliott" and self.looks_once

    def search(self, number: int) -> list[str]:
        """Lines that find the sample of each neighbour in a row of a list.

        They give ``there`` (whether anything is known of it), ``spots`` (rows of the samples) and, where samples are
        moved on, ``age``.

        Parameters
        ----------
        number
            Index of the graph.
        """
        lines = self._news(timed=self.predict or (self.jitter and not self.searches_first(number)))
        if self.searches_first(number):
            lines += [f"best = load(used{number}, at)" + f" & np.uint32({BEST})" * self.keeps_channels]
        else:
            lines += self._searched(number) if self.draws else ["best = count"]
        lines += ["behind = count - best"]
        if self.expires:
            known = "select(best > np.uint32(0), behind < fresh, spread(np.uint32(news.start)) > np.uint32(0))"
            lines += [f"there = {known}"]
        else:
            lines += ["there = other"]
        if self.draws:
            # What is not used is not fetched from where older samples lie.
            lines += [*_SLOT_LINES, "slot = select(there, slot, slot0)", *_SPOT_LINES]
        else:
            lines += [*_SLOT_LINES, *_SPOT_LINES]
        if self.predict:
            lines += [
                "since = select(best > np.uint32(0), ages + float_of(widen(behind)) * periods, spread(news.now))",
                f"age = narrow(since * {NANOSECOND!r}, T(0.0))",
            ]
        return lines

    def rows_lines(self, number: int, loaded: list[str]) -> list[str]:
        """Lines that find the newest sample of every neighbour of a tile, and keep its number beside the entry.

        Parameters
        ----------
        number
            Index of the graph.
        loaded
            Lines that give ``at``, ``j`` and ``other`` for one row of a list.
        """
        if not self.searches_first(number):
            return []
        each = f"for step in range(count{number}[tile]):"
        lines = [each, *("    " + x for x in [*loaded, *self._news(timed=self.jitter), *self._searched(number)])]
        if not self.alike:
            ahead = ["behind = count - best", *_SLOT_LINES, *_SPOT_LINES, "fetch_ahead(S, spots, 0)"]
            return [*lines, *("    " + x for x in ahead)]
        if self.loss != "GilbertElliott":
            one = [each, *("    " + x for x in [*loaded, *self._tried_once(number)])]
            lines = [
                "if np.int64(news.counts[0]) == news.tested + 1:",
                *("    " + x for x in one),
                "else:",
                *("    " + x for x in lines),
            ]
        # Where no sample has come, nothing that was found before changes.
        return ["if np.int64(news.counts[0]) > news.tested:", *("    " + x for x in [*_FETCH_LINES, *lines])]

    def _tried_once(self, number: int) -> list[str]:
        """Lines of `_searched` for one new sample: its number is the same for all, and nothing is repeated."""
        lines = [f"receiver, sender = widen(load(ids, base)), widen(load(senders{number}, at))", *self._ends_lines()]
        lines += ["count, slot0, back = spread(news.counts[0]), spread(news.slots[0]), 0"]
        lines += ["newest = np.uint64(news.counts[0]) - np.uint64(1)", "came = other"]
        if self.loss:
            lines += self._chance_lines()
            lines += [f"came = came & ({self._draw('LOSS', 'one', 'two', 'newest')} >= chance)"]
        if self.jitter:
            late = f"nearest_of({self._draw('JITTER', 'sender', 'receiver', 'newest')} * news.jitter)"
            lines += ["left = news.ages[0] - news.delay"]
            lines += ["if left < news.jitter:", f"    came = came & ({late} <= left)"]
        return [*lines, f"store(used{number}, at, select(came, count, load(used{number}, at)))"]

    def _ends_lines(self) -> list[str]:
        """Lines that give the two agents whose draw decides on a message."""
        if self.paired:
            return ["one = select(sender < receiver, sender, receiver)", "two = sender + receiver - one"]
        return ["one, two = sender, receiver"]

    def _news(self, *, timed: bool) -> list[str]:
        """Lines that load what may have arrived of each neighbour; ``timed``: with ages and periods."""
        taken = "spread(news.{0}[0])" if self.alike else "gather(news.{0}, j)"
        names = {"count": "counts", "slot0": "slots"}
        if self.expires:
            names["fresh"] = "fresh"
        if timed:
            names |= {"ages": "ages", "periods": "periods"}
        return [f"{name} = {taken.format(field)}" for name, field in names.items()]

    def _searched(self, number: int) -> list[str]:
        sender = f"load(senders{number}, at)" if self.searches_first(number) else "gather(ids, j)"
        lines = [
            f"receiver, sender = widen(load(ids, base)), widen({sender})",
            "best = count ^ count" if number in self.shared else f"best = load(used{number}, at)",
        ]
        keeps = self.keeps_channels and number not in self.shared
        if keeps:
            lines += [f"channel, best = best & np.uint32({KNOWN | BAD}), best & np.uint32({BEST})"]
            lines += ["flags = channel & flags_kept"]
        lines += ["open_ = other & (best < count)"]
        once = self.alike and number not in self.shared
        if once:
            lines += ["tested = np.uint32(news.tested)", "open_ = open_ & (tested < count)"]
        if self.expires:
            lines += ["open_ = open_ & (np.uint32(0) < fresh)"]
        lines += self._ends_lines()
        body = ["trial = count - np.uint32(back)", "number = widen(trial - np.uint32(1))"]
        if self.loss:
            body += self._channel_lines(keeps=keeps) if self.loss == "GilbertElliott" else self._chance_lines()
        if self.loss == "GilbertElliott" and self.plain:
            body += ["arrived = bad < np.uint64(1)"]
        elif self.loss:
            body += [f"arrived = {self._draw('LOSS', 'one', 'two', 'number')} >= chance"]
        if self.jitter:
            late = f"nearest_of({self._draw('JITTER', 'sender', 'receiver', 'number')} * news.jitter)"
            spare = "ages + periods * np.float64(back) - news.delay"
            body += [f"spare = {spare}"] + ([] if self.loss else ["arrived = open_"])
            # Where even the latest messages are there, nothing is drawn.
            body += ["doubt = bits_of(open_ & (spare < news.jitter))"]
            body += ["if doubt:", f"    arrived = arrived & ({late} <= spare)"]
        body += ["best = select(open_ & arrived, trial, best)", "open_ = open_ & (best < trial - np.uint32(1))"]
        if once:
            body += ["open_ = open_ & (tested < trial - np.uint32(1))"]
        body += ["back += 1"]
        if self.expires:
            body += ["open_ = open_ & (np.uint32(back) < fresh)"]
        body += ["bits = bits_of(open_)"]
        lines += ["back = 0", "bits = bits_of(open_)", "while bits:", *("    " + x for x in body)]
        if number in self.shared:
            return lines
        return [*lines, f"store(used{number}, at, {'best | flags' if keeps else 'best'})"]

    def _draw(self, purpose: str, one: str, two: str, number: str) -> str:
        word = int(Purpose[purpose]) << PURPOSE_SHIFT
        return f"drawn_unit({number}, np.uint64({word}), {one}, {two}, np.uint64(news.key), np.uint64(news.key2))"

    def _chance_lines(self) -> list[str]:
        """Lines that compute the probability that each message is lost, where it is no matter of channels."""
        if self.loss == "Bernoulli":
            return ["chance = news.loss[0]"]
        own, there = (
            [f"{x}{k}_own" for x in "qp" for k in range(self.dimension)],
            [f"{x}{k}_sent" for x in "qp" for k in range(self.dimension)],
        )
        mine = [name.replace("own", "mine") for name in own]
        lines = [
            "row = select(np.uint32(back) > slot0, slot0 + depth - np.uint32(back), slot0 - np.uint32(back)) * size",
            "store(spots, 0, row + j)", *(f"{a} = {b}" for a, b in zip(own, mine, strict=True)),
            "if back > 0:", "    store(own_spots, 0, row + i)",
            f"    {', '.join(own)} = gather_agents(news.truth, own_spots, 0, ALL)",
            f"{', '.join(there)} = gather_agents(news.truth, spots, 0, ALL)",
        ]  # fmt: skip
        lines += [f"d{k} = q{k}_sent - q{k}_own" for k in range(self.dimension)]
        lines += [nearest_image_line(k) for k in self.repeats]
        square = " + ".join(f"d{k} * d{k}" for k in range(self.dimension))
        if self.plain:
            share = f"fast_exp(-({square}) * T(news.loss[3]))"
            return [*lines, f"chance = double_of(T(1.0) - T(1.0 - news.loss[0]) * {share})"]
        lines += [f"apart2 = {square}", "apart2 = select(apart2 > T(1e-30), apart2, T(1e-30))"]
        power = "fast_exp(T(0.5 * news.loss[1]) * (fast_log(apart2) - T(news.loss[2])))"
        return [*lines, f"chance = double_of(T(1.0) - T(1.0 - news.loss[0]) * fast_exp(-{power}))"]

    def _channel_lines(self, *, keeps: bool) -> list[str]:
        """Lines that look back for the last draw of a channel that does not depend on the state before.

        Parameters
        ----------
        keeps
            Whether the state at the sample before may be known.
        """
        draw = self._draw("CHANNEL", "one", "two", "before")
        lines = ["before, odd, bad = number, number & np.uint64(0), number & np.uint64(0)"]
        lines += ["unsettled = open_"]
        if keeps:
            # The next sample after the one whose state is known: drawn anew, kept or flipped.
            after = [
                f"draw = {self._draw('CHANNEL', 'one', 'two', 'number')}",
                f"bad_before = select(channel >= np.uint32({BAD}), odd ^ np.uint64(1), odd)",
                "bad_drawn = select(draw < news.loss[2] * news.loss[4], odd ^ np.uint64(1), odd)",
                f"bad = select(draw < news.loss[2], bad_drawn, bad_before{' ^ np.uint64(1)' * self.flips})",
                f"unsettled = open_ & ((channel & np.uint32({KNOWN})) < np.uint32(1))",
            ]
            lines += ["if newer and back == 0:", *("    " + x for x in after)]
        lines += ["if news.loss[2] < 0.0:", "    odd, before = number & np.uint64(1), number & np.uint64(0)"]
        lines += ["left = bits_of(unsettled)", "while left:"]
        body = [
            f"draw = {draw}",
            "begun = before == np.uint64(0)",
            "redrawn = select(begun, spread(1.0), spread(news.loss[2]))",
            "share = select(begun, spread(news.loss[3]), spread(news.loss[4]))",
            "settled = unsettled & (draw < redrawn)",
            "one_bit = select(draw < redrawn * share, odd ^ np.uint64(1), odd)",
            "bad = select(settled, one_bit, bad)",
            "unsettled = unsettled & (draw >= redrawn)",
            "before = before - np.uint64(1)",
            *["odd = odd ^ np.uint64(1)"] * self.flips,
            "left = bits_of(unsettled)",
        ]
        lines += ["    " + x for x in body]
        if keeps:
            known = f"select(bad > np.uint64(0), spread(np.uint32({KNOWN | BAD})), spread(np.uint32({KNOWN})))"
            lines += ["if back == 0:", f"    flags = select(open_, {known}, channel & np.uint32(0))"]
        if self.plain:
            return lines
        return [*lines, "chance = select(bad > np.uint64(0), spread(news.loss[1]), spread(news.loss[0]))"]
