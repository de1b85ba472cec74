"""How a part is written in a scenario file: kinds, the groups they belong to, and what they may refer to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from flocking.model.graphs.distance_graphs import Graph
from flocking.study.scenario_files.scenario_values import RefusedError, Value


@dataclass
class Context:
    """What the parts of one file may refer to while they are built.

    Parameters
    ----------
    most_agents
        Largest number of agents allowed.
    named
        Parts with names, by group.
    law_graph
        The law's graph; None while it is unknown or wrong.
    """

    most_agents: int
    named: dict[str, dict[str, object]] = field(default_factory=lambda: {"graph": {}, "leader": {}})
    law_graph: Graph | None = None

    def check_agents(self, n: int, at: str) -> None:
        """Refuse more agents than allowed."""
        if n > self.most_agents:
            raise RefusedError(
                f"must be at most {self.most_agents} agents",
                f"Pass most_agents={n} (--most-agents {n}) if you mean it.",
                (at,),
            )


@dataclass(frozen=True)
class Nested:
    """A field that holds a part of another group, or ``many``."""

    group: str
    many: bool = False


@dataclass(frozen=True)
class Field:
    """A field of a part's table: what it ``holds`` and whether it is ``required``."""

    holds: Value | Nested
    required: bool = False


def need(holds: Value | Nested) -> Field:
    """A field that must be given and ``holds`` such values."""
    return Field(holds, required=True)


def may(holds: Value | Nested) -> Field:
    """A field that may be left out; the part's own default then holds."""
    return Field(holds)


@dataclass(frozen=True)
class Kind:
    """How one part is written in a file.

    Parameters
    ----------
    word
        Value of the group's key that names the part.
    part
        Class or function called with the fields.
    fields
        Fields by name; by default the names of the part's own attributes and arguments.
    build
        Makes the part from checked fields, where calling it does not do.
    take
        Fields of a part as its table holds them, where reading its attributes does not do.
    written
        Class of the parts that are written as this kind; None for a kind that is only read.
    """

    word: str
    part: Callable[..., Any]
    fields: Mapping[str, Field]
    build: Callable[[dict[str, Any], Context], Any] | None = None
    take: Callable[[Any], dict[str, Any]] | None = None
    written: type | None = None

    def make(self, given: dict[str, object], context: Context) -> Any:
        """The part with the given fields."""
        return self.build(given, context) if self.build else self.part(**given)

    def taken(self, part: object) -> dict[str, Any]:
        """Fields of ``part``."""
        return self.take(part) if self.take else {name: getattr(part, name) for name in self.fields}


@dataclass(frozen=True)
class Short:
    """A way to write a part without a table.

    Parameters
    ----------
    value
        What stands in the file.
    make
        The part it means.
    types
        Types of the parts that are written so.
    take
        What is written of such a part.
    """

    value: Value
    make: Callable[[Any], Any]
    types: tuple[type, ...]
    take: Callable[[Any], Any] = lambda part: part


@dataclass(frozen=True)
class Group:
    """Kinds that may stand in the same place.

    Parameters
    ----------
    kinds
        The kinds.
    key
        Key of the table that names the kind; None where there is only one.
    default
        The kind meant when the key is absent.
    names
        Which parts with names may stand here, ``"graph"`` or ``"leader"``; None for none.
    short
        A number, text or list that may stand in place of a table.
    """

    kinds: tuple[Kind, ...]
    key: str | None = "kind"
    default: str | None = None
    names: str | None = None
    short: Short | None = None

    def kind_of(self, part: object) -> Kind | None:
        """The kind that writes ``part``, None where files have no word for it."""
        return next((k for k in self.kinds if type(part) is (k.written or k.part)), None)
