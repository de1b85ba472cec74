import dataclasses

import numpy as np
import pytest

import flocking as fk
from flocking.show import group_series, series
from flocking.show.phase import phase
from flocking.show.style import PALETTE, RED, VERMILION


def lines(axes, part):
    return np.array(part(axes, "agents").get_segments())


@pytest.mark.parametrize("axis", [0, 1])
def test_components_are_those_of_the_run(run, part, axis):
    velocity, position = series.velocities(run, axis), series.positions(run, axis)
    assert np.array_equal(lines(velocity, part)[:, :, 1], run.p[:, :, axis].T)
    assert np.array_equal(lines(position, part)[:, :, 1], run.q[:, :, axis].T)
    assert np.array_equal(lines(position, part)[0, :, 0], run.t)
    assert velocity.get_ylabel() == f"$p_{{{'xy'[axis]}}}$"
    low, high = velocity.get_ylim()
    assert low < run.p[:, :, axis].min()
    assert high > run.p[:, :, axis].max()
    assert velocity.get_xlim() == (0.0, 3.0)


def test_leader_line(led, run, part, has):
    dashed = part(series.positions(led, 0), "leader")
    assert np.allclose(dashed.get_ydata(), 10 + 3 * led.t)
    assert dashed.is_dashed()
    assert not part(series.velocities(led, 0, leader="solid"), "leader").is_dashed()
    assert dashed.get_color() == RED
    assert series.positions(led, 0).get_ylim()[1] > 19.0
    from matplotlib.colors import to_hex

    drawn = part(series.velocities(led, 0, agents="dotted"), "agents")
    assert drawn.get_linestyle()[0][1] is not None
    assert not {RED.lower(), VERMILION.lower()} & {to_hex(c) for c in drawn.get_colors()}
    assert {to_hex(c) for c in part(series.velocities(run), "agents").get_colors()} == {c.lower() for c in PALETTE}
    with pytest.raises(fk.InvalidInput, match="agents"):
        series.velocities(led, agents="wavy")
    assert not has(series.velocities(led, leader="none"), "leader")
    assert not has(series.velocities(run), "leader")


def test_errors_about_leader_and_mean(led, part):
    assert np.allclose(lines(series.velocity_errors(led, 1), part)[:, :, 1], led.p[:, :, 1].T - 3.0)
    about_mean = lines(series.velocity_errors(led, 0, about="mean"), part)[:, :, 1]
    assert np.abs(about_mean.mean(axis=0)).max() < 1e-12
    unled = led.scenario.with_(law=fk.Law(led.scenario.law.graph, led.scenario.law.pair_terms))
    without = series.velocity_errors(dataclasses.replace(led, scenario=unled))
    assert np.array_equal(lines(without, part)[:, :, 1], about_mean)
    heavy = dataclasses.replace(
        led, scenario=led.scenario.with_(agents=fk.Agents(masses=np.r_[1e12, np.ones(9)]))
    )  # fmt: skip
    assert np.abs(lines(series.velocity_errors(heavy, 0, about="mean"), part)[0, :, 1]).max() < 1e-9


def test_centre_errors(led, run):
    axes = series.centre_errors(led, quantity="position")
    axes.figure.canvas.draw()
    # Above the axes, where no curve is.
    assert axes.get_legend().get_window_extent().y0 >= axes.bbox.y1
    drawn = [line.get_ydata() for line in axes.lines if line.get_label() in ("$x$", "$y$")]
    assert np.allclose(np.array(drawn).T, led.q.mean(axis=1) - (10 + 3 * led.t)[:, None])
    with pytest.raises(fk.InvalidInput, match="leader"):
        series.centre_errors(run)


def test_energy_shows_the_ledger_and_its_residual(run, part, has):
    axes = group_series.energy(run)
    for name in ("energy", "kinetic", "dissipated", "jumped"):
        assert np.array_equal(part(axes, name).get_ydata(), run.trace[name])
    assert not has(axes, "supplied")
    main, below = axes.figure.axes
    assert main is axes
    assert np.array_equal(part(below, "residual").get_ydata(), run.residual)
    assert below.get_ylim() != main.get_ylim()
    assert not has(axes, "departed")


def test_energy_shows_what_departed_from_the_law(part):
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2")), fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 1.0]])
    held = fk.simulate(fk.Scenario(law, start, t_end=2, control=fk.Held(0.2)), progress=False)
    axes = group_series.energy(held)
    assert np.array_equal(part(axes, "departed").get_ydata(), held.trace["departed"])
    assert held.trace["departed"].any()


def test_spread_is_logarithmic_and_has_no_zero(run, synthetic):
    axes = group_series.spread(run)
    assert axes.get_yscale() == "log"
    away = np.linalg.norm(run.p - run.p.mean(axis=1, keepdims=True), axis=2)
    assert np.allclose(axes.lines[0].get_ydata(), away.max(axis=1))
    still = group_series.spread(synthetic(4, moving=False))
    assert still.get_yscale() == "linear"


def test_connectivity_of_known_nets(synthetic, part):
    what = synthetic(4, frames=3)
    full = ~np.eye(4, dtype=bool)
    pairs = np.zeros((4, 4), dtype=bool)
    pairs[0, 1] = pairs[1, 0] = pairs[2, 3] = pairs[3, 2] = True
    axes = group_series.connectivity(dataclasses.replace(what, links=np.array([full, pairs, ~full & pairs & full])))
    values = part(axes, "algebraic connectivity").get_ydata()
    assert values == pytest.approx([4.0, 0.0, 0.0], abs=1e-12)
    beside = axes.figure.axes[1]
    assert list(part(beside, "flocks").get_ydata()) == [1, 2, 4]


