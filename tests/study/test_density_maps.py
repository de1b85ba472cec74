"""Densities on a grid: they hold the agents, whole or smoothed."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import flocking as fk
from flocking.errors import InvalidInput
from flocking.study.density_maps import density_map


def test_every_agent_is_in_its_cell():
    q = np.array([[0.5, 0.5], [1.5, 0.5], [1.6, 0.4], [2.5, 1.5], [9.0, 9.0]])
    made = density_map(q, low=(0.0, 0.0), high=(3.0, 2.0), cell=1.0)
    assert made.values.tolist() == [[1.0, 2.0, 0.0], [0.0, 0.0, 1.0]]
    assert made.agents == 4


def test_the_map_grows_to_whole_cells():
    made = density_map(np.zeros((1, 2)), low=(-1.0, -1.0), high=(1.1, 1.0), cell=0.5)
    assert made.values.shape == (4, 5)
    assert made.high.tolist() == [1.5, 1.0]


def test_smoothing_keeps_agents_and_spreads_them_evenly():
    q = np.random.default_rng(0).normal(size=(500, 2))
    sharp = density_map(q, low=(-12, -12), high=(12, 12), cell=0.1)
    exponential_damping = density_map(q, low=(-12, -12), high=(12, 12), cell=0.1, blur=0.7)
    assert exponential_damping.agents == pytest.approx(sharp.agents) == 500
    one = density_map(np.zeros((1, 2)), low=(-4.05, -4.05), high=(4.05, 4.05), cell=0.1, blur=0.7)
    x = np.arange(-4.0, 4.05, 0.1)
    bell = np.exp(-(x[:, None] ** 2 + x**2) / (2 * 0.7**2)) / (2 * np.pi * 0.7**2)
    assert np.abs(one.values - bell).max() < 0.01 * bell.max()


@pytest.mark.parametrize(("agents", "blur"), [(1, 60.0), (3, 25.0), (40, 9.0), (4000, 9.0), (4000, 0.7)])
def test_smoothing_is_the_sum_of_neighbouring_cells_however_it_is_computed(agents, blur):
    """Few agents that are smoothed widely, and many that are smoothed little, as SciPy's filter over all cells."""
    q = np.random.default_rng(agents).uniform(-20.0, 60.0, (agents, 2))
    made = density_map(q, low=(0, 0), high=(40, 30), cell=1.0, blur=blur)
    rim = int(np.ceil(4 * blur))
    around = density_map(q, low=(-rim, -rim), high=(40 + rim, 30 + rim), cell=1.0)
    expected = gaussian_filter(around.values, blur, mode="constant", truncate=4.0)[rim:-rim, rim:-rim]
    assert made.values == pytest.approx(expected, rel=1e-12, abs=1e-15 * expected.max())


def test_what_stands_outside_is_smoothed_in():
    """A uniform crowd is as dense at the border of a map as in its middle."""
    x = np.arange(-20.0, 20.0, 0.25)
    q = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2) + 0.125
    made = density_map(q, low=(-5, -5), high=(5, 5), cell=0.5, blur=1.0)
    assert made.values == pytest.approx(np.full((20, 20), 16.0), rel=1e-6)


