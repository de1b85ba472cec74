"""An agent that runs exported C, called through cffi by the declarations of its own header."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from flocking.arrays import Array
from flocking.engine.c_export.header import STATUS
from flocking.engine.nodes.nodes import Node, Sample
from flocking.errors import EngineMissing, SimulationError, StorageError
from flocking.model.law import Scenario
from flocking.model.world.times import NANOSECOND

MISSING = "Agents that run exported C need the package cffi: pip install 'flocking[nodes]'."
"""Message where the package is not installed."""

OLD = [name for name, _ in STATUS].index("OLD")
"""The code that states that a newer sample is known."""


def declarations(header: str) -> str:
    """The types and functions of an exported header, its constants in place of their names.

    Parameters
    ----------
    header
        Text of the header.
    """
    numbers = dict(re.findall(r"^#define (\w+) (\d+)$", header, re.MULTILINE))
    text = re.sub(r"^#.*$", "", header, flags=re.MULTILINE)
    return re.sub(r"[A-Z]\w*", lambda name: numbers.get(name[0], name[0]), text)


def check_callable() -> None:
    """Check that agents of this machine can call exported C.

    Raises
    ------
    EngineMissing
        When cffi is not installed.
    """
    try:
        import cffi  # noqa: F401
    except ImportError:
        raise EngineMissing(MISSING) from None


class ExportedNode(Node):
    """An agent that runs exported C of double precision, see `flocking.export_c`.

    Parameters
    ----------
    scenario, agent
        As for `Node`.
    library
        The compiled law, a shared object, with its header ``law.h`` beside it.

    Raises
    ------
    EngineMissing
        When cffi is not installed.
    StorageError
        When there is no such library or header.
    """

    def __init__(self, scenario: Scenario, agent: int, library: Path) -> None:
        super().__init__(scenario, agent)
        check_callable()
        import cffi

        self._ffi: Any = cffi.FFI()
        try:
            self._ffi.cdef(declarations((library.parent / "law.h").read_text()))
            self._law: Any = self._ffi.dlopen(str(library))
        except OSError as error:
            raise StorageError(f"{library}: cannot load the exported law and its header law.h ({error}).") from None
        self._memory = self._ffi.new("law_memory *")
        self._message = self._ffi.new("law_message *")
        self._u = self._ffi.new("law_real[]", scenario.start.dimension)
        self._checked(self._law.law_begin(self._memory, agent), 0)

    def _checked(self, code: int, now: int) -> None:
        if code:
            name, meaning = STATUS[code]
            time = self.scenario.start.t + now * NANOSECOND
            raise SimulationError(f"The exported law answered LAW_{name}: {meaning}.", time=time, agents=(self.agent,))

    def link(self) -> None:
        """Take up the links of the start."""
        own = [self.scenario.start.q[self.agent].tolist()]
        if hasattr(self._memory, "p"):  # Agents look along their velocities.
            own.append(self.scenario.start.p[self.agent].tolist())
        self._checked(self._law.law_start(self._memory, 0, *own), 0)

    def hear(self, sample: Sample, now: int) -> None:
        """Keep a sample, if it is newer."""
        message = self._message
        message.stamp, message.number, message.sender = sample.stamp, sample.number, sample.sender
        message.q, message.p = list(sample.q), list(sample.p)
        code = self._law.law_receive(self._memory, now, message)
        self._checked(0 if code == OLD else code, now)

    def act(self, now: int, q: Sequence[float], p: Sequence[float]) -> Array:
        """The force by what is known now."""
        self._checked(self._law.law_control(self._memory, now, list(q), list(p), self._u), now)
        return np.array(list(self._u))

    @property
    def links(self) -> list[list[int]]:
        """Linked agents in each graph."""
        memory = self._memory
        slots = memory.order[0 : memory.count]
        return [[memory.known[s].sender for s in slots if words[s // 32] >> (s % 32) & 1] for words in memory.links]

    @property
    def filtered(self) -> tuple[bool, bool]:
        """What the safety filter did at the last tick."""
        return bool(getattr(self._memory, "filtered", 0)), bool(getattr(self._memory, "relaxed", 0))
