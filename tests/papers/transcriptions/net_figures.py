"""Figures of Tanner I, Tanner II and Zhou: what is drawn, held against motions and formulas of their own."""

from __future__ import annotations

import math

import numpy as np
from numpy.testing import assert_allclose

from tests.papers.transcriptions import drawn
from tests.papers.transcriptions import transcribed as by_hand

V_2 = 1 / 4 + math.log(4.0)


def potential(reach, outside=None):
    """Potential and slope of Tanner on two axes, up to ``reach``; beyond it a constant where one is given."""

    def check(found):
        assert len(found.panels) == 2
        value, slope = found.panels
        end = 3.0 if outside is None else 1.25 * reach
        for panel, name, label in ((value, by_hand.tanner, r"$\psi(r)$"), (slope, by_hand.tanner_slope, r"$\psi'(r)$")):
            drawn.function(panel, "curve", name, between=(0.0, reach), tolerance=1e-8)
            assert_allclose(panel.horizontal_limits, (0.0, end), atol=1e-5)
            assert panel.vertical == label
        assert value.horizontal == "$r$"
        best = drawn.one(value.of("minimum"))
        assert_allclose(best.points, [[1.0, 1.0]], atol=1e-6)
        low, high = value.vertical_limits
        assert low < 1.0 < high
        assert high > by_hand.tanner(2.0), "the well is seen"
        low, high = slope.vertical_limits
        assert low < -1.0
        assert high > by_hand.tanner_slope(math.sqrt(3)), "the steepest pull is seen"
        marks = sorted(m.points[0, 0] for m in value.of("mark"))
        assert_allclose(marks, [1.0] if outside is None else [1.0, reach], atol=1e-6)
        texts = {text for text, _ in value.notes}
        assert texts == ({"$r = 1$"} if outside is None else {"$r = 1$", "$R = 2$"})
        assert_allclose(drawn.one(slope.of("zero")).points[:, 1], 0.0, atol=1e-12)
        beyond = value.of("outside")
        if outside is None:
            assert beyond == []
        else:
            assert_allclose(drawn.one(beyond).points, [[reach, outside], [end, outside]], atol=1e-9)
            assert value.of("jump") == [], "continuous"
        assert value.of("curve")[0].color != slope.of("curve")[0].color

    return check


def snapshot(motion, time, *, trails, leader=None, title=None):
    """The net of a motion at a time, with the paths that led there."""

    def check(found):
        m = motion()
        q, p = m.at(time)
        through = [m.at(t)[0] for t in np.linspace(0.0, time, 12)] if trails and time > 0 else None
        paths = None if through is None else (m.at(0.0)[0], np.moveaxis(np.array(through), 1, 0))
        guide = None if leader is None else (np.array([10.0, 10.0]) + time * leader, leader)
        links = m.links_at(time)
        pairs = {(i, j) for i in range(len(q)) for j in range(i + 1, len(q)) if links[i, j]}
        panel = drawn.one(found.panels)
        tolerance = 3e-3 if time > 0 else 1e-9
        drawn.net(panel, q, p, pairs, title=f"$t = {time:.6g}$", trails=paths, leader=guide, tolerance=tolerance)

    return check


def series(which, axis, led):
    """Components of all agents over the first twelve seconds, and of the leader."""

    def check(found):
        panel = drawn.one(found.panels)
        motion = by_hand.zhou_motion(led)
        values = lambda times: np.array([motion.at(t)[which][:, axis] for t in times])  # noqa: E731
        drawn.agents_over_time(panel, values, 10, between=(0.0, 12.0), tolerance=1e-3)
        assert panel.vertical == f"${'qp'[which]}_{{{'xy'[axis]}}}$"
        # As printed: agents dotted about a leader, who is a solid red line.
        assert {line.style for line in panel.of("agents", "line")} == {":" if led else "-"}
        leaders = panel.of("leader", "line")
        assert len(leaders) == led
        assert panel.legend == (("leader",) if led else ())
        for line in leaders:
            assert line.style == "-"
            red, green, blue = (int(line.color[k : k + 2], 16) for k in (1, 3, 5))
            assert red > 2 * max(green, blue)
            t = line.points[:, 0]
            assert_allclose([t[0], t[-1]], [0.0, 12.0], atol=1e-9)
            assert_allclose(line.points[:, 1], 3.0 if which else 10.0 + 3.0 * t, rtol=1e-9)
            assert line.color not in {m.color for m in panel.of("agents")}
            low, high = panel.vertical_limits
            assert low < line.points[:, 1].min()
            assert line.points[:, 1].max() < high

    return check


FIXED, DYNAMIC, ZHOU = "tanner-2003-fixed", "tanner-2003-dynamic", "zhou-2015"
TANNER_FIXED = {
    "Fig. 2": potential(3.0),
    "Fig. 3": snapshot(by_hand.tanner_fixed_motion, 0.0, trails=False),
    **{
        f"Fig. {number}": snapshot(by_hand.tanner_fixed_motion, time, trails=True)
        for number, time in ((4, 2.22842), (5, 5.21464), (6, 22.8931), (7, 55.0766), (8, 100.0))
    },
}
TANNER_DYNAMIC = {
    "Fig. 2": potential(2.0, V_2),
    "Fig. 3": snapshot(by_hand.tanner_dynamic_motion, 0.0, trails=False),
    **{
        f"Fig. {number}": snapshot(by_hand.tanner_dynamic_motion, time, trails=True)
        for number, time in ((4, 2.0), (5, 5.0), (6, 25.0), (7, 100.0))
    },
}


def zhou():
    found = {}
    for first, led in ((1, False), (8, True)):
        motion = lambda led=led: by_hand.zhou_motion(led)  # noqa: E731
        guide = np.array([3.0, 3.0]) if led else None
        for step, (time, trails) in enumerate(((0.0, False), (12.0, False), (12.0, True))):
            found[f"Fig. {first + step}"] = snapshot(motion, time, trails=trails, leader=guide)
        for step, (which, axis) in enumerate(((1, 0), (1, 1), (0, 0), (0, 1)), start=3):
            found[f"Fig. {first + step}"] = series(which, axis, led)
    return found


def among(checks, scenarios):
    return {number: drawn.figure(scenarios, check) for number, check in checks.items()}


CHECKS = {
    FIXED: among(TANNER_FIXED, {str(k): FIXED if k > 2 else "" for k in range(2, 9)}),
    DYNAMIC: among(TANNER_DYNAMIC, {str(k): DYNAMIC if k > 2 else "" for k in range(2, 8)}),
    ZHOU: among(zhou(), {str(k): ZHOU if k < 8 else f"{ZHOU}-leader" for k in range(1, 15)}),
}
