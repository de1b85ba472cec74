"""Challenges of the lab: a scenario, a goal, and a score that follows from the log and the recorded states."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache, partial

import numpy as np

from flocking.apps.lab.experiment.events import Event
from flocking.errors import InvalidInput
from flocking.model.checks import number
from flocking.model.law import Scenario
from flocking.model.leaders_and_obstacles.leaders import Sink
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.observables import flocks
from flocking.model.parts.structure import substituted, with_children
from flocking.model.serial import to_data
from flocking.model.state import State
from flocking.model.terms.avoidance import Avoid
from flocking.model.world.information import Delayed

GAP = 8.0
"""Distance between the two obstacles: little more than the spacing 7 of the paper's lattice."""
GAP_RADIUS, GAP_PLACE = 24.0, (120.0, 15.0)
"""Radius of the two obstacles, and the middle of the gap between them: in front of the middle of the start."""
GAP_AGENTS, GAP_BOX, GAP_END = 30, ((0.0, 0.0), (60.0, 30.0)), 60.0
"""Number of agents, corner and sides of where they begin, and the time in which they can pass."""
DELAY, LARGEST_DELAY, DELAY_END = 0.1, 5.0, 20.0
"""First delay, what delays must lie below, and the time within which the flock has to fall apart; conventions."""

CHALLENGE = "challenge: "
"""Beginning of the names by which pages open challenges."""

Entries = Sequence[tuple[float, Event]]


@dataclass(frozen=True)
class Score:
    """How a challenge stands.

    Parameters
    ----------
    reached
        Whether the goal is reached.
    value
        The score, less is better; infinite while it is not reached.
    words
        What was found.
    """

    reached: bool
    value: float
    words: str


@dataclass(frozen=True)
class Challenge:
    """A challenge.

    Parameters
    ----------
    title, goal
        What it is called, and what is to be done in a sentence.
    unit
        What the score is.
    make
        Makes its scenario.
    judge
        Judges the recorded states, ascending, and the log of the events.
    chosen
        What a player chooses before the run, by its name; None where there is nothing to choose.
    """

    title: str
    goal: str
    unit: str
    make: Callable[[], Scenario]
    judge: Callable[[Sequence[State], Entries], Score]
    chosen: tuple[str, float] | None = None


def _lattice() -> Scenario:
    from flocking.papers import paper

    return paper("olfati-saber-2003").scenarios()["olfati-saber-2003-free"](0)


def kick_score(states: Sequence[State], entries: Entries) -> Score:
    """Added speeds of all kicks until the flock falls apart at a recorded moment; other events end the challenge.

    Parameters
    ----------
    states
        Recorded states with links, ascending.
    entries
        The log.
    """
    other = next((str(event["kind"]) for _, event in entries if event["kind"] != "kick"), None)
    if other is not None:
        return Score(False, math.inf, f"only kicks count, and there was another intervention: {other}")
    apart = next((s.t for s in states if s.links is not None and flocks(s.links) > 1), None)
    if apart is not None and (not entries or apart < entries[0][0]):
        return Score(False, math.inf, "the flock fell apart before it was kicked")
    spent = sum(_spent(event) for t, event in entries if apart is None or t <= apart)
    if apart is None:
        return Score(False, math.inf, f"kicks of {spent:.4g} so far, and it holds together")
    return Score(True, spent, f"it fell apart by t = {apart:.4g} after kicks of {spent:.4g}")


def _spent(event: Event) -> float:
    """Sum of the speeds that a kick gives to its agents."""
    size = float(np.linalg.norm(event["velocity"])) if "velocity" in event else float(event["speed"])
    return len(event["agents"]) * size


@cache
def _gap() -> Scenario:
    from flocking.papers.olfati_saber_2003.system import obstacle_scenario

    scenario = obstacle_scenario(0, agents=GAP_AGENTS, box=GAP_BOX)
    avoid = next(term for term in scenario.law.terms if isinstance(term, Avoid))
    x, y = GAP_PLACE
    two = tuple(Ball(Sink([x, y + sign * (GAP_RADIUS + GAP / 2)]), GAP_RADIUS) for sign in (1, -1))
    narrowed: Scenario = substituted(scenario, avoid, with_children(avoid, {"obstacles": two}))
    return narrowed.with_(t_end=GAP_END, name="squeeze through 8")


