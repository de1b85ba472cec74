"""A term written outside the library, held against the same contracts as the library's own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import flocking as fk
from tests.contracts import contracts
from tests.contracts.strategies import Structure, case_of


@dataclass(frozen=True)
class ClosingSpeed(fk.PairTerm):
    """Resists approach and retreat alone: k (d|q_j - q_i|/dt) n_ij."""

    k: float

    @property
    def parameters(self):
        return {"k": self.k}

    @property
    def structure(self):
        return ("ClosingSpeed",)

    def along(self, x):
        return x.parameter("k") * x.radial

    def dissipation(self, x):
        return x.parameter("k") * x.radial**2


@dataclass(frozen=True)
class Favourite(ClosingSpeed):
    """One gain per agent, and yet it declares momentum and relabelling."""

    k: np.ndarray


@dataclass(frozen=True)
class Forgetful(ClosingSpeed):
    """Claims to dissipate twice what it does."""

    @property
    def structure(self):
        return ("Forgetful",)

    def dissipation(self, x):
        return 2 * super().dissipation(x)


def closing(term, i, j, q, p):
    n = (q[j] - q[i]) / np.linalg.norm(q[j] - q[i])
    return np.broadcast_to(term.k, len(q))[i] * ((p[j] - p[i]) @ n) * n


OWN = Structure(
    lambda d: fk.Law(d.proximity(), [d.zhou(), ClosingSpeed(d.one()), fk.Consensus(d.one())]),
    brute={ClosingSpeed: closing},
)
LYING = Structure(lambda d: fk.Law(d.proximity(), [Favourite(d.each())]), brute={Favourite: closing})


@settings(max_examples=12)
@given(st.integers(1, 6), st.sampled_from([1, 2, 3]), st.integers(0, 2**32))
def test_an_own_term_keeps_every_contract(n, m, seed):
    case = case_of(OWN, n, m, seed)
    assert len(case.law.symmetries) == 5
    contracts.declared(case)
    contracts.gradient(case)
    contracts.brute_force(case)
    contracts.alone(case)
    contracts.power(case, fk.Energy("centre of mass"))


@pytest.mark.parametrize("contract", ["momentum", "relabelling"])
def test_a_term_that_lies_about_its_symmetries_is_caught(contract):
    caught = 0
    for seed in range(10):
        case = case_of(LYING, 6, 2, seed)
        assert contract in case.law.symmetries
        contracts.brute_force(case)
        try:
            contracts.CONTRACTS[contract](case)
        except AssertionError:
            caught += 1
    assert caught >= 7


def test_what_a_term_misstates_as_dissipated_is_refused():
    state = fk.State([[0.0, 0], [1, 0.5]], [[0.0, 1], [-1, 2]])
    assert fk.evaluate(fk.Law(fk.Proximity(3), [ClosingSpeed(1.5)]), state).supply == 0
    with pytest.raises(fk.InvalidInput, match="Forgetful: dissipation must be that of the stated forces; got '2 times"):
        fk.Law(fk.Proximity(3), [Forgetful(1.5)])
