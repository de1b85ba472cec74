"""What figures show, held against the papers' formulas: nets at a time, curves over time, functions."""

from __future__ import annotations

import math

import numpy as np
from numpy.testing import assert_allclose


def figure(scenarios, check):
    """Check of a figure among the declared ones, given by the scenarios each of them shows."""
    expected = {number: (names,) if isinstance(names, str) else names for number, names in scenarios.items()}

    def whole(found):
        assert {number: names for number, (_, _, names) in found.declared.items()} == expected
        for number, (own, caption, _) in found.declared.items():
            assert own == number
            assert caption.endswith(".")
        assert len({caption for _, caption, _ in found.declared.values()}) > len(scenarios) / 2
        letters(found.panels)
        check(found)

    return whole


def one(marks):
    assert len(marks) == 1, f"{len(marks)} marks for one"
    return marks[0]


def letters(panels):
    # A second vertical axis has no horizontal label, and no letter of its own.
    panels = [p for p in panels if p.horizontal]
    expected = [f"({c})" for c in "abcdefghij"[: len(panels)]] if len(panels) > 1 else [""]
    assert [p.letter for p in panels] == expected


def linked_pairs(q, links):
    """Ends of the links that are drawn, as pairs of agents."""
    found = set()
    for link in links:
        assert link.kind == "line"
        assert link.points.shape == (2, 2)
        ends = [int(np.argmin(((q - end) ** 2).sum(axis=1))) for end in link.points]
        assert_allclose(q[ends], link.points, atol=1e-9)
        found.add((min(ends), max(ends)))
    assert len(found) == len(links), "a link is drawn twice"
    return found


def pairs_within(q, radius, closed=False):
    n = len(q)
    near = (lambda d: d <= radius) if closed else (lambda d: d < radius)
    return {(i, j) for i in range(n) for j in range(i + 1, n) if near(math.dist(q[i], q[j]))}


def net(panel, q, p, pairs, *, title, trails=None, leader=None, arrows=True, tolerance=1e-4, limits=None):
    """A net: dots, links, arrows, paths and leader of a panel."""
    assert panel.title == title
    assert (panel.horizontal, panel.vertical, panel.even) == ("$x$", "$y$", True)
    assert panel.legend == ()
    dots = one(panel.of("agents", "dots")).points
    assert_allclose(dots, q, atol=tolerance)
    assert linked_pairs(dots, panel.of("links")) == set(pairs)
    found = panel.of("velocities", "arrows")
    if arrows:
        arrow = one(found)
        assert_allclose(arrow.points, dots, atol=1e-9)
        seconds = float((arrow.way * p).sum() / (p**2).sum())
        assert seconds > 0
        assert_allclose(arrow.way, seconds * p, atol=tolerance * max(seconds, 1.0))
    else:
        assert found == []
    paths = panel.of("trails", "line")
    if trails is None:
        assert paths == []
    else:
        assert len(paths) == len(q)
        start, through = trails
        assert_allclose([path.points[0] for path in paths], start, atol=1e-9)
        assert_allclose([path.points[-1] for path in paths], dots, atol=1e-9)
        assert all(path.style != "-" for path in paths), "paths are dotted"
        for path, points in zip(paths, through, strict=True):
            far = [np.sqrt(((path.points - x) ** 2).sum(axis=1)).min() for x in points]
            assert max(far) < 0.35, "a path leaves out where the agent was"
    mark = panel.of("leader", "dots")
    if leader is None:
        assert mark == []
    else:
        place, velocity = leader
        assert_allclose(one(mark).points, [place], atol=1e-9)
        guides = panel.of("leader velocity", "arrows")
        assert len(guides) == (velocity is not None)
        for guide in guides:
            assert_allclose(guide.points, [place], atol=1e-9)
            x, y = guide.way[0]
            assert x * velocity[0] + y * velocity[1] > 0
            assert_allclose(x * velocity[1], y * velocity[0], atol=1e-9)
    window(panel, [*dots, *([] if leader is None else [leader[0]])], limits)


def window(panel, points, limits=None):
    """The axes hold every point, and little more; or they are these."""
    low = np.array([panel.horizontal_limits[0], panel.vertical_limits[0]])
    high = np.array([panel.horizontal_limits[1], panel.vertical_limits[1]])
    if limits is not None:
        assert_allclose([low, high], limits, rtol=1e-9, atol=1e-9)
        return
    points = np.array(points)
    assert (points > low).all(), "an agent lies outside the axes"
    assert (points < high).all(), "an agent lies outside the axes"


def function(panel, name, values, *, between, tolerance=1e-9, label=None):
    """A curve follows its function over the whole of an interval."""
    found = panel.of(name, "line") if label is None else [panel.named(label)]
    points = np.concatenate([m.points for m in found])
    assert_allclose([points[:, 0].min(), points[:, 0].max()], between, atol=1e-6 * (between[1] - between[0]))
    assert len(points) >= 100, "a curve of so few points has corners"
    assert np.diff(np.sort(points[:, 0])).max() < 0.02 * (between[1] - between[0]), "the curve has a gap"
    expected = np.array([values(x) for x in points[:, 0]])
    shown = np.isfinite(points[:, 1])
    assert shown.mean() > 0.98
    assert_allclose(points[shown, 1], expected[shown], rtol=tolerance, atol=tolerance)


def agents_over_time(panel, values, count, *, between, tolerance):
    """A line per agent follows ``values(t)``, shape (K, count), for its own times."""
    lines = panel.of("agents", "line")
    assert len(lines) == count
    for k, line in enumerate(lines):
        t = line.points[:, 0]
        assert_allclose([t[0], t[-1]], between, atol=1e-9)
        assert (np.diff(t) > 0).all()
        looked = np.unique(np.linspace(0, len(t) - 1, 40).astype(int))
        assert_allclose(line.points[looked, 1], values(t[looked])[:, k], atol=tolerance)
    assert_allclose(panel.horizontal_limits, between)
    assert panel.horizontal == "$t$"
    every = np.concatenate([line.points[:, 1] for line in lines])
    low, high = panel.vertical_limits
    assert low < every.min() < every.max() < high, "a line leaves the axes"
    assert high - low < 1.5 * np.ptp(every) + 10, "the lines are flattened"
