"""What the departed energy of a run is due to: delay, loss, noise, links of knowledge, hold, limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flocking.arrays import Array, Links
from flocking.engine.protocol.body_chains import why_not_closed
from flocking.engine.runs.message_log import OWN, PRESENT
from flocking.engine.runs.run import Run
from flocking.errors import UnsupportedLaw
from flocking.formula.compiled import Reading
from flocking.model.world.control import Held
from flocking.model.world.information import Messages
from flocking.model.world.times import NANOSECOND
from flocking.study.message_logs.forced_motion import ForcedMotion
from flocking.study.message_logs.logged_world import LoggedWorld, logged

CAUSES = ("delay", "loss", "noise", "links", "hold", "limits")
"""What departed energy is split into."""


@dataclass(frozen=True, eq=False)
class Departed:
    """Energy that departed, by its cause.

    Parameters
    ----------
    t
        Times of the rows of the ledger, shape (K,).
    total
        The column of the ledger, shape (K,).
    causes
        Of every name in `CAUSES` its share, shape (K,); they add up to the total. What is not in the world has a share
        that is exactly zero.
    """

    t: Array
    total: Array
    causes: dict[str, Array]


def departed_causes(run: Run) -> Departed:
    """Split the departed energy of a run with held control, by switching imperfections off one after another.

    At every act the law is computed again on what the agent used without errors (``noise``, resolution included),
    then as if no message had been lost (``loss``), then on the true present states (``delay``), and then over the
    true links (``links``, which include links that had expired); what a limit took from a force is ``limits``. Each
    difference works along the motion until the next force acts. What is left is the difference between the law at the
    tick and the law now: ``hold``, latency included. The order matters: another one would share out what two
    imperfections do together in another way.

    Parameters
    ----------
    run
        A run with a log of what agents used.

    Raises
    ------
    InvalidInput
        When there is no log.
    UnsupportedLaw
        When control is continuous, a safety filter changed the forces, leaders are known by messages, agents are of
        order 1, whose forces are no work along the motion, or forces change between ticks, by a lag or by gusts.
    """
    scenario, log = logged(run)
    if not isinstance(scenario.control, Held):
        raise UnsupportedLaw(
            "departed_causes splits the work of forces that change at ticks alone, under held control."
        )
    if scenario.agents.order == 1:
        raise UnsupportedLaw("departed_causes splits the work of forces; agents of order 1 have none.")
    if why_not_closed(scenario.agents) or not ForcedMotion(scenario, log).follows_desired:
        raise UnsupportedLaw(
            f"departed_causes splits the work of forces that change at ticks alone, and {scenario.agents.summary}."
        )
    if isinstance(scenario.information, Messages) and scenario.information.leader:
        raise UnsupportedLaw("departed_causes knows leaders exactly: it does not split what their messages cause.")
    world = LoggedWorld(run, scenario, log)
    trace = run.trace
    with Reading(), np.errstate(over="ignore", invalid="ignore"):
        differences = _differences(run, world)
    motion = world.motion
    assert isinstance(motion, ForcedMotion)
    causes = {name: np.zeros(len(trace)) for name in CAUSES}
    acting = {name: np.full(world.n, -1) for name in differences}
    previous: Array | None = None
    sums = dict.fromkeys(differences, 0.0)
    for row, t in enumerate(trace["time"]):
        seconds = float(t) - world.base
        # Forces that begin at a row act after it.
        place = world.motion.states(seconds)[0]
        frame = _frame_position(run, world, float(t), place)
        now = place - frame
        if previous is not None:
            for name, values in differences.items():
                rows = acting[name]
                force = np.where((rows >= 0)[:, None], values[rows], 0.0)
                sums[name] += float((force * (now - previous)).sum())
        for name in differences:
            causes[name][row] = sums[name]
            acting[name] = np.array(
                [motion.rows[a][motion.piece(a, seconds / NANOSECOND + 1.0)] for a in range(world.n)]
            )
        previous = now
    causes["hold"] = trace["departed"] - sum(causes[name] for name in differences)
    return Departed(trace["time"].copy(), trace["departed"].copy(), causes)


def _frame_position(run: Run, world: LoggedWorld, t: float, place: Array) -> Array:
    """A point that moves with the frame of the energy, shape (m,)."""
    energy = run.scenario.energy
    if energy.leader is not None:
        return np.asarray(energy.leader.at(t)[0])
    if energy.frame == "lab":
        return np.zeros(world.m)
    masses = world.motion.masses
    return np.asarray(masses @ place / masses.sum())


def _differences(run: Run, world: LoggedWorld) -> dict[str, Array]:
    """By cause and act, by how much it changed the force, shape (acts, m) each."""
    log, m = world.log, world.m
    found = {name: np.zeros((len(log.ticks), m)) for name in ("noise", "loss", "delay", "links", "limits")}
    firsts, messages, arrivals = log.firsts, world.messages, world.arrivals
    noisy, lossy = _imperfect(messages)
    links = _TrueLinks(run, world)
    for row, (instant, agent, count) in enumerate(log.ticks.tolist()):
        entries = log.uses[firsts[row] : firsts[row] + count].tolist()
        used = [(g, j, k) for g, j, k in entries if g != OWN]
        own_number = next((k for g, _, k in entries if g == OWN), PRESENT)
        measured = world.sample(agent, own_number, instant)
        mine = measured.q, measured.p
        here = world.sample(agent, PRESENT, instant)
        own = measured.exact_q, measured.exact_p

        def law(own: tuple[Array, Array], states: list[tuple[int, int, Array, Array]], agent: int = agent,
                instant: int = instant) -> Array:  # fmt: skip
            others: dict[int, list[tuple[int, Array, Array]]] = {}
            for g, j, q, p in states:
                others.setdefault(g, []).append((j, q, p))
            return world.force(agent, own, others, instant)

        def received(
            numbers: list[tuple[int, int, int]], instant: int = instant
        ) -> list[tuple[int, int, Array, Array]]:
            return [(g, j, *world.received(world.sample(j, k, instant), instant)) for g, j, k in numbers]

        def exact(numbers: list[tuple[int, int, int]], instant: int = instant) -> list[tuple[int, int, Array, Array]]:
            states = []
            for g, j, k in numbers:
                sample = world.sample(j, k, instant)
                moved = (instant - sample.instant) * NANOSECOND if messages is not None and messages.predict else 0.0
                states.append((g, j, sample.exact_q + moved * sample.exact_p, sample.exact_p))
            return states

        # Not the logged force: equal arguments then give equal bits, and a difference that is exactly zero.
        before = law(mine, received(used))
        assert isinstance(world.motion, ForcedMotion)
        exerted = world.motion.exerted(row, agent)
        if exerted is not None:
            found["limits"][row] = exerted - log.forces[row]
        if noisy:
            now = law(own, exact(used))
            found["noise"][row], before = before - now, now
        if lossy and arrivals is not None:
            newest = [(g, j, arrivals.newest(agent, j, instant, lossless=True)) for g, j, _ in used]
            if newest != used:
                now = law(own, exact(newest))
                found["loss"][row], before = before - now, now
        present = [(g, j, PRESENT) for g, j, _ in used]
        if messages is not None:
            now = law((here.q, here.p), exact(present))
            found["delay"][row], before = before - now, now
        true = links.at(instant)
        neighbours = [(g, int(j), PRESENT) for g in range(len(true)) for j in np.flatnonzero(true[g][agent])]
        if sorted(neighbours) != sorted(present):
            found["links"][row] = before - law((here.q, here.p), exact(neighbours))
    return found


def _imperfect(messages: Messages | None) -> tuple[bool, bool]:
    """Whether samples have errors, and whether messages are lost."""
    if messages is None:
        return False, False
    noisy = messages.noise is not None and not messages.noise.ideal
    lossy = messages.loss is not None and not messages.loss.ideal
    return noisy or bool(messages.resolution or messages.velocity_resolution), lossy


class _TrueLinks:
    """True links at rising instants, from the switches of a run."""

    def __init__(self, run: Run, world: LoggedWorld) -> None:
        self._switches, self._base = run.switches, world.base
        self._links = [links.copy() for links in world.first_links]
        self._both = [not graph.directed for graph in world.graphs]
        self._next = 0

    def at(self, instant: int) -> list[Links]:
        """Link matrix of each graph at an instant, in nanoseconds since the start."""
        t = self._base + (instant + 0.5) * NANOSECOND
        while self._next < len(self._switches) and self._switches["time"][self._next] <= t:
            _, i, j, kind, graph, *_ = self._switches[self._next].tolist()
            self._links[graph][i, j] = kind == "appear"
            if self._both[graph]:
                self._links[graph][j, i] = kind == "appear"
            self._next += 1
        return self._links
