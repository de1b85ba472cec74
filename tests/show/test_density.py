"""Density pictures: what is drawn where, in which unit; hues of lattices."""

import numpy as np
import pytest

import flocking as fk
from flocking.errors import InvalidInput
from flocking.show.density import density
from flocking.show.lattice_orientation import lattice_colors
from flocking.study.density_maps import DensityMap, density_map


def crowd():
    """Dense in the left half of a square, four times thinner in the right one."""
    rng = np.random.default_rng(0)
    left = rng.random((40_000, 2)) * [10, 20]
    right = [10, 0] + rng.random((10_000, 2)) * [10, 20]
    q = np.concatenate([left, right])
    return fk.State(q, np.zeros_like(q))


def shades(axes):
    (image,) = axes.images
    return np.asarray(image.get_array()), image.get_extent()


def test_shades_are_densities_in_terms_of_the_reference():
    axes = density(crowd(), limits=((0, 0), (20, 20)), cell=1.0, blur=0.0, reference=50.0, span=(0.1, 20.0))
    values, extent = shades(axes)
    assert extent == [0, 20, 0, 20]
    assert values[:, :10].mean() == pytest.approx(4.0)
    assert values[:, 10:].mean() == pytest.approx(1.0)
    assert axes.get_title() == "$t = 0$"


def test_what_is_typical_is_where_half_of_the_agents_stand():
    values, _ = shades(density(crowd(), limits=((0, 0), (20, 20)), cell=1.0, blur=1.0))
    assert np.median(values[2:-2, 2:8]) == pytest.approx(1.0, abs=0.1)


def test_the_unit_scales_agents_and_obstacles():
    ball = fk.Ball([10.0, 4.0], 2.0)
    axes = density(crowd(), limits=((4, 2), (20, 18)), unit=2.0, unit_name="r", obstacles=[ball])
    assert shades(axes)[1] == [2, 10, 1, 9]
    assert (*axes.get_xlim(), *axes.get_ylim()) == (2, 10, 1, 9)
    assert axes.get_xlabel() == "$x/r$"
    (patch,) = axes.patches
    assert patch.get_xy().mean(axis=0) == pytest.approx([5.0, 2.0], abs=0.05)
    assert np.ptp(patch.get_xy(), axis=0) == pytest.approx([2.0, 2.0], abs=0.01)


def test_a_run_draws_its_own_obstacles_at_its_frame():
    ball = fk.Ball(fk.Velocity([1.0, 0.0], start=[5.0, 0.0]), 1.0)
    law = fk.Law(
        fk.Proximity(1.0), [fk.Consensus(1.0), fk.Avoid((ball,), fk.Velocity([0, 0]), range=0.5, repulsion_gain=1)]
    )
    run = fk.simulate(fk.Scenario(law, fk.start.box(30, side=3.0, seed=0), t_end=0.4, frames=3), progress=False)
    axes = fk.plot(run, "density", frame=-1).axes[0]
    (patch,) = axes.patches
    assert patch.get_xy()[:-1].mean(axis=0) == pytest.approx([5.4, 0.0], abs=1e-6)


def test_a_map_made_before_is_drawn_as_it_is():
    made = density_map(crowd().q, low=(0, 0), high=(20, 10), cell=2.0)
    values, extent = shades(density(made, reference=1.0, span=(1e-3, 1e3), bar=False))
    assert extent == [0, 20, 0, 10]
    assert np.array_equal(values, made.values)


@pytest.mark.parametrize(
    ("what", "options"),
    [
        (crowd(), {"span": (1.0, 0.5)}),
        (crowd(), {"unit": 0.0}),
        (fk.State(np.zeros((2, 3)), np.zeros((2, 3))), {}),
        (DensityMap(np.ones((2, 2)), np.zeros(2), np.ones(2)), {"blur": 1.0}),
        ("flock", {}),
    ],
)
def test_senseless_pictures_are_refused(what, options):
    with pytest.raises(InvalidInput):
        density(what, **options)


def test_one_spot_and_one_agent_are_drawn():
    for n in (1, 5):
        axes = density(fk.State(np.ones((n, 2)), np.zeros((n, 2))))
        assert np.isfinite(shades(axes)[0]).all()


def test_hues_turn_with_the_lattice_and_fade_with_its_quality():
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    colors = lattice_colors(np.exp(1j * angle))
    assert ((colors > 0.01) & (colors < 0.99)).all()
    luminance = colors**2.2 @ [0.2126, 0.7152, 0.0722]
    assert np.ptp(luminance) < 0.12
    steps = np.linalg.norm(colors - np.roll(colors, 1, axis=0), axis=1)
    assert steps.min() > 0.05
    assert lattice_colors(np.array([0j])).max() == 0
    faint, full = lattice_colors(np.array([0.4, 1.0])).sum(axis=1)
    assert faint < 0.6 * full


def test_a_run_in_periodic_space_shows_its_box_with_images():
    """Agents that have left the box are drawn in it, and nobody is thinned out at its border."""
    x = np.arange(0.25, 12.0, 0.5)
    q = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)
    p = np.broadcast_to([7.0, -3.0], q.shape)
    law = fk.Law(fk.Proximity(0.4), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, fk.State(q, p), t_end=3.0, frames=2, space=fk.Periodic([12.0, 12.0]))
    run = fk.simulate(scenario, engine="exact", progress=False)
    assert run.q[-1, :, 0].min() > 20
    values, extent = shades(density(run, cell=1.0, blur=1.0, reference=4.0, span=(0.1, 10.0)))
    assert extent == [0, 12, 0, 12]
    assert values == pytest.approx(np.ones((12, 12)), rel=1e-6)
