"""Laws in symbols: the printed formula is evaluated anew and gives the control; what has no short form is said."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import flocking as fk
from flocking.formula.markup.mathml import to_mathml
from flocking.model.terms.body_terms import BodyTerm
from flocking.model.terms.pair_terms import PairTerm
from flocking.model.typesetting.documentation import meanings_of, summary_of
from flocking.model.typesetting.law_formulas import law_latex, motion_latex, term_formulas, weight_latex
from flocking.model.typesetting.law_html import law_html, scenario_html
from flocking.papers import ALL_KEYS, paper


@pytest.mark.parametrize("key", ALL_KEYS)
def test_every_law_of_the_papers_has_its_formula(key):
    seen = set()
    for make in paper(key).scenarios().values():
        scenario = make(0)
        kinds = tuple(term.structure for term in scenario.law.terms)
        if kinds in seen:
            continue
        seen.add(kinds)
        found = term_formulas(scenario.law, scenario.start.dimension)
        stated = [term for term in found if isinstance(term.term, PairTerm | BodyTerm)]
        assert all(term.exact for term in stated), [t.latex for t in found]
        to_mathml(law_latex(scenario.law, scenario.start.dimension))


def test_the_formulas_of_the_common_terms_are_those_of_the_textbooks():
    law = fk.Law(
        fk.Proximity(2.0),
        [fk.Gradient(fk.Potential("1/r")), fk.Consensus(0.8), fk.Track([1.0, 0.0], position_gain=2.0), fk.Compensate()],
    )
    shown = [term.latex for term in term_formulas(law)]
    assert shown == [
        r"\sum_{j \in N_i} \psi'{\left(r_{ij}\right)}\,\mathbf{n}_{ij}",
        r"\sum_{j \in N_i} c\,\left(p_j - p_i\right)",
        r"- c_{\mathrm{position}} \left(q_i - x_0\right) - c_{\mathrm{velocity}} \left(p_i - v_0\right)",
        r"k_i p_i",
    ]
    smooth = fk.Law(fk.Smooth(2.0, 0.5), [fk.Gradient(fk.Potential("1/r"), weighting="force")])
    assert r"a{\left(r_{ij}\right)} \psi'{\left(r_{ij}\right)}" in law_latex(smooth)
    assert weight_latex(smooth.graph).startswith(r"a(r) = \begin{cases}")
    assert weight_latex(law.graph) == ""


def test_saturated_feedback_is_printed_with_norms():
    law = fk.Law(fk.Proximity(2.0), [fk.Track([1.0, 0.0], saturated=True)])
    assert law_latex(law, 3).count(r"\left\|p_i - v_0\right\|^{2}") == 1


def test_different_things_of_one_name_have_different_symbols():
    wide, near = fk.Smooth(2.0, 0.5), fk.Smooth(1.0, 0.5)
    law = fk.Law(
        wide,
        [
            fk.Gradient(fk.Potential("1/r"), weighting="force"),
            fk.Gradient(fk.Potential("c/r^2", c=3.0), weighting="force", over=near),
            fk.Consensus(0.8), fk.Consensus([1.0, 2.0], over=near), fk.Track([1.0, 0.0]), fk.Track([0.0, 1.0]),
            fk.Track([1.0, 0.0], velocity_gain=2.0), fk.CuckerSmale(0.8, 0.3, 0.5), fk.CuckerSmale(0.7, 0.3, 1.5),
        ],
    )  # fmt: skip
    shown = [term.latex for term in term_formulas(law)]
    assert r"a{\left(r_{ij}\right)} \psi'{\left(r_{ij}\right)}" in shown[0]
    assert r"a_{2}{\left(r_{ij}\right)} \psi_{2}'{\left(r_{ij}\right)}" in shown[1]
    assert r"} c\,\left" in shown[2]
    assert r"} c_{i,2}\,\left" in shown[3]
    assert shown[4] == r"- c_{\mathrm{velocity}} \left(p_i - v_0\right)"
    assert shown[5] == r"- c_{\mathrm{velocity}} \left(p_i - v_{0,2}\right)"
    assert shown[6] == r"- c_{\mathrm{velocity},2} \left(p_i - v_0\right)"
    assert r"c \left(\mathrm{scale}^{2}" in shown[7]
    assert r"c_{3} \left(\mathrm{scale}_{2}^{2}" in shown[8]
    assert weight_latex(near, 1).startswith("a_{2}(r) = ")
    page = law_html(law)
    assert all(to_mathml(x) in page for x in ("c_{3}", "c_{i,2}", r"c_{\mathrm{velocity},2}", r"\mathrm{scale}_{2}"))
    to_mathml(law_latex(law))


def test_the_average_over_a_further_graph_counts_its_neighbours():
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(), fk.VelocityAverage(2.0, over=fk.Proximity(1.0))])
    assert r"\frac{1}{1 + \left|N_i^{(2)}\right|}" in term_formulas(law)[1].latex


def test_gamma_agents_of_polygons_are_in_the_formula():
    polygon, wall = fk.ConvexPolygon([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 0.2), fk.Wall([0.0, -3.0], [0.0, 1.0])

    def shown(obstacles, **more):
        (found,) = term_formulas(fk.Law(fk.Proximity(2.0), [fk.Avoid(obstacles, [1.0, 0.0], range=2.0, **more)]))
        return found

    assert r"\psi_{\mathrm{attraction}}'" in shown([polygon]).latex
    assert not shown([polygon, wall]).exact
    assert shown([polygon, wall], gamma_agents=False).exact
    assert r"\psi_{\mathrm{attraction}}'" not in shown([wall]).latex


@dataclass(frozen=True)
class Turn(BodyTerm):
    """A force across the velocity, which no formula of vectors without a rotation states."""

    gain: float = 1.0

    @property
    def parameters(self):
        return {"gain": self.gain}

    @property
    def structure(self):
        return ("Turn",)

    def force(self, x):
        return [-x.parameter("gain") * x.p[1], x.parameter("gain") * x.p[0]]


@dataclass(frozen=True)
class AxisOnly(Turn):
    """A drag along the first axis alone: its first component looks like that of a vector formula."""

    def force(self, x):
        return [-x.parameter("gain") * x.p[0], *[0 * v for v in x.p[1:]]]


@pytest.mark.parametrize("term", [Turn(), AxisOnly()])
def test_components_that_no_vector_formula_states_are_not_printed_as_one(term):
    (shown,) = term_formulas(fk.Law(fk.Proximity(1.0), [term]), 2)
    assert not shown.exact
    assert shown.latex == rf"\mathrm{{{type(term).__name__}}}_i"
    assert "no short form" in law_html(fk.Law(fk.Proximity(1.0), [term]), 2)


def test_motion_is_that_of_the_body():
    assert motion_latex(fk.PointMass()) == [r"\dot{q}_i = p_i", r"\dot{p}_i = u_i"]
    assert motion_latex(fk.PointMass(2.0)) == [r"\dot{q}_i = p_i", r"\dot{p}_i = \frac{u_i}{m_i}"]
    assert motion_latex(fk.SingleIntegrator()) == [r"\dot{q}_i = u_i"]
    assert motion_latex(fk.Heading(1.0, 0.1)) == [], "headings are set at ticks"
    assert motion_latex(fk.Unicycle(0.1)) == [], "one axis has no heading"


def test_a_part_is_told_by_its_documentation():
    assert summary_of(fk.Hysteresis(4, 0.3)).startswith("Links break at radius and appear only below radius - gap")
    meanings = meanings_of(fk.Consensus)
    assert list(meanings)[:3] == ["gain", "weights", "weighted"]
    assert meanings["gain"].startswith("Common factor c")


def test_a_scenario_states_its_values_start_and_world():
    psi = fk.Potential("a*r**2", a=2.0)
    law = fk.Law(fk.Hysteresis(4, 0.3), [fk.Gradient(psi), fk.Consensus(np.array([1.0, 2.0]))])
    scenario = fk.Scenario(law, fk.State([[0.0, 0.0], [1.0, 0.0]]), t_end=3.0, control=fk.Held(0.5), seed=None)
    text = scenario_html(scenario)
    for words in (
        f"with {to_mathml('a = 2')}",
        "at rest",
        "(1, 2)",
        ">0.3<",
        "2 agents in 2 dimensions",
        "from t = 0 to 3",
        "Held",
        ">0.5<",
    ):
        assert words in text, words
