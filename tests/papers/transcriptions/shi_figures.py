"""Fig. 1 to 12 of Shi, Wang, Chu: what is drawn, held against the printed laws and their motions."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp

from flocking.papers.shi_2009.system import SETTINGS
from tests.papers.transcriptions import drawn
from tests.papers.transcriptions import transcribed as by_hand

KEY, A, R, END = "shi-2009", 0.05, 4.0, 3.0


def value(x, a, b, radius):
    if x <= np.sqrt(b / a):
        return a * np.log(x**2) + b / x**2
    inner = (1 + (min(x, radius) ** 2 - b / a) / (radius**2 - b / a)) * np.pi
    return a * (1 + np.log(b / a)) + np.cos(inner) + 1


def slope(x, a, b, radius):
    near = 2 * a / x - 2 * b / x**3
    inner = (1 + (x**2 - b / a) / (radius**2 - b / a)) * np.pi
    far = -np.sin(inner) * 2 * x * np.pi / (radius**2 - b / a)
    return np.where(x <= np.sqrt(b / a), near, np.where(x <= radius, far, 0.0))


def leader(t):
    return np.array([1 - np.cos(t), np.sin(t)]), np.array([np.sin(t), np.cos(t)]), np.array([np.cos(t), -np.sin(t)])


@cache
def motion(name):
    """Dense motion of a setting over its first three seconds, and its masses: start, gains and weights drawn here."""
    setting, rng = SETTINGS[name], np.random.default_rng([0, 2009])
    m, _, h = rng.uniform(0.05, 1.0, 10), rng.uniform(0.0, 1.0, 10), rng.uniform(0.0, 1.0, 10)
    w = np.triu(rng.uniform(0.0, 1.0, (10, 10)), 1)
    w = w + w.T
    some = np.isin(np.arange(10), rng.permutation(10)[:5]).astype(float)
    h = (h * some if setting.velocity == "some" else h) if setting.law == 4 else np.ones(10)
    g = {"all": np.ones(10), "some": some, "none": np.zeros(10)}[setting.acceleration]
    r0 = 1.0 if setting.law == 15 else 0.0
    q, p = start()

    def rate(t, y):
        x, v = y[:20].reshape(10, 2), y[20:].reshape(10, 2)
        d = x[None] - x[:, None]
        r = np.sqrt((d**2).sum(axis=2)) + np.eye(10)
        linked = (r <= R) & ~np.eye(10, dtype=bool)
        push = np.where(linked, slope(r, A, A, R) / r, 0.0)
        x0, v0, a0 = leader(t)
        # Damping and its compensation cancel.
        u = (push[:, :, None] * d).sum(axis=1) + (np.where(linked, w, 0.0)[:, :, None] * (v[None] - v[:, None])).sum(1)
        u += m[:, None] * (-h[:, None] * (v - v0) + g[:, None] * a0 - r0 * (x - x0))
        return np.concatenate([v.ravel(), (u / m[:, None]).ravel()])

    y = np.concatenate([q.ravel(), p.ravel()])
    found = solve_ivp(rate, (0.0, END), y, "DOP853", rtol=1e-9, atol=1e-9, dense_output=True, max_step=0.03).sol
    return (lambda t: (found(t)[:20].reshape(10, 2), found(t)[20:].reshape(10, 2))), m


@cache
def start():
    """Fig. 3, shared by all simulations: the paper's own draw, redrawn until connected."""
    return by_hand.ball_start(0, radius=10.0, speed=4.0, range_of_sight=R)


def fig_1(found):
    value_axes, slope_axes = found.panels
    drawn.function(value_axes, "curve", lambda x: value(x, 1, 1, 2.0), between=(0.0, 2.0), tolerance=1e-7)
    drawn.function(slope_axes, "curve", lambda x: float(slope(x, 1, 1, 2.0)), between=(0.0, 2.0), tolerance=1e-6)
    for panel, label in ((value_axes, r"$\psi(r)$"), (slope_axes, r"$\psi'(r)$")):
        assert_allclose(panel.horizontal_limits, (0.0, 2.5), rtol=1e-9)
        assert panel.vertical == label
    assert_allclose(drawn.one(value_axes.of("minimum")).points, [[1.0, 1.0]], atol=1e-6)
    assert_allclose(sorted(m.points[0, 0] for m in value_axes.of("mark")), [1.0, 2.0], atol=1e-6)
    low, high = value_axes.vertical_limits
    assert low < 1.0 < value(2.0, 1, 1, 2.0) < high


