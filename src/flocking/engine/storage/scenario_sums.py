"""Checksums of all of a scenario, by which one is known again whose parts are not from this library.

A scenario of the library's own parts is stored as text. Parts from elsewhere are stored by their fields, if they are
registered, or not at all: their formulas and their code are nowhere in the folder of a run.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping
from typing import TypedDict

from flocking.engine.storage.foreign_code import code_of, python_version
from flocking.errors import FlockingError
from flocking.formula.origins import canonical
from flocking.model.law import Law, Scenario
from flocking.model.serial import described_data


class ScenarioSums(TypedDict):
    """Checksums of a scenario.

    Parameters
    ----------
    fields
        Of each field of the scenario, by name.
    formulas
        Of the formulas of its law, energy and bodies; 0 where they have none.
    code
        Of the byte code of its classes and functions from outside this library.
    python
        Version of Python of that byte code, as ``"3.12"``.
    """

    fields: dict[str, int]
    formulas: int
    code: int
    python: str


def scenario_sums(scenario: Scenario) -> ScenarioSums | None:
    """Sums of a scenario; None where it has no parts from outside this library.

    Parameters
    ----------
    scenario
        The scenario.
    """
    return _sums(scenario, scenario.law, scenario)


def plant_sums(scenario: Scenario, plant: Law) -> ScenarioSums | None:
    """Sums of the law that the agents of a scenario follow in place of its own; None where it has no such parts.

    Parameters
    ----------
    scenario
        The scenario.
    plant
        The law.
    """
    return _sums(scenario, plant, plant)


def _sums(scenario: Scenario, law: Law, part: Scenario | Law) -> ScenarioSums | None:
    kinds: list[Callable[..., object]] = []
    described = described_data(part, kinds.append)
    if not kinds:
        return None
    assert isinstance(described, dict)
    # Of equal names those first that are described first.
    code = [code_of(kind) for kind in sorted(dict.fromkeys(kinds), key=_name)]
    fields = {name: _sum(value) for name, value in described.items()}
    return {
        "fields": fields,
        "formulas": _sum(_formulas(scenario, law)),
        "code": _sum(code),
        "python": python_version(),
    }


def stored_sums(scenario: Scenario, plant: Law | None) -> dict[str, ScenarioSums]:
    """Sums for the record of a run: ``sums`` and ``plant_sums``, each where there are parts from outside this library.

    Parameters
    ----------
    scenario, plant
        The scenario, and the law that agents follow, if it is another.
    """
    found = {"sums": scenario_sums(scenario), "plant_sums": None if plant is None else plant_sums(scenario, plant)}
    return {name: sums for name, sums in found.items() if sums is not None}


def unlike(found: ScenarioSums | None, stored: Mapping[str, object], *, code: bool) -> str:
    """What of a scenario is not as it was when a run was made, in words; empty where all is.

    Parameters
    ----------
    found
        Sums of the scenario as it is now; None where it has no parts from outside this library.
    stored
        Sums that were stored with the run.
    code
        Whether byte code counts, where Python has the same version.
    """
    if found is None:
        return "its parts"
    fields = stored.get("fields")
    known = fields if isinstance(fields, dict) else {}
    others = [name for name in sorted({*found["fields"], *known}) if found["fields"].get(name) != known.get(name)]
    if others:
        return ", ".join(others)
    if found["formulas"] != stored.get("formulas"):
        return "formulas"
    if code and stored.get("python") == found["python"] and found["code"] != stored.get("code"):
        return "the code of its classes"
    return ""


def _name(kind: Callable[..., object]) -> tuple[str, str]:
    """Module and name of a class or function, by which they are sorted."""
    return str(getattr(kind, "__module__", "")), str(getattr(kind, "__qualname__", ""))


def _formulas(scenario: Scenario, law: Law) -> str:
    from flocking.engine.kernels.expressions import law_formulas
    from flocking.engine.kernels.layout import Layout

    layout = Layout(law, scenario.energy, scenario.agents, scenario.space, steering=True)
    try:
        return canonical(law_formulas(layout, scenario.start.dimension))
    except FlockingError:  # Steering in discrete time needs none.
        return ""


def _sum(value: object) -> int:
    return zlib.crc32(json.dumps(value).encode())
