"""Potentials and what is said of their shape, whole: capped ones, definitions, nonsmooth analysis, link histories."""

from __future__ import annotations

import inspect
import itertools
import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from flocking.engine.driver.simulate import simulate
from flocking.errors import InvalidInput
from flocking.model.graphs.distance_graphs import Fixed, Proximity
from flocking.model.law import Law, Scenario
from flocking.model.potentials.potential import Potential
from flocking.model.state import State
from flocking.model.terms.pair_terms import Consensus, Gradient
from flocking.papers.potential_definitions import definitions as known_definitions
from flocking.study.evidence import Evidence, NotResolvable
from flocking.study.potentials import nonsmooth
from flocking.study.potentials.potential_check import check_potential

R = 2.0
SLOPE = 2 / R - 2 / R**3


def potential():
    r = np.array([0.3, 1.0, 2.0, 3.5])
    found = Potential("k/r + 1/(R - r) + r**2", k=2.0, R=4.0)
    assert_allclose(found(r), 2 / r + 1 / (4 - r) + r**2, rtol=1e-12)
    assert_allclose(found.slope(r), -2 / r**2 + 1 / (4 - r) ** 2 + 2 * r, rtol=1e-10)
    assert_allclose(found.curvature(r), 4 / r**3 + 2 / (4 - r) ** 3 + 2, rtol=1e-10)
    assert found.with_parameters(k=3.0).parameters == {"k": 3.0, "R": 4.0}
    assert math.isinf(float(found(0.0)))
    assert found.kinks() == ()
    assert found == Potential("k/r + 1/(R - r) + r**2", k=2.0, R=4.0)
    assert float(Potential("7")(np.array(1.0))) == 7.0
    capped()
    # By powers of 0 and 1 alone a derivative is 0 times infinity where the base is zero.
    line = Potential("k*(r - 1)**n + k*r**2", k=3.0, n=1)
    assert_allclose(line.curvature([0.5, 1.0, math.nan]), [6.0, 6.0, math.nan])
    assert_allclose(Potential("(r - 1)**n + r", n=0).slope([0.5, 1.0]), [1.0, 1.0])
    assert_allclose(Potential("sqrt(r - 1)")([0.5, 2.0]), [math.nan, 1.0])


def capped():
    r = np.array([0.5, 1.0, 1.999, 2.0, 2.5, 9.0])
    for psi, value in ((Potential("1/r**2 + log(r**2)"), lambda x: 1 / x**2 + math.log(x**2)),
                       (Potential("cap*r**2", cap=3.0), lambda x: 3 * x**2)):  # fmt: skip
        found = psi.capped(2.0)
        assert_allclose(found(r), [value(min(x, 2.0)) for x in r], rtol=1e-12)
        assert_allclose(found.slope(np.array([2.5, 9.0])), 0.0, atol=1e-15)
        assert_allclose(found.kinks(), [2.0], rtol=1e-12)


PROPERTIES = (
    "defined", "unique minimum", "nonnegative", "infinite at 0", "infinite at R", "smooth at R", "increasing near R",
    "radially unbounded", "smooth (C2) for r > 0",
)  # fmt: skip
ASKED = {
    "tanner-2003-fixed": ("differentiable", "nonnegative", "radially unbounded", "infinite at 0", "unique minimum"),
    "tanner-2003-dynamic": ("nonnegative", "infinite at 0", "unique minimum", "increasing near R"),
    "shi-2009": ("differentiable", "nonnegative", "infinite at 0", "unique minimum", "zero slope beyond R"),
    "zhou-2015": ("nonnegative", "unique minimum", "infinite at 0", "infinite at R"),
}
"""Items of each paper's definition of a potential."""


def verdicts(text):
    return tuple({"T": True, "F": False, "-": None}[c] for c in text.replace(" ", ""))


