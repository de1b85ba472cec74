"""Makes parts from the tables of a scenario file, by their descriptions; reports every fault with its place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import cast

import flocking.model.library  # noqa: F401  registers the parts of the library
from flocking.engine.interruption import interrupted
from flocking.errors import InvalidInput
from flocking.model.checks import StandIn, collecting
from flocking.model.graphs.distance_graphs import Graph
from flocking.model.law import Scenario
from flocking.model.parts import values
from flocking.model.parts.description import (
    CONNECTED,
    CONNECTED_UNDER,
    DRAW_TIME,
    GROUPS,
    MOST_AGENTS,
    Description,
    Field,
    Group,
    Nested,
    registered_names,
)
from flocking.model.parts.values import MOST_PAIRWISE, RefusedError, Value, nearest
from flocking.model.state import State
from flocking.study.scenario_files.problems import Path, Problem, place_of, shown

FORMAT = values.Value(lambda given: _format(given), {"const": 1})


class Faulty:
    """Takes the place of a part that has faults."""


FAULTY = Faulty()


def sections() -> dict[str, Group]:
    """Sections of named parts, and their groups."""
    return {f"{g.name}s": g for g in GROUPS.values() if g.names == g.name}


def scenario_fields() -> dict[str, Field]:
    """Fields of a scenario file, besides the sections of named parts."""
    first = Field("format", "format", FORMAT, required=False)
    return {"format": first, **flat_fields(registered_names()[Scenario.__name__])}


def flat_fields(kind: Description) -> dict[str, Field]:
    """Fields of a part's table: its own, and those of parts that it holds inline."""
    found: dict[str, Field] = {}
    for name, field in kind.fields.items():
        inner = inline_kind(field)
        found |= {name: field} if inner is None else flat_fields(inner)
    return found


def inline_kind(field: Field) -> Description | None:
    """The part whose fields are in the table of its owner, where a field holds such a part."""
    holds = field.holds
    if not (isinstance(holds, Nested) and holds.inline):
        return None
    return registered_names()[GROUPS[holds.group].base.__name__]


def drawn_tables(data: Mapping[str, object]) -> Iterator[dict[str, object]]:
    """Tables of a file that describe random draws."""
    fields = scenario_fields()
    places = [(field.holds.group, data.get(name)) for name, field in fields.items() if isinstance(field.holds, Nested)]
    for section, group in sections().items():
        named = data.get(section, {})
        places += [(group.name, table) for table in named.values()] if isinstance(named, dict) else []
    for name, table in places:
        group = GROUPS[name]
        if isinstance(table, dict) and group.key is not None:
            word = table.get(group.key, group.default)
            kind = group.kind_named(word) if isinstance(word, str) else None
            if (kind is not None and kind.drawn) or (kind is None and "draw" in table):
                yield table


def seeded_tables(data: Mapping[str, object]) -> Iterator[tuple[str, dict[str, object]]]:
    """Tables of parts with a seed, such as draws, messages and gusts, at any depth, each with its path in the file."""
    for name, field in scenario_fields().items():
        yield from _seeded(field.holds, data.get(name), name)
    for section, group in sections().items():
        named = data.get(section, {})
        for name, table in named.items() if isinstance(named, dict) else ():
            yield from _seeded_part(group, table, f"{section}.{name}")


def _seeded(holds: Value | Nested, data: object, path: str) -> Iterator[tuple[str, dict[str, object]]]:
    if isinstance(holds, Nested):
        places = [(f"{path}[{k}]", table) for k, table in enumerate(data)] if isinstance(data, list) else [(path, data)]
        for place, table in places:
            yield from _seeded_part(GROUPS[holds.group], table, place)


def _seeded_part(group: Group, table: object, path: str) -> Iterator[tuple[str, dict[str, object]]]:
    if not isinstance(table, dict):
        return
    word = None if group.key is None else table.get(group.key, group.default)
    kind = group.kinds[0] if group.key is None else group.kind_named(word) if isinstance(word, str) else None
    if kind is None:
        return
    fields = flat_fields(kind)
    if "seed" in fields:
        yield path, table
    for name, field in fields.items():
        yield from _seeded(field.holds, table.get(name), f"{path}.{name}")


def _format(value: object) -> int:
    if isinstance(value, bool) or value != 1:
        raise RefusedError("must be 1, the only format")
    return 1


