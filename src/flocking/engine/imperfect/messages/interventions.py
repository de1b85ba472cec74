"""Changes of a running session: how messages are sent, and the numbers and terms of the law."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import MalformedError
from flocking.engine.imperfect.messages.knowledge import Knowledge
from flocking.engine.imperfect.messages.leader_news import Replaced
from flocking.engine.protocol.session import Packed
from flocking.errors import FlockingError, InvalidInput, UnsupportedLaw
from flocking.model.law import Law, Scenario
from flocking.model.leaders_and_obstacles.leaders import Leader
from flocking.model.serial import from_data, to_data
from flocking.model.world.information import Information, Messages

MOST_CHANGES = 10_000
"""Changes of the settings of messages that a checkpoint may name, a bound on memory."""

KEPT = ("period", "phase", "predict", "leader")
"""Parameters of messages that stay as they are while a run goes on, for samples that were taken have their times."""


@dataclass
class Interventions:
    """What was changed while a session went on.

    Parameters
    ----------
    times
        When, in the scenario's time.
    leaders
        Leaders known by messages that others have replaced, in order.
    """

    times: list[float] = field(default_factory=list)
    leaders: list[Replaced] = field(default_factory=list)


def check_information(
    engine: str, scenario: Scenario, information: Information, kept: tuple[str, ...] = KEPT
) -> Scenario:
    """The scenario with other ``information``, if a running session can change to it.

    Parameters
    ----------
    engine
        Name of the engine, for messages.
    scenario
        The scenario of the session.
    information
        How messages are to be sent from now on.
    kept
        Parameters of `Messages` that stay as they are.

    Raises
    ------
    UnsupportedLaw
        When times of samples, or what agents make of them, would change.
    InvalidInput
        When it does not fit the scenario.
    """
    present = scenario.information
    if not isinstance(present, Messages) or not isinstance(information, Messages):
        raise UnsupportedLaw(
            f"engine={engine!r} changes while a run goes on how messages are sent, not whether they are. Start with "
            "information=Messages(...)."
        )
    if not _alike(present, information, kept):
        raise UnsupportedLaw(
            f"engine={engine!r} keeps {', '.join(kept[:-1])} and {kept[-1]} of Messages while a run goes on: samples "
            "that were taken have their times. Start another run from run.state(-1)."
        )
    return scenario.with_(information=information)


def check_law_change(scenario: Scenario, law: Law) -> Scenario:
    """The scenario with another ``law``, if a running session can change to it.

    Raises
    ------
    UnsupportedLaw
        When its graphs are others.
    InvalidInput
        When it does not fit the scenario.
    """
    if tuple(law.graphs) != tuple(scenario.law.graphs):
        raise UnsupportedLaw(
            "engine='sampled' keeps the graphs of a law while a run goes on: links depend on earlier samples. "
            "Start another run from run.state(-1)."
        )
    return scenario.with_numbers(law, scenario.t_end)


def no_energy(energy: float) -> InvalidInput:
    """The error of a law that cannot replace another one because its ``energy`` is not finite."""
    return InvalidInput(
        "SampledSession", "law", "must have a finite energy", energy,
        "Two neighbours, or an agent and an obstacle, are where a potential is infinite: replace it once they are "
        "elsewhere.",
    )  # fmt: skip


def _alike(one: Messages, other: Messages, kept: tuple[str, ...] = KEPT) -> bool:
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in kept)


def packed_changes(found: Interventions, knowledge: Knowledge) -> Packed:
    """What a checkpoint holds of interventions; nothing where there were none.

    Parameters
    ----------
    found
        The interventions.
    knowledge
        What agents know.
    """
    if not found.times:
        return {}, {}
    sent = [to_data(each) for each in knowledge.settings[:-1]]
    data: dict[str, object] = {"changed": list(found.times), "sent": sent}
    if found.leaders:
        data["led"] = [[each.until, [to_data(leader) for leader in each.leaders]] for each in found.leaders]
    arrays: Arrays = {"since": np.array(knowledge.since, dtype=np.int64).reshape(-1, knowledge.n)}
    return data, arrays


def unpacked_changes(packed: Packed, found: Interventions, knowledge: Knowledge) -> Packed:
    """Restore what `packed_changes` gave, and return the rest of what was packed.

    Parameters
    ----------
    packed
        What was read.
    found, knowledge
        Those of a session at its start.

    Raises
    ------
    MalformedError
        When it is not of this session.
    """
    data, arrays = packed
    if "changed" not in data:
        return packed
    rest = {name: value for name, value in data.items() if name not in ("changed", "sent", "led")}
    times, sent, since = data["changed"], data.get("sent"), arrays.get("since")
    left = {name: value for name, value in arrays.items() if name != "since"}
    if not (isinstance(times, list) and isinstance(sent, list) and len(times) + len(sent) <= MOST_CHANGES):
        raise MalformedError("changed must be the times of interventions")
    if not all(type(t) is float and np.isfinite(t) for t in times):
        raise MalformedError("changed must be the times of interventions")
    if not (isinstance(since, np.ndarray) and since.dtype == np.int64 and since.shape == (len(sent), knowledge.n)):
        raise MalformedError("since must have a row for every change of messages")
    taken = arrays.get("taken")
    rows = np.concatenate([np.zeros((1, knowledge.n), dtype=np.int64), since])
    if not isinstance(taken, np.ndarray) or taken.shape != (knowledge.n,):
        raise MalformedError("taken must be a number of samples for each agent")
    if not (
        (since <= taken).all() and (np.diff(rows, axis=0) >= 0).all() and (np.diff(rows, axis=0) > 0).any(axis=1).all()
    ):
        raise MalformedError("since must ascend to the samples that were taken")
    messages = [_messages(each, knowledge) for each in sent]
    knowledge.recall(messages, list(since))
    found.times = times
    found.leaders[:] = _leaders(data.get("led", []), int(taken.min()), knowledge.m)
    return rest, left


def _leaders(data: object, taken: int, dimension: int) -> list[Replaced]:
    """Leaders that others have replaced.

    Parameters
    ----------
    data
        What was read.
    taken
        How many samples were taken.
    dimension
        Number of axes.
    """
    if not isinstance(data, list) or len(data) > MOST_CHANGES:
        raise MalformedError("led must hold leaders that were replaced")
    found: list[Replaced] = []
    for each in data:
        fits = isinstance(each, list) and len(each) == 2 and type(each[0]) is int and isinstance(each[1], list)
        if not fits or not (found[-1].until if found else 0) <= each[0] <= taken:
            raise MalformedError("led must hold leaders, each until a sample that was taken")
        try:
            leaders = tuple(from_data(one) for one in each[1])
        except FlockingError as error:
            raise MalformedError(f"led must hold leaders ({error})") from None
        if not all(isinstance(leader, Leader) and leader.dimension == dimension for leader in leaders):
            raise MalformedError("led must hold leaders of the dimension of the scenario")
        if found and len(leaders) != len(found[-1].leaders):
            raise MalformedError("led must hold as many leaders each time")
        found.append(Replaced(each[0], leaders))
    return found


def _messages(data: Mapping[str, object] | object, knowledge: Knowledge) -> Messages:
    try:
        found = from_data(data)
    except FlockingError as error:
        raise MalformedError(f"sent must hold messages ({error})") from None
    if not isinstance(found, Messages) or knowledge.messages is None or not _alike(found, knowledge.messages):
        raise MalformedError("sent must hold messages of the times of this session")
    found.check_count(knowledge.n)
    return found
