"""Lists of claims of the papers, whole: which are made of which scenario, and on what they rest."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose

from flocking.model.leaders_and_obstacles.leaders import Path
from flocking.model.terms.body_terms import Track
from flocking.papers import paper
from flocking.study.claims.claim import Basis, Origin, Verdict

KEPT = "energy energy-falls velocities-agree linked-apart all-apart stationary minimal local-minimum speed-bound"
LINKED = "energy energy-falls energy-bound energy-per-link new-links connected links-kept linked-apart all-apart"
LINKED += " unlinked-apart distances-settle switching-stops speed-bound distance-bound coincide one-length"
CENTRED = "energy J-continuous apart J-falls stationary minimal"
KEYS = {
    "olfati-saber-2003": "energy quasi-flock no-entry velocities headings split rejoin squeeze",
    "olfati-saber-2003-sink": "energy energy-falls connected switching-stops centred rigid planar triangular"
    " low-defect realization flocking",
    "olfati-saber-2003-free": "energy momentum energy-falls jumps velocities-agree distances-settle decreasing",
    "olfati-saber-2003-smooth": "energy momentum H_s-continuous energy-falls velocities-agree distances-settle",
    "tanner-2003-fixed": f"{KEPT} distance-bound momentum",
    "tanner-2003-fixed-complete": f"{KEPT} distance-bound momentum",
    "tanner-2003-dynamic": "energy energy-continuous energy-falls connected transversal velocities-agree"
    " distances-settle all-apart apart-by stationary minimal local-minimum switching-stops links-kept speed-bound"
    " distance-bound momentum",
    "zhou-2015": f"{LINKED} momentum velocities-agree stationary",
    "zhou-2015-leader": f"{LINKED} velocities-agree velocities-follow mean-velocity leader-offset leader-met"
    " stationary",
    "shi-2009": f"{CENTRED} tracks",
    "shi-2009-all-informed": f"{CENTRED} tracks",
    "shi-2009-disconnected": "energy J-continuous apart J-falls tracks",
    "shi-2009-uniform": f"{CENTRED} tracks centre",
    "shi-2009-velocity-only": f"{CENTRED} agree no-tracking steady-error centre",
    "shi-2009-position": "energy J-continuous apart J-falls agree no-tracking steady-error centre",
    "shi-2009-partial": "energy J-continuous apart no-flocking no-tracking",
    "shi-2009-partial-disconnected": "energy J-continuous apart no-flocking no-tracking",
}
"""Keys of the claims about each scenario."""
NOT_STATED = {
    "olfati-saber-2003-sink": {"realization": Origin.OWN, "flocking": Origin.OWN},
    "tanner-2003-fixed": {"all-apart": Origin.OWN, "momentum": Origin.OWN},
    "tanner-2003-fixed-complete": {"momentum": Origin.OWN},
    "tanner-2003-dynamic": {"connected": Origin.ASSUMPTION, "links-kept": Origin.OWN, "momentum": Origin.OWN},
    **{f"shi-2009-{kind}": {"steady-error": Origin.OWN} for kind in ("velocity-only", "position")},
    "zhou-2015": {"one-length": Origin.OWN},
    "zhou-2015-leader": {"leader-offset": Origin.OWN, "one-length": Origin.OWN},
}
"""What the papers assume, and questions they do not answer."""
REFUTED = {
    "olfati-saber-2003-sink": {"realization", "flocking"},
    "olfati-saber-2003-free": {"decreasing"},
    "tanner-2003-fixed": {"all-apart", "minimal"},
    "tanner-2003-fixed-complete": {"minimal"},
    "tanner-2003-dynamic": {"connected", "minimal", "links-kept"},
    "zhou-2015": {"coincide", "one-length"},
    "zhou-2015-leader": {"coincide", "one-length", "leader-met"},
    **{f"shi-2009{kind}": {"minimal"} for kind in ("", "-all-informed", "-uniform", "-velocity-only")},
}
"""What has a counter-example."""
ENERGIES = {"zhou-2015": ("(14)", "(16)-(18)", "Q"), "zhou-2015-leader": ("(29)", "(31)", "U")}
"""Where the paper states the rate of the energy and its bound, and what it calls it."""


def listed(key: str) -> None:
    found = paper(key)
    assert set(found.scenarios()) == {name for name in KEYS if name.startswith(key)}
    for name in found.scenarios():
        claims = {c.key: c for c in found.claims(name)}
        assert " ".join(sorted(claims)) == " ".join(sorted(KEYS[name].split()))
        # The books can be balanced whatever the motion; all else rests on the computed one.
        assert [c.key for c in claims.values() if not c.dynamic] == ["energy"]
        for claim in claims.values():
            assert claim.statement.endswith(".")
            assert not claim.source.endswith(".") or claim.source[-2].isdigit()
            assert claim.key != claim.source
        for claim in claims.values():
            # A counter-example is one of the scenario, or of a group made for it.
            assert (claim.counterexample is not None) == (claim.basis is Basis.COUNTEREXAMPLE)
            if claim.counterexample is not None:
                assert claim.expected is Verdict.FAILS
                led = len(claim.counterexample().law.leaders)
                assert led == len(found.scenarios()[name](0).law.leaders)
        if name in ENERGIES:
            rate, bound, letter = ENERGIES[name]
            assert [claims[k].source for k in ("energy", "energy-falls", "energy-bound")] == [rate, rate, bound]
            for about in ("energy", "energy-falls", "energy-bound"):
                assert re.search(rf"\b{letter}\b", claims[about].statement)
            assert f"sqrt(2 {letter}_max)" in claims["speed-bound"].statement
        unstated = {c.key: c.origin for c in claims.values() if c.origin is not Origin.PAPER}
        assert unstated == NOT_STATED.get(name, {})
        assert {c.key for c in claims.values() if c.expected is Verdict.FAILS} == REFUTED.get(name, set())
        assert {c.key for c in claims.values() if c.reason} == REFUTED.get(name, set())
        assert all(" " not in claim.key for claim in claims.values())


SHI_SOURCES = {
    "energy": "(6)-(7), (11)", "J-continuous": "(3)", "apart": "Theorems 1, 2, 4, 5", "J-falls": "Theorems 2, 5",
    "no-flocking": "Remark 6", "stationary": "Theorems 1-5", "minimal": "Theorems 1-5", "agree": "Theorems 4, 5",
}  # fmt: skip
SHI_ALWAYS = {"energy", "J-continuous", "apart", "J-falls", "steady-error", "centre"}
"""Claims that need no connected graph; that v0 is not tracked needs none where nobody knows its acceleration."""
SHI_LAWS = {"uniform": (8, "(9), Theorem 3"), "velocity-only": (12, "(13)"), "position": (15, "(16)")}


def shi(key: str) -> None:
    """Where each claim is made, of which graphs, and which are negations."""
    listed(key)
    t = np.linspace(0.0, 20.0, 201)
    guide = np.stack([np.sin(t), np.cos(t)], axis=1)
    leader = Path(("sin(t)", "cos(t)"))
    # Two agents, one of which goes with the leader; their spread stays too.
    seen = SimpleNamespace(
        t=t, p=np.stack([guide, guide + 1.0], axis=1), velocity_spread=np.ones(len(t)),
        oldest_knowledge=None, yet_to_meet="", path_about_mean=np.inf, need_one_motion=lambda: None,
        need_end=lambda last: None,
        run=SimpleNamespace(scenario=SimpleNamespace(rest_frame="neighbours are late")),
    )  # fmt: skip
    for name in paper(key).scenarios():
        kind = name.removeprefix(key).removeprefix("-")
        some, kept = kind.startswith("partial"), not kind.endswith("disconnected")
        law, source = SHI_LAWS.get(kind, (4, ""))
        sources = {
            **SHI_SOURCES, "no-tracking": "Remark 6" if some else "sec. 3.2", "centre": source,
            "steady-error": "from " + source, "tracks": "Theorems 1, 2" if kept else "Remark 1",
        }  # fmt: skip
        for claim in paper(key).claims(name):
            assert claim.source == sources[claim.key]
            always = claim.key in SHI_ALWAYS or (claim.key == "no-tracking" and not some)
            assert claim.hypothesis.__name__ == (
                "granted" if always else "connected_throughout" if kept else "fell_apart"
            )
            about = {"tracks": "v0", "no-tracking": "v0", "agree": "v*", "no-flocking": "v*"}.get(claim.key)
            gains = {12: (1.0, 0.0), 15: (1.0, 1.0)}.get(law, (0.5, 0.0))
            seen.law = SimpleNamespace(body_terms=(Track(leader, velocity_gain=gains[0], position_gain=gains[1]),))
            if about:
                found = claim.conclusion(seen)  # type: ignore[arg-type]
                assert found.note.startswith(f"|v_i - {about}| is")
                assert found.note.endswith("; the rest frame of the world is physical: neighbours are late")
                assert (found.margin > 0) == claim.key.startswith("no-")
                assert ("agree" in claim.statement) == (claim.key == "no-flocking")
            if claim.key == "steady-error":
                steady = {12: 1 / math.sqrt(2.0), 15: 1.0}[law]
                seen.mean_velocity = guide + [steady + 0.1, 0.0]
                margin = claim.conclusion(seen).margin  # type: ignore[arg-type]
                assert_allclose(margin, 1e-3 * steady - 0.1, rtol=1e-6)


TANNER = {
    "energy": ("(9)", "(10)", "ledger_residual", ""),
    "energy-continuous": ("", "(6)", "energy_continuous", ""),
    "energy-falls": ("(8)-(9)", "(10)", "energy_rise", ""),
    "connected": ("", "Assumption VI.1", "stays_connected", "starts"),
    "transversal": ("", "sec. VI", "crossings_transversal", ""),
    "velocities-agree": ("Theorem IV.4", "Theorem VI.2", "velocities_agree", "connected"),
    "distances-settle": ("", "sec. I", "distances_settle", "connected"),
    "linked-apart": ("Theorem IV.4", "", "linked_apart", "connected"),
    "all-apart": ("see Remark IV.5", "Theorem VI.2", "all_apart", ""),
    "apart-by": ("", "Theorem VI.2", "without_collision", ""),
    "stationary": ("Theorem IV.4", "Theorem VI.2", "forces_vanish", "connected"),
    "minimal": ("Theorem IV.4", "Theorem VI.2", "agents_at_their_minimum", "connected"),
    "local-minimum": ("Theorem IV.4", "Theorem VI.2", "potential_is_minimal", "connected"),
    "switching-stops": ("", "after (11)", "switching_stops", "connected"),
    "links-kept": ("", "not stated", "no_link_lost", ""),
    "speed-bound": ("after (6)", "after (6)", "", ""),
    "distance-bound": ("after (6)", "after (6)", "distances_bounded", "connected"),
    "momentum": ("not stated", "not stated", "momentum_drift", ""),
}
"""Where Tanner I and II say it, what measures it, and of which graphs it is said."""


def tanner(key: str) -> None:
    """What measures each claim, and the bound sqrt(2 c) that follows from W or Q: printed as sqrt(c)."""
    listed(key)
    moves = key == "tanner-2003-dynamic"
    hypotheses = {"": "granted", "starts": "starts_connected",
                  "connected": "stays_connected" if moves else "starts_connected"}  # fmt: skip
    between = {"speed": SimpleNamespace(value=1.25, error=0.0, time=0.5)}
    seen = SimpleNamespace(
        trace={"energy": np.array([3.0])}, speeds=np.array([[1.0]]), largest=between.get, when=lambda time, _: str(time)
    )
    for name in paper(key).scenarios():
        for claim in paper(key).claims(name):
            *sources, measure, graphs = TANNER[claim.key]
            source = sources[moves]
            if claim.key == "all-apart" and not moves:
                # Of linked agents alone it is Theorem IV.4 that speaks; all are linked where the graph is complete.
                complete = name.endswith("complete")
                source = source.removeprefix("see ") if complete else source
                measure = measure if complete else "unlinked_keep_distance"
            assert claim.source == source
            assert claim.hypothesis.__name__ == hypotheses[graphs]
            if claim.key == "speed-bound":
                found = claim.conclusion(seen)  # type: ignore[arg-type]
                assert_allclose(found.margin, math.sqrt(6.0) - 1.25, rtol=1e-12)
            else:
                assert claim.conclusion.__name__ == measure


HOMES: dict[str, Callable[[], None]] = {
    "flocking.papers.olfati_saber_2003.theorems.claims": partial(listed, "olfati-saber-2003"),
    "flocking.papers.shi_2009.theorems.claims": partial(shi, "shi-2009"),
    "flocking.papers.zhou_2015.theorems.claims": partial(listed, "zhou-2015"),
    "flocking.papers.tanner_2003_fixed.theorems.claims": partial(tanner, "tanner-2003-fixed"),
    "flocking.papers.tanner_2003_dynamic.theorems.claims": partial(tanner, "tanner-2003-dynamic"),
}