def gap_score(states: Sequence[State], entries: Entries) -> Score:
    """Time until all agents are behind the two obstacles as one flock, none of them having been inside one.

    Only numbers of the law may be changed. What happens between recorded moments is not seen.

    Parameters
    ----------
    states
        Recorded states with links, ascending.
    entries
        The log.
    """
    if not all(_of_the_law(event) for _, event in entries):
        return Score(False, math.inf, "only the law may be changed, and there was another intervention")
    obstacles = [x for term in _gap().law.terms if isinstance(term, Avoid) for x in term.obstacles]
    end = GAP_PLACE[0] + GAP_RADIUS
    for state in states:
        inside = [i for o in obstacles for i in np.flatnonzero(o.distance(state.q, state.t) < 0)]
        if inside:
            return Score(False, math.inf, f"agent {inside[0]} was inside an obstacle at t = {state.t:.4g}")
        together = state.links is not None and flocks(state.links) == 1
        if state.n == GAP_AGENTS and (state.q[:, 0] > end).all() and together:
            return Score(True, state.t, f"all {state.n} had passed as one flock by t = {state.t:.4g}")
    passed = 0 if not states else int((states[-1].q[:, 0] > end).sum())
    return Score(False, math.inf, f"{passed} of {GAP_AGENTS} have passed")


def _of_the_law(event: Event) -> bool:
    """Whether an event changes a number or a formula of the law alone, and no obstacle."""
    path = [str(step) for step in event.get("path", ())]
    return event["kind"] in ("set", "scale") and path[:1] == ["law"] and "obstacles" not in path


def _late(delay: float) -> Scenario:
    """The lattice whose agents know everybody, themselves included, as they were a delay ago."""
    return _lattice().with_(information=Delayed(delay, self_delayed=True), t_end=DELAY_END, name=f"delay {delay:g}")


def delay_score(states: Sequence[State], entries: Entries, delay: float) -> Score:
    """The delay, where the flock falls apart at a recorded moment until `DELAY_END` without any intervention.

    Parameters
    ----------
    states
        Recorded states with links, ascending.
    entries
        The log.
    delay
        The delay of the run, from its start on.
    """
    if entries:
        return Score(
            False, math.inf, f"only the delay may be chosen, and there was an intervention: {entries[0][1]['kind']}"
        )
    seen = [s for s in states if s.t <= DELAY_END]
    apart = next((s.t for s in seen if s.links is not None and flocks(s.links) > 1), None)
    if apart is not None:
        return Score(True, delay, f"it fell apart by t = {apart:.4g}")
    if states and states[-1].t >= DELAY_END:
        return Score(
            False,
            math.inf,
            f"with a delay of {delay:g} it was one flock at every recorded moment until t = {DELAY_END:g}",
        )
    return Score(False, math.inf, f"with a delay of {delay:g} it holds together so far")


def challenge_of(name: str) -> Challenge:
    """The challenge of a name: its key, and behind an equals sign what the player has chosen.

    Parameters
    ----------
    name
        A key of `CHALLENGES`, or for example ``"delay = 0.2"``.

    Raises
    ------
    InvalidInput
        When there is no such challenge, or what is chosen breaks a rule.
    """
    key, sign, text = (part.strip() for part in name.partition("="))
    if key not in CHALLENGES:
        raise InvalidInput("lab", "challenge", f"must be one of {', '.join(CHALLENGES)}", key)
    if not sign:
        return CHALLENGES[key]
    if CHALLENGES[key].chosen is None:
        raise InvalidInput("lab", "challenge", "must be its key alone: nothing is chosen in it", name)
    try:
        delay = float(text)
    except ValueError:
        raise InvalidInput("lab", "delay", "must be a number", text) from None
    return _tearing(number("lab", "delay", delay, above=0.0, below=LARGEST_DELAY))


def _tearing(delay: float) -> Challenge:
    return Challenge(
        "Find the delay at which it tears",
        f"Thirty agents know everybody, themselves included, only as they were a delay ago. Find the smallest delay at "
        f"which the flock falls apart by t = {DELAY_END:g}, without touching it: the delay counts.",
        "delay", partial(_late, delay), partial(delay_score, delay=delay), ("delay", delay),
    )  # fmt: skip


def judged(key: str, original: Scenario, states: Sequence[State], entries: Entries) -> Score:
    """How a challenge stands; only a run that began with its scenario counts.

    Parameters
    ----------
    key
        Name of the challenge, as in `challenge_of`.
    original
        The scenario that the run began with.
    states
        Recorded states, ascending.
    entries
        The log.
    """
    if to_data(original) != _beginning(key):
        return Score(False, math.inf, "the run did not begin as the challenge does: reset it")
    return challenge_of(key).judge(states, entries)


@lru_cache(maxsize=8)
def _beginning(key: str) -> object:
    return to_data(challenge_of(key).make())


CHALLENGES = {
    "kick": Challenge(
        "Break it with the smallest kick",
        "Thirty agents hold each other. Kick one or several so that the flock falls apart: the speeds you add count.",
        "added speed", _lattice, kick_score,
    ),
    "gap": Challenge(
        "Squeeze through 8",
        "Thirty agents, 7 apart, must pass a gap of 8 and come out as one flock, none inside an obstacle. Change the "
        "law: the time they need counts.",
        "time", _gap, gap_score,
    ),
    "delay": _tearing(DELAY),
}  # fmt: skip
"""The challenges by their keys."""
