"""Every deliberate fault of the native loop still applies; `loop_faults` tries which of them tests notice."""

import ast

import pytest

from tests.engine.exact.events.loop_faults import ENGINE, FAULTS, ROOT, Fault, changed


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_fault_changes_the_code_in_one_place(fault):
    before = ast.dump(ast.parse((ROOT / ENGINE / fault.file).read_text()))
    assert ast.dump(ast.parse(changed(fault))) != before


def test_a_fault_that_does_not_apply_is_told():
    with pytest.raises(ValueError, match="0 times"):
        changed(Fault("none", "blocks/loop.py", "no such text", ""))


def test_there_are_at_least_twenty_five():
    assert len({fault.name for fault in FAULTS}) == len(FAULTS) >= 25
