"""The fidelity of a run as plain data for its record, and that of runs stored before there was one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict

from flocking.engine.archives.data_checks import Flag, Form, Integer, Maybe, Names, Real, Text
from flocking.engine.runs.fidelity import LEDGER_RULES, WATCHED, Approaches, Fidelity, LawAgreement, LedgerRule
from flocking.engine.runs.message_log import CHANGED
from flocking.engine.runs.run_errors import json_number
from flocking.model.law import Scenario

FIXED_STEP_SHARE = 0.05
"""Share of the energy moved that bounds the residual of stored runs with fixed steps which state none."""


_WORDS = ("inf", "-inf", "nan")


class _Number(Form[float]):
    """A number, or the text of one that JSON cannot hold."""

    def check(self, value: object, name: str) -> float:
        """Refuse what is no number."""
        return float(value) if isinstance(value, str) and value in _WORDS else float(Real().check(value, name))


_LATER: dict[str, Form[object]] = {"position_error": _Number(), "velocity_error": _Number(), "changed": Flag()}
"""What runs stored by earlier versions state in their provenance alone."""

_FORM = Names({
    "engine": Text(), "sampled": Flag(), "switches_located": Flag(),
    "approaches": Names({"pairs": Text(WATCHED), "error": Maybe(_Number()), "looked": Text()}),
    "ledger": Names(
        {"kind": Text(LEDGER_RULES), "size": _Number(), "switch_error": _Number()}, {"rounding": _Number()}
    ),
    "fixed_step": Maybe(_Number()),
    "law": Maybe(Names({"checks": Integer(), "gap": _Number(), "allowed": _Number()})),
}, _LATER)  # fmt: skip


def fidelity_data(found: Fidelity) -> dict[str, object]:
    """The fidelity ``found`` as plain data."""
    return {name: _plain(value) for name, value in asdict(found).items()}


def _plain(value: object) -> object:
    if isinstance(value, dict):
        return {name: _plain(x) for name, x in value.items()}
    return json_number(value) if isinstance(value, float) else value


def fidelity_of(data: object, provenance: Mapping[str, object], scenario: Scenario) -> Fidelity:
    """The fidelity of a stored run.

    Parameters
    ----------
    data
        What `fidelity_data` gave; None for a run that was stored without.
    provenance
        Where the run comes from.

    Raises
    ------
    MalformedError
        When the data are malformed.
    """
    if data is None:
        return derived_fidelity(provenance, scenario)
    _FORM.check(data, "fidelity")
    assert isinstance(data, dict)
    near, ledger, law, step = (data[name] for name in ("approaches", "ledger", "law", "fixed_step"))
    error = near["error"]
    earlier = _stated_in(provenance)
    position_error, velocity_error = (
        float(data.get(name, x)) for name, x in zip(("position_error", "velocity_error"), earlier[:2], strict=True)
    )
    return Fidelity(
        data["engine"], data["sampled"], data["switches_located"],
        Approaches(near["pairs"], None if error is None else float(error), near["looked"]),
        LedgerRule(
            ledger["kind"], float(ledger["size"]), float(ledger["switch_error"]), float(ledger.get("rounding", 0.0))
        ),
        None if step is None else float(step),
        None if law is None else LawAgreement(law["checks"], float(law["gap"]), float(law["allowed"])),
        position_error, velocity_error, data.get("changed", earlier[2]),
    )  # fmt: skip


def _stated_in(provenance: Mapping[str, object]) -> tuple[float, float, bool]:
    """Errors of samples, and whether the run was changed, as the ``provenance`` of an earlier version has them."""

    def size(name: str) -> float:
        value = provenance.get(name, 0.0)
        if isinstance(value, int | float) and not isinstance(value, bool) and value >= 0.0:
            return float(value)
        return math.nan

    return size("position_error"), size("velocity_error"), bool(provenance.get(CHANGED))


def derived_fidelity(provenance: Mapping[str, object], scenario: Scenario) -> Fidelity:
    """The fidelity of a run that was stored without, from its ``provenance``.

    Its keys: engine ``samples`` means samples from elsewhere, whose ``gap``, ``ledger_error`` and ``switch_error`` are
    estimated errors; ``scheme`` means fixed steps of at most ``step``; ``farthest`` means an engine that checks linked
    pairs at every step, between which two agents approach each other by at most that length; ``closest`` states when
    distances were checked; ``switches`` that they are not recorded; ``law_checks``, ``law_gap`` and ``law_gap_allowed``
    how far forces were from the law; ``position_error`` and ``velocity_error`` errors of samples; ``changed at`` when
    the run was changed. A number that is missing is not known, but samples without errors are exact.
    """

    def number(name: str) -> float:
        value = provenance.get(name)
        return float(value) if isinstance(value, int | float) else math.nan

    engine = str(provenance.get("engine", ""))
    sampled, fixed = engine == "samples", "scheme" in provenance
    if sampled:
        approaches = Approaches("all", number("gap"))
        ledger = LedgerRule("estimate", number("ledger_error"), number("switch_error"))
    else:
        if "farthest" in provenance:
            approaches = Approaches("linked", number("farthest"))
        elif "closest" in provenance:
            approaches = Approaches("all", math.nan, str(provenance["closest"]))
        else:
            approaches = Approaches("all", None)
        tolerance = number("tolerance") if "tolerance" in provenance else scenario.tolerance
        ledger = LedgerRule("share", FIXED_STEP_SHARE) if fixed else LedgerRule("tolerance", tolerance)
    law = None
    if "law_gap" in provenance:
        checks = provenance.get("law_checks", 0)
        law = LawAgreement(checks if isinstance(checks, int) else 0, number("law_gap"), number("law_gap_allowed"))
    return Fidelity(
        engine, sampled, not sampled and provenance.get("switches") != "not recorded", approaches, ledger,
        number("step") if fixed else None, law, *_stated_in(provenance),
    )  # fmt: skip
