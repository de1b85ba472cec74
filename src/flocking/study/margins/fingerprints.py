"""Digests of scenarios, by which results on the disk are known to be those of the runs that are asked for."""

from __future__ import annotations

import json

from flocking.model.law import Scenario
from flocking.model.serial import ForeignPart, to_data
from flocking.study.sweeps.recorded_content import content_of, digest_of


def fingerprint(scenario: Scenario) -> str:
    """What distinguishes scenarios that differ in more than the seed they name.

    Parts that are not registered are described by their fields and the code of their classes; what their code calls
    is not.

    Parameters
    ----------
    scenario
        The scenario.
    """
    return digest_of(_text(scenario.with_(seed=None)))


def has_foreign_parts(scenario: Scenario) -> bool:
    """Whether parts of a scenario are not registered, so that equal descriptions do not prove them equal."""
    try:
        to_data(scenario)
    except ForeignPart:
        return True
    return False


def _text(scenario: Scenario) -> str:
    try:
        return json.dumps(to_data(scenario), sort_keys=True)
    except ForeignPart:
        return content_of(scenario)
