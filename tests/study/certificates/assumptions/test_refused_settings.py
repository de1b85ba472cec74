"""Settings beside those of a theorem, one for each hypothesis: the certificate is not given, and says which fails."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk

POLE = fk.Gradient(fk.Potential("1/r + r"))
ALIGN = fk.Consensus(1.0)
SQUARE = fk.Gradient(fk.Potential("r**2/2"))
START = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], np.zeros((3, 2)))
BASE = fk.Scenario(fk.Law(fk.Proximity(3.0), [POLE, ALIGN]), START, t_end=1.0)
STILL = fk.Velocity([0.0, 0.0], start=[0.0, 0.0])
FIRST = {"agents": fk.SingleIntegrator()}


def law(*terms: object, graph: fk.Graph | None = None) -> dict[str, fk.Law]:
    return {"law": fk.Law(graph or fk.Proximity(3.0), terms)}


def far_link() -> fk.State:
    """The third agent is 9 away from the first, to which the start links it."""
    links = ~np.eye(3, dtype=bool)
    return fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 9.0]], np.zeros((3, 2)), links=links)


ONE_WAY = fk.Fixed(3, ((0, 1), (1, 2), (2, 0)), directed=True)
FILTER = fk.SafetyFilter(0.1, distance=0.5, acceleration=5.0, form="stopping")
CASES: dict[str, tuple[str, dict[str, object], dict[str, object], str]] = {
    "one pursuit for all": (
        "largest_energy", law(POLE, fk.Track(STILL, 1.0)), law(POLE, fk.Track(STILL, 1.0, shared=True)),
        "shared or saturated"),
    "a saturated pursuit": (
        "largest_energy", law(POLE, fk.Track(STILL, 1.0)), law(POLE, fk.Track(STILL, 1.0, saturated=True)),
        "shared or saturated"),
    "a pursuit of order 1": ("largest_energy", law(POLE) | FIRST, law(POLE, fk.Track(STILL, 1.0)) | FIRST, "order 1"),
    "a link beyond the radius": ("largest_energy", {}, {"start": far_link()}, "linked beyond the radius"),
    "another potential": (
        "decay_rate", law(SQUARE, ALIGN, graph=fk.Complete()), law(POLE, ALIGN, graph=fk.Complete()), "is not c r^2"),
    "no alignment": (
        "decay_rate", law(SQUARE, ALIGN, graph=fk.Complete()), law(SQUARE, graph=fk.Complete()), "nothing decays"),
    "links that break": (
        "alignment_rate", law(fk.CuckerSmale(1.0, 0.3), graph=fk.Complete()), law(fk.CuckerSmale(1.0, 0.3)),
        "links by Proximity break"),
    "one-way links of an alignment": (
        "alignment_rate", law(fk.CuckerSmale(1.0, 0.3), graph=fk.Complete()),
        law(fk.CuckerSmale(1.0, 0.3), graph=ONE_WAY), "lacks a pair"),
    "one-way links": (
        "steady_drift", law(ALIGN, graph=fk.Complete()), law(ALIGN, graph=ONE_WAY), "links are directed"),
    "far from the origin": (
        "safe_distance", {"control": FILTER}, {"control": FILTER, "start": fk.State(START.q + 1e11, START.p)},
        "rounding errors of all ticks"),
    "a filter of continuous time": (
        "safe_distance", {"control": FILTER},
        {"control": fk.SafetyFilter(0.1, distance=0.5, acceleration=5.0, form="continuous")}, "held forces"),
}  # fmt: skip
"""Key of a certificate, changes with which it is given, changes with which it is not, and words of the reason."""


@pytest.mark.parametrize("case", CASES)
def test_beside_its_setting_a_certificate_is_not_given(case: str) -> None:
    key, given, refused, words = CASES[case]
    assert fk.certify(BASE.with_(**given))[key].granted
    found = fk.certify(BASE.with_(**refused))[key]
    assert not found.granted
    assert words in found.reason
