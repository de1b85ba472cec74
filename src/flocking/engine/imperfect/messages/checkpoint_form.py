"""What agents know by messages in a checkpoint: its arrays, and what must follow from the schedule of the messages."""

from __future__ import annotations

import numpy as np

from flocking.arrays import Indices
from flocking.engine.archives.archive import Arrays
from flocking.engine.archives.data_checks import Form, Table
from flocking.engine.imperfect.checkpoint_form import LARGEST, MOST_COUNT, must
from flocking.engine.imperfect.messages.knowledge import Knowledge
from flocking.engine.imperfect.messages.samples import FIRST_ROOM, START
from flocking.model.world.times import Instants

MOST_NEWER = 32
"""Newer samples of each sender that are looked at: none of them may have arrived."""


def vectors(*shape: int | None) -> Table:
    """The form of an array of numbers that can be squared, of a ``shape``; None stands for any length."""
    return Table("f8", shape, least=-LARGEST, most=LARGEST)


def knowledge_arrays(knowledge: Knowledge) -> Arrays:
    """What agents know as named arrays, but their links.

    Parameters
    ----------
    knowledge
        What they know.
    """
    arrays: Arrays = {
        "newest": knowledge.newest, "taken": knowledge.taken, "sample_rows": knowledge.samples.rows,
        "sample_distances": knowledge.samples.distances,
    }  # fmt: skip
    if knowledge.errors is not None:
        arrays["noise"] = knowledge.errors
    return arrays


def recall_knowledge(knowledge: Knowledge, arrays: Arrays) -> None:
    """Take what `knowledge_arrays` gave, after its checks.

    Parameters
    ----------
    knowledge
        That of a session at its start.
    arrays
        What was read.
    """
    knowledge.newest, knowledge.taken = arrays["newest"], arrays["taken"]
    knowledge.samples.rows, knowledge.samples.distances = arrays["sample_rows"], arrays["sample_distances"]
    knowledge.errors = arrays.get("noise")


def knowledge_forms(knowledge: Knowledge) -> tuple[dict[str, Form[object]], dict[str, Form[object]]]:
    """Forms of what `knowledge_arrays` gives: of what is always there, and of what may be.

    Parameters
    ----------
    knowledge
        That of a session at its start.
    """
    n, m, shown = knowledge.n, knowledge.m, knowledge.n if knowledge.reads_distances else 0
    always: dict[str, Form[object]] = {
        "taken": Table("i8", (n,), least=0, most=MOST_COUNT),
        "newest": Table("i8", (n, n), least=START, most=MOST_COUNT),
        "sample_rows": vectors(None, n, 2 * m),
        "sample_distances": Table("f8", (None, shown, shown), least=0.0, most=LARGEST),
    }
    return always, {"noise": vectors(n, 2 * m)} if knowledge.draws_errors else {}


def check_samples(arrays: Arrays, knowledge: Knowledge) -> None:
    """Refuse arrays that lack samples in use, or name samples that were not taken.

    Parameters
    ----------
    arrays
        What was read, of the forms of `knowledge_forms`.
    knowledge
        That of a session at its start.

    Raises
    ------
    MalformedError
        When they do; the message names the array.
    """
    newest, taken, n = arrays["newest"], arrays["taken"], knowledge.n
    room = len(arrays["sample_rows"])
    doubled = room >= FIRST_ROOM and room & (room - 1) == 0
    must(doubled, "sample_rows", f"have room for {FIRST_ROOM} times a power of 2")
    must(len(arrays["sample_distances"]) == room, "sample_distances", "have as much room as sample_rows")
    others = ~np.eye(n, dtype=bool)
    must((newest[~others] == START).all(), "newest", "hold no samples of an agent itself")
    must((newest < np.maximum(taken, 0)[None]).all(), "newest", "name samples that were taken")
    oldest = np.where(others, newest, taken).min(axis=0)
    must((taken - 1 - np.maximum(oldest, 0) < room).all(), "newest", "name samples that are kept")
    must(("noise" in arrays) == (knowledge.draws_errors and bool(taken.any())), "noise",
         "be there where samples have errors")  # fmt: skip


def check_newest(arrays: Arrays, knowledge: Knowledge, agents: Indices, times: Instants) -> None:
    """Refuse arrays whose newest samples are not those that had arrived.

    Parameters
    ----------
    arrays
        What was read, after `check_samples`.
    knowledge
        That of a session at its start, whose distances become those of the arrays.
    agents
        The receivers that are looked at.
    times
        When each of them last took what had arrived, in nanoseconds, shape (agents,).

    Raises
    ------
    MalformedError
        When there is another one.
    """
    newest, taken, n = arrays["newest"], arrays["taken"], knowledge.n
    receiver, sender = (x.ravel() for x in np.broadcast_arrays(agents[:, None], np.arange(n)))
    time, known = np.repeat(times, n), newest[agents].ravel()
    knowledge.samples.distances = arrays["sample_distances"]
    for further in range(MOST_NEWER):
        k = known + further
        asked = np.flatnonzero((receiver != sender) & (k > START) & (k < taken[sender]))
        arrived = knowledge.has_arrived(receiver[asked], sender[asked], k[asked], time[asked])
        must((arrived == (further == 0)).all(), "newest", "name the newest samples that have arrived")