def definitions():
    """Six potentials whose properties follow by calculus, and which definitions they meet."""
    known = known_definitions()
    tanner = Potential("1/r**2 + log(r**2)")
    zhou = Potential("1/r + 1/(R - r)", R=4.0)
    cases = (
        (tanner, None, "TTTT---TT", ("TTTTT", "TTT-", "TTTT-", "TTT-"), None),
        (tanner.capped(2.0), 2.0, "TTTTFFTFF", ("FTFTT", "TTTT", "FTTTT", "TTTF"), 2.0),
        (zhou, None, "TTTTTFTFF", ("FFFTF", "TTTT", "FFTFF", "TTTT"), 4.0),
        (Potential("(r - 1)**2"), 3.0, "TTTFFTTTT", ("TTTFT", "TFTT", "TTFTF", "TTFF"), 3.0),
        (Potential("-1/r"), 3.0, "TFFFFTTFT", ("TFFFF", "FFFT", "TFFFF", "FFFF"), 3.0),
        (Potential("r**2"), 3.0, "TFTFFTTTT", ("TTTFF", "TFFT", "TTFFF", "TFFF"), 3.0),
    )
    for psi, radius, properties, items, judged_at in cases:
        found = check_potential(psi, radius=radius, definitions=tuple(known.values()))
        assert found.potential is psi
        assert found.radius == judged_at
        assert tuple(row.name for row in found.rows) == PROPERTIES
        assert tuple(row.holds for row in found.rows) == verdicts(properties), psi
        for definition, (key, names), wanted in zip(found.definitions, ASKED.items(), items, strict=True):
            assert definition.key == key
            assert tuple(row.name for row in definition.rows) == names
            assert tuple(row.holds for row in definition.rows) == verdicts(wanted), (psi, key)
    # Real below R alone, and so not on all r > 0.
    part = check_potential("1/r + sqrt(4 - r)", radius=3.0, definitions=[known["tanner-2003-fixed"]])
    assert part.rows[0].holds
    assert not part.definitions[0].rows[0].holds
    only = check_potential(tanner, definitions=[known["zhou-2015"]]).definitions
    assert [d.key for d in only] == ["zhou-2015"]
    assert "r = 1" in check_potential("1/r**2 + log(r**2)").rows[1].explanation


def kinked():
    """A concave kink at 2, a convex one at 3, smooth elsewhere."""
    return Potential("where(r < 2, 2*r, where(r < 3, 4, 4 + 5*(r - 3)))")


def gradients():
    psi = kinked()
    for r, ends in ((1.0, (2.0, 2.0)), (2.0, (0.0, 2.0)), (2.5, (0.0, 0.0)), (3.0, (0.0, 5.0)), (4.0, (5.0, 5.0))):
        assert_allclose(nonsmooth.generalized_gradient(psi, r), ends, atol=1e-6)
        for w in (1.0, -1.0, 0.5, -3.0):
            assert_allclose(nonsmooth.generalized_derivative(psi, r, w), max(w * ends[0], w * ends[1]), atol=1e-5)
            side = {2.0: (2.0, 0.0), 3.0: (0.0, 5.0)}.get(r, ends)
            assert_allclose(nonsmooth.directional_derivative(psi, r, w), w * side[w > 0], atol=1e-5)
        assert nonsmooth.is_regular(psi, r) == (r != 2.0)
    curved = Potential("1/r**2 + log(r**2)")
    for r in (0.3, 1.0, 2.0):
        assert_allclose(nonsmooth.generalized_gradient(curved, r), [-2 / r**3 + 2 / r] * 2, rtol=1e-8, atol=1e-8)
        assert nonsmooth.is_regular(curved, r)
    assert_allclose(nonsmooth.generalized_gradient(curved.capped(R), R), (0.0, SLOPE), atol=1e-8)


Q = np.array([[0.0, 0.0], [R, 0.0], [0.0, R], [0.6, 0.9]])
P = np.array([[-0.4, 0.1], [0.3, -0.2], [0.2, 0.5], [0.7, 0.3]])


def plain(r):
    return -2 / r**3 + 2 / r


def control(linked, gain=1.3):
    u = np.zeros((4, 2))
    for i, j in itertools.permutations(range(4), 2):
        if (min(i, j), max(i, j)) in linked:
            d = math.dist(Q[i], Q[j])
            u[i] += plain(d) * (Q[j] - Q[i]) / d + gain * (P[j] - P[i])
    return u


def switching():
    psi = Potential("1/r**2 + log(r**2)")
    law = Law(Proximity(R), (Gradient(psi), Consensus(1.3)))
    near = {(i, j) for i, j in itertools.combinations(range(4), 2) if math.dist(Q[i], Q[j]) < R - 1e-6}
    edge = [(i, j) for i, j in itertools.combinations(range(4), 2) if abs(math.dist(Q[i], Q[j]) - R) < 1e-9]
    assert len(edge) == 2
    return psi, law, near, edge


def corners():
    psi, law, near, edge = switching()
    state = State(Q, P)
    expected = [control(near | {e for e, on in zip(edge, choice, strict=True) if on})
                for choice in itertools.product((False, True), repeat=2)]  # fmt: skip
    assert_allclose(nonsmooth.filippov_corners(law, state), expected, rtol=1e-9, atol=1e-9)
    assert nonsmooth.pairs_at_switch(law, state) == edge
    apart = State(Q * 1.1, P)
    assert nonsmooth.filippov_corners(law, apart).shape == (1, 4, 2)
    crowd = State(np.arange(14.0)[:, None] * [R, 0.0])
    with pytest.raises(InvalidInput, match="at most 12 pairs"):
        nonsmooth.filippov_corners(law, crowd)
    still = Law(Fixed(14, [(0, 1)]), (Consensus(1.0),))
    with pytest.raises(InvalidInput, match="at most 12 pairs"):
        nonsmooth.energy_rates(still, psi.capped(R), crowd)
    links = np.zeros((4, 4), dtype=bool)
    links[2, 3] = links[3, 2] = True
    kept = nonsmooth.filippov_corners(law, State(Q, P, links=links))
    assert_allclose(kept[0], control({(2, 3)}), rtol=1e-9, atol=1e-9)