def test_closest_pair_marks_the_certified_minimum(run, part):
    axes = group_series.closest(run)
    nearest = []
    for q in run.q:
        d = np.linalg.norm(q[:, None] - q[None], axis=2)
        nearest.append(d[np.triu_indices(run.n, 1)].min())
    assert np.allclose(part(axes, "frames").get_ydata(), nearest)
    mark = part(axes, "certified linked")
    assert (mark.get_xdata()[0], mark.get_ydata()[0]) == (run.closest_linked.time, run.closest_linked.distance)
    assert mark.get_ydata()[0] <= min(nearest)


def test_rug_of_links_made_and_lost(run, part):
    axes = group_series.links(run)
    appeared = run.switches["kind"] == "appear"
    made = {(s["time"], *sorted((s["i"], s["j"]))) for s in run.switches[appeared]}
    assert len(part(axes, "made").get_segments()) == len(made) > 0
    assert sorted(s[0, 0] for s in part(axes, "made").get_segments()) == pytest.approx(sorted(t for t, *_ in made))
    assert len(part(axes, "lost").get_segments()) == (run.switches["kind"] == "break").sum()
    assert part(axes, "count").get_ydata()[-1] == np.triu(run.links[-1]).sum()


def test_phase_portrait(run, part):
    axes = phase(run, (0, 3))
    path = part(axes, "path")
    apart = run.q[:, 3] - run.q[:, 0]
    assert np.allclose(path.get_xdata(), np.linalg.norm(apart, axis=1))
    # The drawn rate is the slope of the drawn distance.
    r, rate = path.get_xdata(), path.get_ydata()
    assert np.allclose(r * rate, ((run.q[:, 3] - run.q[:, 0]) * (run.p[:, 3] - run.p[:, 0])).sum(axis=1))
    middle = np.diff(r) / np.diff(run.t)
    assert np.abs(middle[-8:] - (rate[:-1] + rate[1:])[-8:] / 2).max() < 0.02
    well = part(axes.figure.axes[1], "potential")
    x, y = well.get_data()
    inside = np.isfinite(y)
    assert np.allclose(y[inside], 1 / x[inside] + 1 / (4 - x[inside]))
    i, j = run.closest_linked.pair
    assert phase(run).get_xlabel() == f"$r_{{{i},{j}}}$"


@pytest.mark.parametrize("draw", [lambda r: phase(r, (0, 0)), lambda r: phase(r, (0, 10)),
                                  lambda r: series.velocities(r, 2), lambda r: series.positions(r, leader="thick"),
                                  lambda r: series.velocity_errors(r, about="leader")])  # fmt: skip
def test_bad_choices_are_refused(run, draw):
    with pytest.raises(fk.InvalidInput):
        draw(run)


def test_one_agent_has_no_pair(synthetic):
    alone = synthetic(1, frames=3)
    for draw in (phase, group_series.closest):
        with pytest.raises(fk.InvalidInput, match="two agents"):
            draw(alone)
    for draw in (group_series.connectivity, group_series.links, group_series.energy, series.velocities):
        axes = draw(alone)
        assert np.isfinite([*axes.get_xlim(), *axes.get_ylim()]).all()


def test_a_crowd_is_one_faint_hue(synthetic, part):
    collection = part(series.velocities(synthetic(200)), "agents")
    assert len(collection.get_segments()) == 200
    assert len(np.unique(collection.get_edgecolor(), axis=0)) == 1
    assert collection.get_alpha() < 0.5


@pytest.mark.parametrize("n", [12, pytest.param(150, marks=pytest.mark.slow)])
def test_pictures_of_periodic_space_take_nearest_images(part, n):
    """Lengths of links and closest pairs against explicit images, for few agents and for many; all leave the box."""
    rng = np.random.default_rng(3)
    side = 1.2 * np.sqrt(n)
    law = fk.Law(fk.Proximity(1.5), [fk.Consensus(0.2)])
    q, p = rng.random((n, 2)) * side, rng.normal(size=(n, 2)) + [side, 0.0]
    # The closest pair at the start meets across the border.
    q[:2], p[:2] = [[1e-3, 0.5], [side - 1e-3, 0.5]], [side, 0.0]
    start = fk.State(q, p)
    made = fk.simulate(fk.Scenario(law, start, t_end=2.0, frames=5, space=fk.Periodic([side, side])), progress=False)
    shifts = side * np.array([[a, b] for a in range(-5, 6) for b in range(-5, 6)])
    nearest, deviation = [], []
    for k, q in enumerate(made.q):
        apart = np.linalg.norm((q[:, None] - q[None])[:, :, None] + shifts, axis=3).min(axis=2)
        nearest.append(apart[np.triu_indices(n, 1)].min())
        lengths = apart[np.triu(made.links_at(k))]
        deviation.append(np.sqrt(np.mean((lengths / lengths.mean() - 1) ** 2)))
    assert part(group_series.closest(made), "frames").get_ydata() == pytest.approx(nearest)
    assert part(group_series.lattice(made), "link length deviation").get_ydata() == pytest.approx(deviation)