@pytest.mark.parametrize(
    ("q", "change"),
    [
        (np.zeros((3, 3)), {}),
        (np.full((3, 2), np.nan), {}),
        (np.zeros((3, 2)), {"space": fk.Periodic([9.0, 9.0, 9.0])}),
        (np.zeros((3, 2)), {"high": (0.0, 1.0)}),
        (np.zeros((3, 2)), {"cell": 0.0}),
        (np.zeros((3, 2)), {"cell": 1e-6}),
        (np.zeros((3, 2)), {"blur": -1.0}),
        (np.zeros((3, 2)), {"blur": 1e5}),
    ],
)
def test_senseless_maps_are_refused(q, change):
    with pytest.raises(InvalidInput):
        density_map(q, **({"low": (0, 0), "high": (1, 1), "cell": 0.1} | change))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"low": [0.0]}, "low must be two numbers"), ({"high": [1.0, 2.0, 3.0]}, "high must be two numbers"),
        ({"cell": 1e10}, None), ({"high": [1e300, 1.0], "cell": 1e300}, "cell must have an area"),
        ({"high": [1e-200, 1e-200], "cell": 1e-200}, "cell must have an area"),
        ({"blur": 1e300}, "blur must reach over at most"), ({"cell": 1e-9}, "cell must give at most"),
        ({"low": [1e18, 0.0], "high": [1e18 + 2048.0, 2.0]}, "cell must be at least 128, by which coordinates"),
        ({"high": [1e6, 1.0], "space": fk.Periodic([1e-6, 1.0])}, "space must have at most 50000000 images"),
        ({"space": fk.Periodic([1e-320, 1.0])}, "space must have at most 50000000 images"),
    ],
)  # fmt: skip
def test_maps_of_extreme_sizes_are_refused_before_they_take_memory_or_overflow(change, said):
    given = {"low": [0.0, 0.0], "high": [2.0, 2.0], "cell": 1.0} | change
    if said is None:
        assert density_map(np.zeros((2, 2)), **given).values.shape == (1, 1)
        return
    with pytest.raises(InvalidInput, match=said):
        density_map(np.zeros((2, 2)), **given)


@pytest.mark.parametrize("lengths", [(3.0, 4.0), (3.0, None)], ids=["both", "one"])
@pytest.mark.parametrize("blur", [0.0, 0.4])
def test_where_space_repeats_every_image_counts(lengths, blur):
    """The same as an open map of agents and all their images, written out; agents have left the box."""
    rng = np.random.default_rng(1)
    sides = np.array([3.0, 4.0])
    q = rng.random((300, 2)) * sides
    repeats = np.array([x is not None for x in lengths])
    moved = q + rng.integers(-3, 4, q.shape) * sides * repeats
    shifts = [np.array([a, b]) * sides * repeats for a in range(-4, 5) for b in range(-4, 5)]
    images = np.unique(np.concatenate([q + x for x in shifts]).round(12), axis=0)
    window = {"low": (-1.0, 0.5), "high": (4.0, 6.5), "cell": 0.25, "blur": blur}
    made = density_map(moved, space=fk.Periodic(lengths), **window)
    assert made.values == pytest.approx(density_map(images, **window).values, abs=1e-9)
    assert made.agents > 300
    box = density_map(moved, low=(0, 0), high=sides, cell=0.25, blur=blur, space=fk.Periodic(sides.tolist()))
    assert box.agents == pytest.approx(300)


@pytest.mark.parametrize("low", [(0.0, 0.0), (-1.0, -1.0), (-1.5, 0.5), (2.7, -0.1), (3.0, 4.0), (-0.3, 1.1)])
@pytest.mark.parametrize("cell", [1.0, 0.5, 0.1])
@pytest.mark.parametrize("blur", [0.0, 0.3])
def test_a_map_of_one_box_holds_every_agent_once_wherever_it_begins(low, cell, blur):
    """Agents at the border have an image at both ends of the box, of which one is on the map."""
    q = np.stack(np.meshgrid(np.arange(0.0, 3.0, 0.1), np.arange(4.0)), axis=-1).reshape(-1, 2)
    high = (low[0] + 3.0, low[1] + 4.0)
    made = density_map(q, low=low, high=high, cell=cell, blur=blur, space=fk.Periodic([3.0, 4.0]))
    assert made.values.size == round(12.0 / cell**2)
    assert made.agents == pytest.approx(len(q), abs=1e-9)
    if not blur and cell == 1.0:
        assert made.values.sum(axis=1).tolist() == [30.0] * 4


def test_agents_on_the_upper_border_of_open_space_are_on_the_map():
    q = np.array([[1.0, 2.0], [1e300, -1e300], [1.1, 2.0]])
    assert density_map(q, low=(0, 0), high=(1, 2), cell=0.5).agents == 1.0