def rates():
    psi, law, near, edge = switching()
    state = State(Q, P)
    found = nonsmooth.energy_rates(law, psi.capped(R), state)
    flows = [float((P * control(near | {e for e, on in zip(edge, choice, strict=True) if on})).sum())
             for choice in itertools.product((False, True), repeat=2)]  # fmt: skip

    def closing(i, j):
        d = math.dist(Q[i], Q[j])
        return float((Q[j] - Q[i]) @ (P[j] - P[i])) / d

    inner = sum(plain(math.dist(Q[i], Q[j])) * closing(i, j) for i, j in near)
    slopes = [inner + sum(SLOPE * closing(*e) * (1 - on) for e, on in zip(edge, choice, strict=True))
              for choice in itertools.product((0, 1), repeat=2)]  # fmt: skip
    # The intersection over slopes of the interval of slope + flow: largest low end, smallest high end.
    low, high = max(slopes) + min(flows), min(slopes) + max(flows)
    assert_allclose([found.low, found.high], [low, high], atol=1e-6)
    assert found.empty == (low > high)
    smooth = nonsmooth.energy_rates(law, psi.capped(R), State(Q * 0.99, P))
    assert_allclose(smooth.low, smooth.high, atol=1e-8)
    corners()
    assert not nonsmooth.Rates(1.0, 1.0).empty
    assert nonsmooth.Rates(1.0, 0.9).empty
    gradients()


def distance_rate():
    law = Law(Proximity(50.0), (Consensus(1.0),))
    for q, p in ((Q, P), (Q[:2], -P[:2]), (Q[:3], P[:3] * [1.0, -1.0])):
        seen = Evidence(simulate(Scenario(law, State(q, p), t_end=0.0, frames=1), progress=False))
        n = len(q)
        expected = max(abs(float((q[j] - q[i]) @ (p[j] - p[i]))) / math.dist(q[i], q[j])
                       for i, j in itertools.combinations(range(n), 2))  # fmt: skip
        assert_allclose(seen.distance_rate, expected, rtol=1e-12)


def first_disconnected_of(evidence):
    return inspect.getattr_static(Evidence, "first_disconnected").func(evidence)


def first_disconnected():
    """Three agents part one after the other; the graph falls apart with the first."""
    law = Law(Proximity(R), (Consensus(0.0),))
    q = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.8]])
    for p, expected in (
        ([[0.0, 0.0], [0.0, 0.0], [0.0, 2.0]], (math.sqrt(R**2 - 0.25) - 0.8) / 2.0),
        ([[0.0, 0.0], [0.0, 0.0], [0.0, 0.01]], math.inf),
    ):
        seen = Evidence(simulate(Scenario(law, State(q, np.array(p)), t_end=2.0), progress=False))
        assert_allclose(seen.first_disconnected, expected, rtol=1e-9)
    away = np.array([[0.0, 0.0], [9.0, 0.0]])
    apart = Evidence(simulate(Scenario(law, State(away), t_end=1.0), progress=False))
    assert apart.first_disconnected == 0.0
    # Looked at now and then: what was seen counts, and nothing else is known.
    for seen, switches_known in ((3.0, False), (3.0, True), (math.inf, True)):
        few = SimpleNamespace(seen_disconnected=seen, switches_known=switches_known, sampled=True, looks=7)
        assert first_disconnected_of(few) == seen
    for sampled, words in ((True, "between$"), (False, "between; engine='exact' locates every switch$")):
        few = SimpleNamespace(seen_disconnected=math.inf, switches_known=False, sampled=sampled, looks=7)
        few.run = SimpleNamespace(scenario=SimpleNamespace(agents=SimpleNamespace(discrete=False)))
        few._locating = partial(inspect.getattr_static(Evidence, "_locating"), few)
        with pytest.raises(NotResolvable, match=f"each of 7 frames, nothing is known {words}"):
            first_disconnected_of(few)


MODEL, STUDY = "flocking.model.potentials.potential", "flocking.study"
HOMES = {
    f"{MODEL}.Potential": potential,
    f"{MODEL}.Potential.capped": capped,
    f"{STUDY}.potentials.potential_check.check_potential": definitions,
    f"{STUDY}.potentials.nonsmooth.generalized_gradient": gradients,
    f"{STUDY}.potentials.nonsmooth.generalized_derivative": gradients,
    f"{STUDY}.potentials.nonsmooth.is_regular": gradients,
    f"{STUDY}.potentials.nonsmooth.filippov_corners": corners,
    f"{STUDY}.potentials.nonsmooth.energy_rates": rates,
    f"{STUDY}.evidence.Evidence.distance_rate": distance_rate,
    f"{STUDY}.evidence.Evidence.first_disconnected": first_disconnected,
}
