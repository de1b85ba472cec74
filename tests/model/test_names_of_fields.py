"""A misspelt field of a part is named, with the nearest field that it has."""

from __future__ import annotations

import pytest

import flocking as fk
from flocking.errors import InvalidInput


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: fk.Hysteresis(raduis=4, gap=0.3), "Hysteresis: raduis is no parameter; got 4. Did you mean 'radius'?"),
        (lambda: fk.Consensus(gian=1), "Did you mean 'gain'?"),
        (lambda: fk.Track([1.0, 0.0], velocity_gian=1), "Did you mean 'velocity_gain'?"),
        (lambda: fk.Smooth(1.0, 0.5, bmup="cosine"), "Did you mean 'bump'?"),
        (lambda: fk.PointMass(mass=2.0), "Did you mean 'masses'?"),
        (lambda: fk.Law(grpah=1, terms=[]), "Did you mean 'graph'?"),
    ],
)
def test_a_wrong_name_gets_a_hint(make, told):
    with pytest.raises(InvalidInput) as error:
        make()
    assert told in str(error.value)


def test_right_names_positions_and_subclasses_stay():
    from dataclasses import dataclass

    @dataclass(frozen=True)
    class Wide(fk.Hysteresis):
        extra: float = 1.0

    assert fk.Hysteresis(4, gap=0.3) == fk.Hysteresis(radius=4, gap=0.3)
    assert Wide(4, 0.3, extra=2.0).extra == 2.0
    with pytest.raises(TypeError):
        fk.Hysteresis(1, 2, 3)
