"""Parts written as the tables of a scenario file."""

from __future__ import annotations

from flocking.errors import InvalidInput
from flocking.study.scenario_files.scenario_kinds import Nested
from flocking.study.scenario_files.scenario_parts import GROUPS
from flocking.study.scenario_files.scenario_values import plain


class PartWriter:
    """Writes parts as tables; a graph or leader that stands in several places is written once, with a name."""

    def __init__(self) -> None:
        self.sections: dict[str, dict[str, object]] = {"graphs": {}, "leaders": {}}
        self._places: dict[int, int] = {}
        self._names: dict[int, str] = {}

    def count(self, group_name: str, part: object) -> None:
        """Note that ``part`` of the group ``group_name`` stands in one more place."""
        kind = GROUPS[group_name].kind_of(part)
        if kind is None:
            return
        self._places[id(part)] = self._places.get(id(part), 0) + 1
        for name, entry in kind.fields.items():
            if isinstance(entry.holds, Nested) and self._places[id(part)] == 1:
                inner = getattr(part, name)
                for value in inner if entry.holds.many else [inner]:
                    self.count(entry.holds.group, value)

    def table(self, group_name: str, part: object) -> object:
        """The table of a part of the group ``group_name``, or its name.

        Raises
        ------
        InvalidInput
            When files have no word for the part.
        """
        shared = GROUPS[group_name].names
        if shared is None or self._places.get(id(part), 0) < 2:
            return self._table(group_name, part)
        if id(part) not in self._names:
            section = self.sections[shared + "s"]
            name = f"{shared}_{len(section) + 1}"
            self._names[id(part)] = name
            section[name] = self._table(group_name, part)
        return self._names[id(part)]

    def _table(self, group_name: str, part: object) -> object:
        group = GROUPS[group_name]
        if group.short and isinstance(part, group.short.types):
            return plain(group.short.take(part))
        kind = group.kind_of(part)
        if kind is None:
            known = ", ".join(sorted({(k.written or k.part).__name__ for k in group.kinds}))
            raise InvalidInput(
                "write_scenario", group_name, f"must be a part that files have a word for ({known})", part,
                "Keep scenarios with parts of your own in Python.",
            )  # fmt: skip
        table: dict[str, object] = (
            {} if group.key is None or kind.word == group.default == "given" else {group.key: kind.word}
        )
        for name, value in kind.taken(part).items():
            holds = kind.fields[name].holds
            if value is None or (name == "parameters" and not value):
                continue
            if isinstance(holds, Nested):
                many = [self.table(holds.group, x) for x in value] if holds.many else None
                table[name] = self.table(holds.group, value) if many is None else many
            else:
                table[name] = plain(value)
        return table