def fig_2(found):
    for panel, function, name in zip(found.panels, (np.sin, np.cos), "xy", strict=True):
        drawn.function(panel, "curve", function, between=(0.0, 100.0))
        assert (panel.horizontal, panel.vertical) == ("$t$", f"$v^0_{name}$")
        assert_allclose(panel.horizontal_limits, (0.0, 100.0))
        low, high = panel.vertical_limits
        assert -1.5 < low < -1.0
        assert 1.0 < high < 1.5


def fig_3(found):
    q, p = start()
    panel = drawn.one(found.panels)
    pairs = drawn.pairs_within(q, R, closed=True)
    drawn.net(panel, q, p, pairs, title="$t = 0$", leader=leader(0.0)[:2], tolerance=1e-9)


def errors(panel, name, axis, about):
    at, m = motion(name)

    def values(times):
        rows = []
        for t in times:
            p = at(t)[1]
            reference = leader(t)[1] if about == "leader" else m @ p / m.sum()
            rows.append(p[:, axis] - reference[axis])
        return np.array(rows)

    drawn.agents_over_time(panel, values, 10, between=(0.0, END), tolerance=2e-4)
    assert panel.vertical.startswith(f"$p_{{i,{'xy'[axis]}}}")
    assert ("v_{0" in panel.vertical) == (about == "leader")
    assert_allclose(drawn.one(panel.of("zero")).points[:, 1], 0.0, atol=1e-12)


def errors_and_net(name):
    """Velocity errors along both axes, the centre of mass, and the last net."""

    def check(found):
        first, second, centre, last = found.panels
        errors(first, name, 0, "leader")
        errors(second, name, 1, "leader")
        at, m = motion(name)
        assert centre.legend == ("$x$", "$y$")
        for axis, label in enumerate(("$x$", "$y$")):
            points = centre.named(label).points
            assert_allclose(points[[0, -1], 0], [0.0, END], atol=1e-9)
            shown = points[:: max(1, len(points) // 40)]
            expected = [(m @ at(t)[1] / m.sum() - leader(t)[1])[axis] for t in shown[:, 0]]
            assert_allclose(shown[:, 1], expected, atol=2e-4)
        assert (centre.horizontal, centre.vertical) == ("$t$", r"$\bar{p} - v_0$")
        assert_allclose(drawn.one(centre.of("zero")).points[:, 1], 0.0, atol=1e-12)
        q, p = at(END)
        guide = leader(END)[:2]
        pairs = drawn.pairs_within(q, R, closed=True)
        drawn.net(last, q, p, pairs, title=f"$t = {END:g}$", leader=guide, tolerance=5e-4)

    return check


def about_mean(*names):
    """Velocity errors along both axes, of one simulation above those of the other."""

    def check(found):
        shown = [(name, axis) for name in names for axis in (0, 1)]
        for (name, axis), panel in zip(shown, found.panels, strict=True):
            errors(panel, name, axis, "mean")

    return check


PRINTED = {
    "4": KEY, "5": f"{KEY}-all-informed", "6": f"{KEY}-disconnected", "7": f"{KEY}-velocity-only",
    "8": f"{KEY}-position", "10": f"{KEY}-partial", "11": f"{KEY}-partial-disconnected",
}  # fmt: skip
ABOUT_MEAN = {"9": (PRINTED["7"], PRINTED["8"]), "12": (PRINTED["10"], PRINTED["11"])}
SCENARIOS = {"1": "", "2": "", "3": KEY, **PRINTED, **ABOUT_MEAN}
DRAWN = {
    "1": fig_1,
    "2": fig_2,
    "3": fig_3,
    **{number: errors_and_net(name) for number, name in PRINTED.items()},
    **{number: about_mean(*names) for number, names in ABOUT_MEAN.items()},
}
CHECKS = {f"Fig. {number}": drawn.figure(SCENARIOS, check) for number, check in DRAWN.items()}
