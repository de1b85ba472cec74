from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from tests.contracts import contracts
from tests.contracts.strategies import STRUCTURES, case_of, laws

EACH = pytest.mark.parametrize("name", STRUCTURES)
SEEDS = st.integers(0, 2**32)
FEW = settings(max_examples=4)


@EACH
@FEW
@given(n=st.integers(1, 7), m=st.sampled_from([1, 2, 3]), seed=SEEDS)
def test_declared_symmetries_are_kept(name, n, m, seed):
    contracts.declared(case_of(STRUCTURES[name], n, m, seed))


@EACH
@FEW
@given(n=st.integers(1, 5), m=st.sampled_from([1, 2, 3]), seed=SEEDS)
def test_forces_descend_the_storage(name, n, m, seed):
    contracts.gradient(case_of(STRUCTURES[name], n, m, seed))


@EACH
@FEW
@given(n=st.integers(1, 7), m=st.sampled_from([1, 2, 3]), seed=SEEDS)
def test_two_plain_loops_agree(name, n, m, seed):
    case = case_of(STRUCTURES[name], n, m, seed)
    contracts.brute_force(case)
    contracts.alone(case)


@EACH
@pytest.mark.parametrize("frame", ["lab", "centre of mass", "leader"])
@FEW
@given(n=st.integers(1, 6), seed=SEEDS)
def test_power_balances(name, frame, n, seed):
    case = case_of(STRUCTURES[name], n, 2, seed)
    leader = None
    if frame == "leader":
        leader = case.law.leaders[0] if case.law.leaders else fk.Path(["sin(t)", "t^2"])
    contracts.power(case, fk.Energy(frame, leader))


@settings(max_examples=60)
@given(laws(smallest=2))
def test_any_law_keeps_what_it_declares(case):
    contracts.declared(case)
    contracts.brute_force(case)


def undeclared(structure: str, contract: str) -> int:
    """On how many of 20 seeds a law that does not declare a symmetry breaks it."""
    broken = 0
    for seed in range(20):
        case = case_of(STRUCTURES[structure], 6, 2, seed)
        assert contract not in case.law.symmetries
        try:
            contracts.CONTRACTS[contract](case)
        except AssertionError:
            broken += 1
    return broken


@pytest.mark.parametrize(
    ("structure", "contract"),
    [
        ("agent gains", "momentum"), ("uneven weights", "momentum"), ("directed", "momentum"),
        ("velocity leader", "galilean"), ("sink", "galilean"), ("path leader", "galilean"),
        ("compensated", "galilean"), ("shared feedback", "locality"), ("hashed weights", "relabelling"),
        ("agent gains", "relabelling"), ("sink, masses, agent gains", "relabelling"), ("sink", "rotation"),
        ("sink", "momentum"),
    ],
)  # fmt: skip
def test_what_a_law_does_not_declare_it_breaks(structure, contract):
    assert undeclared(structure, contract) >= 10


def test_fk_control_is_evaluate():
    case = case_of(STRUCTURES["shi"], 6, 3, 1)
    assert (fk.control(case.law, case.state, agents=case.agents) == contracts.evaluated(case).u).all()


def test_memory_decides_who_is_linked():
    law = fk.Law(fk.Hysteresis(2.0, 0.5), [fk.Gradient(fk.Potential("r"))])
    q = [[0.0], [1.7]]
    none = np.zeros((2, 2), dtype=bool)
    assert fk.control(law, fk.State(q)).ravel().tolist() == [1, -1]
    assert fk.control(law, fk.State(q, links=none)).ravel().tolist() == [0, 0]


def test_a_law_that_needs_the_group_cannot_be_computed_alone():
    case = case_of(STRUCTURES["shared feedback"], 3, 2, 0)
    with pytest.raises(fk.InvalidInput, match="centre of mass"):
        fk.control_of(case.law, fk.Agent([0, 0], [0, 0]), [])
