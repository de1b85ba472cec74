"""A misspelt field of a part is named, with the nearest field that it has."""

from __future__ import annotations

from dataclasses import make_dataclass

import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.potentials.bumps import Bump


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


@pytest.mark.parametrize("name", ["part", "id"])
def test_a_field_with_a_name_that_stored_runs_use_is_refused(name):
    kind = make_dataclass("Named", [(name, int)], bases=(fk.Graph,), frozen=True, namespace={"__module__": __name__})
    with pytest.raises(InvalidInput, match=f"Named.{name} must not be a name that stored runs use themselves"):
        fk.register_part("named")(kind)


@pytest.mark.parametrize("name", [5, None, b"run"])
def test_a_name_is_text(name):
    law = fk.Law(fk.Proximity(1.0), [fk.Consensus()])
    with pytest.raises(InvalidInput, match="Scenario: name must be text"):
        fk.Scenario(law, fk.State([[0.0, 0.0]]), t_end=1.0, name=name)
    with pytest.raises(InvalidInput, match="Energy: name must be text"):
        fk.Energy(name=name)
    with pytest.raises(InvalidInput, match="Bump: name must be text"):
        Bump(name, "where(z < k0, 1, 0)")


def test_right_names_positions_and_subclasses_stay():
    from dataclasses import dataclass

    @dataclass(frozen=True)
    class Wide(fk.Hysteresis):
        extra: float = 1.0

    assert fk.Hysteresis(4, gap=0.3) == fk.Hysteresis(radius=4, gap=0.3)
    assert Wide(4, 0.3, extra=2.0).extra == 2.0
    with pytest.raises(TypeError):
        fk.Hysteresis(1, 2, 3)
