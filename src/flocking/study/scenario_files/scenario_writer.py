"""Writes parts as tables of a scenario file."""

from __future__ import annotations

import flocking.model.library  # noqa: F401  registers the parts of the library
from flocking.errors import InvalidInput
from flocking.model.parts.description import GROUPS, Description, Group, Nested
from flocking.model.parts.values import NAMED_NUMBERS, plain
from flocking.study.scenario_files.scenario_reader import inline_kind, sections


class PartWriter:
    """Writes parts as tables; a graph or leader used in several places is written once, as a named section."""

    def __init__(self) -> None:
        self.sections: dict[str, dict[str, object]] = {name: {} for name in sections()}
        self._places: dict[int, int] = {}
        self._names: dict[int, str] = {}

    def count(self, group_name: str, part: object) -> None:
        """Count one more use of ``part`` of the group ``group_name``."""
        kind = GROUPS[group_name].kind_of(part)
        if kind is None:
            return
        self._places[id(part)] = self._places.get(id(part), 0) + 1
        if self._places[id(part)] == 1:
            self.count_all(kind, part)

    def count_all(self, kind: Description, part: object) -> None:
        """Count the uses of the parts inside ``part``."""
        for name, value in kind.values_of(part).items():
            field = kind.fields[name]
            inner = inline_kind(field)
            if inner is not None:
                self.count_all(inner, value)
            elif isinstance(field.holds, Nested):
                for entry in value if isinstance(value, tuple) else (value,):
                    self.count(field.holds.group, entry)

    def table(self, group_name: str, part: object) -> object:
        """The table of a part of the group ``group_name``, or its name.

        Raises
        ------
        InvalidInput
            When the part has no name in files.
        """
        shared = GROUPS[group_name].names
        if shared is None or self._places.get(id(part), 0) < 2:
            return self._table(GROUPS[group_name], part)
        if id(part) not in self._names:
            section = self.sections[f"{shared}s"]
            name = f"{shared}_{len(section) + 1}"
            self._names[id(part)] = name
            section[name] = self._table(GROUPS[group_name], part)
        return self._names[id(part)]

    def _table(self, group: Group, part: object) -> object:
        if group.short and isinstance(part, group.short.types):
            return plain(group.short.take(part))
        kind = group.kind_of(part)
        if kind is None:
            known = ", ".join(sorted({k.builds.__name__ for k in group.kinds}))
            raise InvalidInput(
                "write_scenario", group.name, f"must be a part with a name in files ({known})", part,
                "Register its class with @fk.register_part, or build the scenario in Python.",
            )  # fmt: skip
        unnamed = group.key is None or kind.word == group.default == "given"
        return ({} if unnamed else {str(group.key): kind.word}) | self.fields(kind, part)

    def fields(self, kind: Description, part: object) -> dict[str, object]:
        """The table of a part without its name."""
        table: dict[str, object] = {}
        for name, value in kind.values_of(part).items():
            field = kind.fields[name]
            holds = field.holds
            inner = inline_kind(field)
            if value is None or (holds is NAMED_NUMBERS and not value) or not field.is_written(value):
                continue
            if inner is not None:
                table |= self.fields(inner, value)
            elif isinstance(holds, Nested) and holds.many and isinstance(value, tuple):
                table[name] = [self.table(holds.group, x) for x in value]
            elif isinstance(holds, Nested):
                table[name] = self.table(holds.group, value)
            else:
                table[name] = plain(holds.store(value))
        return table
