"""Fig. 1 to 9 of Olfati-Saber 2003: what is drawn, held against his formulas typed once more."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.testing import assert_allclose

from tests.papers.transcriptions import drawn
from tests.papers.transcriptions.olfati_saber_interaction import phi, psi
from tests.papers.transcriptions.olfati_saber_nets import SIX, R, d_rho, dist, rho
from tests.papers.transcriptions.olfati_saber_obstacles import MATRIX, R0, B, L, X, hat

PLAIN = ("$x$", "$y$", True)


def circle(line, centre, radius):
    """A closed line about a centre, and nothing left out of it."""
    away = line.points - centre
    assert_allclose(np.hypot(*away.T), radius, rtol=1e-9)
    turns = np.diff(np.unwrap(np.arctan2(away[:, 1], away[:, 0])))
    assert_allclose(abs(turns.sum()), 2 * math.pi, rtol=0.02)


def seen_from_first(panel, seen):
    dots = drawn.one(panel.of("agents", "dots"))
    assert_allclose(dots.points, SIX, rtol=1e-12)
    links = [(0, k) for k in range(1, 6) if seen[k]]
    assert sorted(drawn.linked_pairs(dots.points, panel.of("links"))) == links
    first, rest = sorted(panel.of("", "dots"), key=lambda m: len(m.points) > 1 or tuple(m.points[0]) != SIX[0])
    assert_allclose(first.points, [SIX[0]], atol=1e-12)
    assert_allclose(rest.points, [SIX[k] for k in range(6) if seen[k]], rtol=1e-12)
    assert len({dots.color, first.color, rest.color}) == 3
    assert (panel.horizontal, panel.vertical, panel.even) == PLAIN
    assert panel.of("velocities") == []
    assert panel.title == ""
    drawn.window(panel, SIX, ((-10.5, -10.5), (12.5, 10.5)))


def fig_1(found):
    panels = found.panels
    shell, view = panels
    near = [False] + [dist(SIX[0], x) <= R for x in SIX[1:]]
    seen_from_first(shell, near)
    circle(drawn.one(shell.of("", "line")), (0.0, 0.0), R)
    bearing = [abs(math.atan2(y, x)) <= math.pi / 3 for x, y in SIX]
    seen_from_first(view, [a and b for a, b in zip(near, bearing, strict=True)])
    edge = drawn.one(view.of("", "line")).points
    assert_allclose(edge[[0, -1]], 0.0, atol=1e-12)
    assert_allclose(np.hypot(*edge[1:-1].T), R, rtol=1e-9)
    angle = np.arctan2(edge[1:-1, 1], edge[1:-1, 0])
    assert_allclose([angle.min(), angle.max()], [-math.pi / 3, math.pi / 3], rtol=1e-9)
    assert len(edge) > 50
    # The arrow is the heading of the first agent, along x.
    arrow = drawn.one(view.of("pointer"))
    assert_allclose([arrow.points[0], arrow.way[0]], [[0.0, 0.0], [4.0, 0.0]], atol=1e-12)
    assert shell.of("pointer") == []


def quintic(s):
    return 1 - 10 * s**3 + 15 * s**4 - 6 * s**5


def infinite(s):
    if s <= 0 or s >= 1:
        return float(s <= 0)
    a, b = math.exp(-1 / s), math.exp(-1 / (1 - s))
    return b / (a + b)


def fig_2(found):
    panels = found.panels
    values, slopes = panels
    shapes = {
        "cosine": lambda z: rho(z / 12),
        "quintic": lambda z: quintic(min(max((z / 12 - 5 / 6) * 6, 0.0), 1.0)),
        "infinite": lambda z: infinite((z / 12 - 5 / 6) * 6),
    }
    assert slopes.legend == tuple(shapes)
    assert len(values.of("curve")) == len(slopes.of("curve")) == 3
    for panel, label in ((values, r"$\rho$"), (slopes, r"$\rho'$")):
        assert panel.horizontal_limits == (0.0, 15.0)
        assert (panel.horizontal, panel.vertical) == ("$z$", label)
    assert_allclose(values.vertical_limits, (-0.05, 1.1))
    assert len({m.color for m in slopes.of("curve")}) == len({m.style for m in slopes.of("curve")}) == 3
    for name, shape in shapes.items():
        curve = slopes.named(name)
        partner = drawn.one([m for m in values.of("curve") if m.color == curve.color])
        assert partner.style == curve.style
        assert_allclose(partner.points[:, 1], [shape(z) for z in partner.points[:, 0]], atol=1e-9)
        # A slope with respect to z/r.
        step = 1e-6
        away = np.abs(curve.points[:, 0][:, None] - [10.0, 12.0]).min(axis=1) > 1e-3
        rate = [(shape(z + step) - shape(z - step)) / (2 * step) * 12 for z in curve.points[away, 0]]
        assert_allclose(curve.points[away, 1], rate, atol=1e-5)
        assert_allclose([curve.points[0, 0], curve.points[-1, 0]], [0.0, 15.0], atol=1e-6)
    assert_allclose(slopes.named("cosine").points[:, 1], [d_rho(z / 12) for z in slopes.named("cosine").points[:, 0]],
                    atol=1e-9)  # fmt: skip
    low, high = slopes.vertical_limits
    assert -13.5 < low < -12.0, "the steepest slope is -12"
    assert 0 < high < 2


def fig_3(found):
    panels = found.panels
    counts = [0, 2, 4, 3, 5, 5]
    for panel, count in zip(panels, counts, strict=True):
        q = drawn.one(panel.of("agents", "dots")).points
        links = drawn.linked_pairs(q, panel.of("links"))
        assert links == {(i, j) for i, j in itertools.combinations(range(4), 2) if dist(q[i], q[j]) <= R * (1 + 1e-9)}
        assert_allclose([dist(q[i], q[j]) for i, j in links], 7.0, rtol=1e-9)
        assert len(links) == count
        assert panel.title == f"{count} links"
        assert [text for text, _ in panel.notes] == ["1", "2", "3", "4"]
        assert_allclose([place for _, place in panel.notes], q, rtol=1e-12)
        assert (panel.horizontal, panel.vertical, panel.even) == PLAIN
        assert panel.of("velocities") == []
        reach = [np.array(panel.horizontal_limits), np.array(panel.vertical_limits)]
        for axis in range(2):
            assert_allclose(reach[axis].mean(), (q[:, axis].min() + q[:, axis].max()) / 2, atol=1e-9)
            assert_allclose(np.ptp(reach[axis]), np.ptp(q, axis=0).max() + 6.0, rtol=1e-9)


def fig_4(found):
    panels = found.panels
    value, action = panels
    drawn.function(value, "curve", psi, between=(-10.0, 10.0))
    drawn.function(action, "curve", phi, between=(-10.0, 10.0))
    for panel, label in ((value, r"$\psi_\alpha(z)$"), (action, r"$\phi_\alpha(z)$")):
        assert (panel.horizontal, panel.vertical) == ("$z$", label)
        assert_allclose(panel.horizontal_limits, (-10.0, 10.0))
    low, high = value.vertical_limits
    assert low < 0 < psi(-10.0) < high < 1.2 * psi(-10.0)
    assert_allclose(action.vertical_limits, (-5.3, 1.5))
    assert_allclose(drawn.one(action.of("", "line")).points[:, 1], 0.0, atol=1e-12)
    assert value.of("", "line") == []


def fig_5(found):
    panels = found.panels
    hard, smooth = panels
    drawn.function(hard, "curve", lambda e: psi(e) if e < 2.0 else 0.0, between=(-4.0, 4.0))
    assert len(hard.of("curve")) == 2, "the line is interrupted where V jumps"
    drawn.function(smooth, "curve", lambda e: rho((10 + e) / 12) * psi(e), between=(-4.0, 4.0))
    assert len(smooth.of("curve")) == 1
    for panel in panels:
        assert (panel.horizontal, panel.vertical) == (r"$\eta$", "$V$")
        assert_allclose(panel.horizontal_limits, (-4.0, 4.0))
        assert_allclose(panel.vertical_limits, (-0.15, 4.0))
        assert_allclose(drawn.one(panel.of("mark")).points[:, 0], 2.0, rtol=1e-9)
        assert [text for text, _ in panel.notes] == [r"$r - d_\alpha$"]


def fig_6(found):
    panel = drawn.one(found.panels)
    q = B + 11.5 * np.array([math.cos(2.8), math.sin(2.8)])
    places = {"1": q, "2": hat(q), "3": X}
    circle(drawn.one(panel.of("", "area")), B, L)
    shell, *ways = sorted(panel.of("", "line"), key=lambda m: -len(m.points))
    circle(shell, q, R0)
    assert len(ways) == 2
    for way, end in zip(sorted(ways, key=lambda m: dist(*m.points)), ("2", "3"), strict=True):
        assert_allclose(way.points, [q, places[end]], rtol=1e-12)
    dots = panel.of("", "dots")
    assert len({m.color for m in dots}) == 3
    assert_allclose([m.points[0] for m in dots], list(places.values()), rtol=1e-12)
    assert_allclose(drawn.one(panel.of("agents", "dots")).points, [q], rtol=1e-12)
    for name, place in places.items():
        assert_allclose(next(at for text, at in panel.notes if text == name), place, rtol=1e-12)
    # n_d is the direction of p_d, along x from the centre.
    arrow = drawn.one(panel.of("pointer"))
    assert_allclose([arrow.points[0], arrow.way[0]], [X + [1.0, 0.0], [5.0, 0.0]], rtol=1e-12, atol=1e-12)
    assert_allclose(next(at for text, at in panel.notes if text == "$n_d$"), X + [6.0, 0.0], rtol=1e-12)
    assert (panel.horizontal, panel.vertical, panel.even) == PLAIN
    drawn.window(panel, [], ((82.0, 8.0), (112.0, 32.0)))


def start_in_box(seed, n, sides, corner):
    return np.array(corner) + np.array(sides) * np.random.default_rng(seed).random((n, 2))


def snapshots(found, times, radius_links):
    """Panels of a run at given times, links and starts by hand."""
    run, panels = found.run, found.panels
    assert len(panels) == len(times)
    for panel, time in zip(panels, times, strict=True):
        frame = int(np.argmin(np.abs(run.t - time)))
        assert abs(run.t[frame] - time) <= 0.06
        assert panel.title == f"$t = {run.t[frame]:.6g}$"
        yield panel, frame, drawn.pairs_within(run.q[frame], R) if radius_links else set()


def passage(links):
    def check(found):
        run, panels = found.run, found.panels
        assert_allclose(drawn.one(panels[0].of("agents", "dots")).points,
                        start_in_box(0, 24, (40.0, 20.0), (40.0, 12.5)), rtol=1e-12)  # fmt: skip
        colors = set()
        for panel, frame, pairs in snapshots(found, (0.0, 11.0, 14.0, 18.0, 22.0, 26.0), links):
            q, p = run.q[frame], run.p[frame]
            middle = q[:, 0].mean()
            dots = drawn.one(panel.of("agents", "dots"))
            assert_allclose(dots.points, q, rtol=1e-12)
            colors.add(dots.color)
            assert drawn.linked_pairs(q, panel.of("links")) == pairs
            if links:
                assert panel.of("velocities") == []
            elif frame > 0:
                arrow = drawn.one(panel.of("velocities"))
                assert_allclose(arrow.points, q, rtol=1e-12)
                assert_allclose(arrow.way, 0.6 * p, rtol=1e-9, atol=1e-12)
            drawn.window(panel, [], ((middle - 105.0, -32.0), (middle + 105.0, 78.0)))
            shown = [(x, y, r) for x, y, r in zip(*MATRIX, strict=True) if abs(x - middle) < 125.0]
            areas = [m for m in panel.marks if m.kind == "area"]
            assert len(areas) == len(shown)
            for area, (x, y, radius) in zip(areas, shown, strict=True):
                circle(area, (x, y), radius)
            assert panel.of("leader") == []
            assert panel.of("trails") == []
        assert len(run.t) > 10

    return check


def gathering(found):
    run, panels = found.run, found.panels
    start = math.sqrt(0.3) * start_in_box(0, 30, (120.0, 120.0), (-60.0, -60.0))
    assert_allclose(drawn.one(panels[0].of("agents", "dots")).points, start, rtol=1e-12)
    for panel, frame, pairs in snapshots(found, (0.0, 1.0, 2.0, 4.0, 8.0), True):
        q = run.q[frame]
        sink = np.zeros(2), None
        drawn.net(panel, q, run.p[frame], pairs, title=panel.title, arrows=False, leader=sink, tolerance=1e-9)
    assert np.ptp(run.q[-1]) < np.ptp(run.q[0]), "they gather"


KEY = "olfati-saber-2003"
SCENARIOS = {**{str(k): "" for k in range(1, 7)}, "7": KEY, "8": KEY, "9": f"{KEY}-sink"}

CHECKS = {
    f"Fig. {number}": drawn.figure(SCENARIOS, check)
    for number, check in enumerate(
        (fig_1, fig_2, fig_3, fig_4, fig_5, fig_6, passage(False), passage(True), gathering), start=1
    )
}
