"""Equation tables are read from files; what is wrong in one is said with the paper and the statement."""

from __future__ import annotations

import pytest

from flocking.papers import paper
from flocking.papers.equation_files import rows_of
from flocking.papers.equation_table import Fault
from flocking.papers.shi_2009.system import SETTINGS

PACKAGE, KEY = "flocking.papers.tanner_2003_fixed", "tanner-2003-fixed"
PLAIN = {"number": "(1)", "kind": "equation", "title": "t", "home": "flocking.model.law.Law",
         "example": "examples.energy_of"}  # fmt: skip
WRONG = {
    "statement (1): unknown key titel; the keys are": {**PLAIN, "titel": "t"},
    "statement (1): lacks home": {k: v for k, v in PLAIN.items() if k != "home"},
    "statement without a number: lacks number": {k: v for k, v in PLAIN.items() if k != "number"},
    "statement (1): title must be text": {**PLAIN, "title": 1},
    "statement (1): also must be text": {**PLAIN, "also": ["(2)", 3]},
    "statement (1): no function examples.nothing for example": {**PLAIN, "example": "examples.nothing"},
    "statement (1): no function counterexamples.nothing for counterexample": {
        **PLAIN, "counterexample": "counterexamples.nothing", "reading": "so",
    },
    "statement (1): same_reading_as is (0), which must be an earlier": {**PLAIN, "same_reading_as": "(0)"},
    "'wrong' is not a valid Fault": {**PLAIN, "fault": "wrong", "reading": "so"},
    "(1): a false statement needs a counter-example": {**PLAIN, "fault": "false statement", "reading": "so"},
}  # fmt: skip


@pytest.mark.parametrize("sentence", WRONG)
def test_a_wrong_statement_is_refused_with_its_place(sentence: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011
        rows_of([WRONG[sentence]], PACKAGE, KEY)
    assert sentence in str(caught.value)


def test_a_statement_is_read_with_its_functions_and_their_arguments() -> None:
    from flocking.papers.tanner_2003_fixed import counterexamples, examples

    first = {**PLAIN, "fault": "false statement", "reading": "so", "counterexample": "counterexamples.speed_bound"}
    second = {**PLAIN, "number": "(2)", "same_reading_as": "(1)", "also": ["(3)"], "example": "examples.picture_of",
              "example_arguments": {"number": 3}}  # fmt: skip
    one, two = rows_of([first, second], PACKAGE, KEY)
    assert (one.build, one.demonstration, one.fault) == (
        examples.energy_of,
        counterexamples.speed_bound,
        Fault.FALSE,
    )
    assert (two.paper, two.reading, two.also, two.fault) == (KEY, "so", ("(3)",), Fault.READING)
    assert two.build.__closure__ is not None
    assert 3 in [cell.cell_contents for cell in two.build.__closure__]


def test_the_rows_of_the_table_of_shi_say_what_the_settings_hold() -> None:
    rows = {row.number: row.title for row in paper("shi-2009").equations()}
    for setting in SETTINGS.values():
        if setting.figure:
            connected = "connected" if setting.connected else "disconnected"
            assert rows[f"Table 1 Fig. {setting.figure}"] == (
                f"law ({setting.law}), velocity known to {setting.velocity}, acceleration to {setting.acceleration}, "
                f"{connected}"
            )
