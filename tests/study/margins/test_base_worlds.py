"""What tables say of the world in which nothing of a quantity is varied, where a share of the runs is enough."""

from __future__ import annotations

from dataclasses import replace

import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.study.margins.brackets import Count
from flocking.study.margins.margin_table import Margins, Varied
from flocking.study.margins.quantities import Quantity, default_levels, quantity_named, register_quantity

LAW = fk.Law(fk.Fixed.complete(2), [fk.Consensus(1.0)])


def table_of(counts: dict[float, Count], share: float) -> Margins:
    """The table of one conclusion, ``agree``, and one quantity, ``loss``."""
    one = Varied("loss", "how many", "lossy", {"agree": counts}, base="control held for 0.1")
    return Margins("five", {"agree": "."}, {"agree": Count(5)}, (one,), {}, share, 0.1, 0.95, (0, 1, 2, 3, 4), 20,
                   "finished")  # fmt: skip


@pytest.mark.parametrize(("share", "said"), [(1.0, True), (0.9, True), (0.8, False), (0.5, False)])
def test_what_enough_runs_show_at_0_is_not_said_to_be_refuted_there(share: float, *, said: bool) -> None:
    """Four of five runs show it at 0: for a share of 0.8 that is shown, whatever the fifth one does."""
    table = table_of({0.0: Count(4, 1), 0.1: Count(1, 4)}, share)
    assert table.rows[0].bracket.upper == (0.0 if said else 0.1)
    assert any("refuted at 0 already" in note for note in table.notes) == said


def test_a_level_that_enough_runs_show_is_not_the_first_that_is_not() -> None:
    """Open at 0.1, shown by four of five at 0.2, refuted by all at 0.4: for a share of 0.8 it is not shown at 0.4."""
    counts = {0.1: Count(2, 0, 3), 0.2: Count(4, 1), 0.4: Count(0, 5)}
    shown, beyond = ("not known, open at 0.1", "2 show it, 3 open", ""), ("0.4", "5 refute it", "0.2")
    assert table_of(counts, 0.8).cells[0][2:] == shown + beyond
    assert table_of(counts, 1.0).cells[0][5:7] == ("0.2", "4 show it, 1 refute it")


def test_quantities_of_which_nothing_is_varied_elsewhere_than_at_0_are_refused() -> None:
    """Smaller levels are nearer to the ideal world, and tables name the level 0."""
    loss, limit = quantity_named("loss"), quantity_named("limit")
    for wrong in (replace(loss, unvaried=1.0), replace(loss, unvaried=-1.0), replace(limit, unvaried=0.0)):
        with pytest.raises(InvalidInput, match="register_quantity: unvaried must be"):
            register_quantity(wrong)
    assert quantity_named("loss") is loss
    assert quantity_named("limit") is limit


@pytest.mark.parametrize("period", [0.1, 0.22, 0.45, 4.5])
def test_the_grid_of_delays_has_more_than_none(period: float) -> None:
    made = fk.Scenario(LAW, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=4.0, control=fk.Held(period))
    levels = default_levels(quantity_named("delay"), made, period)
    assert levels[0] == 0.0
    assert len(levels) > 1


def test_a_grid_of_nothing_but_the_value_at_which_nothing_is_varied_is_refused() -> None:
    made = fk.Scenario(LAW, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=4e-9, control=fk.Held(1e-9))
    short = Quantity("half", "m", lambda s, v, p: s, lambda s, p: (0.0, p / 2), resolution=1e-9, unvaried=0.0)
    with pytest.raises(InvalidInput, match="none is a whole multiple"):
        default_levels(short, made, 1e-9)


def test_the_grid_of_velocity_noise_of_a_group_at_rest_follows_the_units() -> None:
    def levels(length: float, time: float) -> list[float]:
        start = fk.State([[0.0, 0.0], [length, 0.0]])
        made = fk.Scenario(LAW, start, t_end=4.0 * time, control=fk.Held(0.1 * time))
        return default_levels(quantity_named("velocity-noise"), made, 0.1 * time)

    usual = levels(1.0, 1.0)
    assert [x * 1e3 for x in levels(1e-6, 1e-3)] == pytest.approx(usual)
