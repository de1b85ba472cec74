"""The residual of the ledger of a fixed step: what explains it, and when it is too large."""

from __future__ import annotations

import pytest

from flocking.engine.fixed_step.step_checks import check_ledger
from flocking.errors import StepTooLarge

FIRST = (0.0, 10.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Time, energy, kinetic energy, work, dissipated, supplied, jumped and departed at the start."""


def checked(*, energy: float, departed: float = 0.0, rounded: float = 0.0) -> float:
    """What a check allows for rounding after 2 of the energy have been dissipated."""
    last = (1.0, energy, 4.0, 0.0, 2.0, 0.0, 0.0, departed)
    return check_ledger(0.1, FIRST, last, order=2, rounding=0.0, time=1.0, of_places=lambda: rounded)


def test_what_departs_is_part_of_the_balance() -> None:
    assert checked(energy=8.0) == 0.0
    assert checked(energy=9.0, departed=1.0) == 0.0
    assert checked(energy=7.0, departed=-1.0) == 0.0
    for energy, departed in ((9.0, 0.0), (8.0, 1.0), (9.0, -1.0)):
        with pytest.raises(StepTooLarge, match="unexplained"):
            checked(energy=energy, departed=departed)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_twice_the_rounding_of_places_explains_a_residual_and_no_more(sign: float) -> None:
    energy = 8.0 + sign
    assert checked(energy=energy, rounded=0.51) == 0.51
    with pytest.raises(StepTooLarge, match="leaves 10 % of the energy unexplained"):
        checked(energy=energy, rounded=0.49)