class Reader:
    """Reads the tables of one file.

    Parameters
    ----------
    most_agents
        Largest number of agents allowed.
    """

    def __init__(self, most_agents: int) -> None:
        self.problems: list[Problem] = []
        self._most_agents = most_agents
        self._named: dict[str, dict[str, object]] = {group.name: {} for group in sections().values()}
        self._law_graph: Graph | None = None
        self._used: set[tuple[str, str]] = set()

    def read(self, data: Mapping[str, object]) -> dict[str, object]:
        """The fields of a scenario by name, without those that have faults."""
        self._read_sections(data)
        fields = scenario_fields()
        for name in data:
            if name not in fields and name not in sections():
                self._report((name,), "is not known here", fix=nearest(name, [*fields, *sections()]))
        found: dict[str, object] = {}
        for name, field in fields.items():
            if name not in data:
                if field.required:
                    self._report((name,), "must be given")
                continue
            value = self.value(field.holds, data[name], (name,))
            if not isinstance(value, Faulty):
                found[name] = value
            if name == "graph" and isinstance(value, Graph):
                self._law_graph = value
        if not self.problems:
            self._report_unused()
        return found

    def _report_unused(self) -> None:
        """Report named parts that no other part names: they would be left out of the scenario."""
        for section, group in sections().items():
            for name in self._named[group.name]:
                if (group.name, name) not in self._used:
                    self._report((section, name), "is named by no part", fix=f"Name it as {name!r}, or remove it.")

    def _read_sections(self, data: Mapping[str, object]) -> None:
        for section, group in sections().items():
            tables = data.get(section, {})
            if not isinstance(tables, dict):
                self._report((section,), "must be a table of named parts", tables)
                continue
            for name, table in tables.items():
                self._named[group.name][name] = self._part(group, table, (section, name))

    def _report(self, path: Path, rule: str, given: object = None, fix: str = "") -> Faulty:
        self.problems.append(Problem(place_of(path), rule, "" if given is None else shown(given), fix))
        return FAULTY

    def _refused(self, refused: RefusedError, value: object, path: Path) -> Faulty:
        for step in refused.at:
            value = _inside(value, step)
        given = None if isinstance(value, dict) else value
        return self._report((*path, *refused.at), refused.rule, given, refused.fix)

    def value(self, holds: Value | Nested, data: object, path: Path) -> object:
        """What a field holds, or `Faulty`."""
        if isinstance(holds, Value):
            try:
                return holds.check(data)
            except RefusedError as refused:
                return self._refused(refused, data, path)
        group = GROUPS[holds.group]
        if not holds.many:
            return self._part(group, data, path)
        if holds.most is not None and not (isinstance(data, list) and 1 <= len(data) <= holds.most):
            return self._report(path, f"must be a list of 1 to {holds.most} tables", data)
        if not isinstance(data, list):
            return self._report(path, "must be a list of tables", data)
        parts = [self._part(group, table, (*path, k)) for k, table in enumerate(data)]
        # The valid terms of a law are still checked against the agents.
        return parts if holds.most is not None or not _any_faulty(parts) else FAULTY

    def _part(self, group: Group, data: object, path: Path) -> object:
        if isinstance(data, dict):
            kind = self._kind(group, data, path)
            return FAULTY if kind is None else self.table(kind, group.key, data, path)
        if isinstance(data, str) and group.names is not None:
            return self._by_name(group.names, data, path)
        if group.short is None:
            return self._report(path, "must be a table", data)
        try:
            return group.short.make(group.short.value.check(data))
        except RefusedError as refused:
            return self._refused(refused, data, path)
        except InvalidInput as error:
            return self._report(path, error.rule, error.value, error.fix)

    def _kind(self, group: Group, data: Mapping[str, object], path: Path) -> Description | None:
        if group.key is None:
            return group.kinds[0]
        word = data.get(group.key, group.default)
        place = (*path, group.key)
        if word is None:
            self._report(place, "must be given")
        elif not isinstance(word, str):
            self._report(place, "must be text in quotes", word)
        else:
            kind = group.kind_named(word)
            if kind is not None:
                return kind
            self._report(place, "is not known", word, nearest(word, [k.word or "" for k in group.kinds]))
        return None

    def _by_name(self, group: str, name: str, path: Path) -> object:
        known = self._named[group]
        if name not in known:
            fix = nearest(name, known) if known else f"There is no section [{group}s.{name}]."
            return self._report(path, f"must be the name of a section of [{group}s]", name, fix)
        self._used.add((group, name))
        return known[name]

    def table(self, kind: Description, key: str | None, data: Mapping[str, object], path: Path) -> object:
        """The part of a table whose ``key`` names it, or `Faulty`.

        Faults of single fields are reported together with values of the others that are out of range.
        """
        fields = flat_fields(kind)
        for name in data:
            if name not in fields and name != key:
                self._report((*path, name), "is not known here", fix=nearest(name, fields) if fields else "")
        faults = len(self.problems)
        given: dict[str, object] = {}
        unknown = any(name not in fields and name != key for name in data)
        for name, field in fields.items():
            if name not in data:
                if field.required:
                    self._report((*path, name), "must be given")
                    given[name] = FAULTY
            else:
                given[name] = self.value(field.holds, data[name], (*path, name))
                self._count(field, given[name], data[name], (*path, name))
        wrong = [name for name, value in given.items() if isinstance(value, Faulty)]
        if not wrong and len(self.problems) == faults:
            built = self._built(kind, given, data, path)
            return FAULTY if unknown else built
        for name in wrong:
            if fields[name].required and fields[name].holds is not values.NUMBER:
                return FAULTY  # without it the part cannot be built to find further faults
            given[name] = StandIn(1.0)
        if kind.own_fields:
            rest = {name: value for name, value in given.items() if name not in wrong or fields[name].required}
            self._out_of_range(kind, rest, path)
        return FAULTY

    def _count(self, field: Field, value: object, data: object, path: Path) -> None:
        holds = field.holds
        if not isinstance(holds, Value) or holds.agents is None or isinstance(value, Faulty):
            return
        n = holds.agents(data)
        if n > self._most_agents:
            fix = f"Pass most_agents={n} (--most-agents {n}) if you mean it."
            self._report(path, f"must be at most {self._most_agents} agents", data if isinstance(data, int) else n, fix)
        elif holds.pairwise:
            self._count_pairwise(n, path)

    def _count_pairwise(self, n: int, path: Path) -> bool:
        if n > MOST_PAIRWISE:
            self._report(path, f"must be at most {MOST_PAIRWISE} agents here: every pair is evaluated", n)
        return n <= MOST_PAIRWISE

    def _built(self, kind: Description, given: dict[str, object], data: Mapping[str, object], path: Path) -> object:
        if given.get(CONNECTED) is True and CONNECTED_UNDER in kind.arguments:
            n = given.get("n", 0)
            if not self._count_pairwise(n if isinstance(n, int) else 0, (*path, "n")):
                return FAULTY
        faults: list[InvalidInput] = []
        try:
            with collecting() as faults:
                part = self._made(kind, given)
        except RefusedError as refused:
            return self._refused(refused, data, path)
        except InvalidInput as error:
            # Errors that follow from a substitute for a wrong number are not faults of the file.
            faults = faults or [error]
        except Exception as error:
            if interrupted(error):
                raise KeyboardInterrupt from None
            # Files are untrusted: any error of a part becomes a fault of the file.
            return self._report(path, f"cannot be used ({type(error).__name__}: {error})")
        if not faults:
            return part
        return self._report_all(kind, faults, path)

    def _out_of_range(self, kind: Description, given: dict[str, object], path: Path) -> None:
        faults: list[InvalidInput] = []
        try:
            with collecting() as faults:
                self._made(kind, given)
        except Exception as error:
            if interrupted(error):
                raise KeyboardInterrupt from None
        self._report_all(kind, faults, path)

    def _report_all(self, kind: Description, faults: Sequence[InvalidInput], path: Path) -> Faulty:
        fields = flat_fields(kind)
        for error in faults:
            known = error.parameter in fields
            rule = error.rule if known else f"{error.parameter} {error.rule}"
            given = None if isinstance(error.value, dict) else error.value
            self._report((*path, error.parameter) if known else path, rule, given, error.fix)
        return FAULTY

    def _made(self, kind: Description, given: Mapping[str, object]) -> object:
        arguments: dict[str, object] = {}
        for name, field in kind.fields.items():
            inner = inline_kind(field)
            if inner is not None:
                arguments[name] = inner.make({k: given[k] for k in flat_fields(inner) if k in given})
            elif name in given and (kind.own_fields or name in kind.arguments):
                arguments[name] = given[name]
        if MOST_AGENTS in kind.arguments:
            arguments[MOST_AGENTS] = self._most_agents
        if given.get(CONNECTED) and CONNECTED_UNDER in kind.arguments:
            arguments[CONNECTED_UNDER] = self._law_graph
        part = kind.make(arguments)
        if DRAW_TIME in given and isinstance(part, State) and DRAW_TIME not in kind.arguments:
            part = replace(part, t=cast(float, given[DRAW_TIME]))
        return part


def _any_faulty(parts: Sequence[object]) -> bool:
    return any(isinstance(part, Faulty) for part in parts)


def _inside(value: object, step: str | int) -> object:
    if isinstance(value, dict):
        return value.get(step)
    return value[step] if isinstance(value, list) and isinstance(step, int) and step < len(value) else None
