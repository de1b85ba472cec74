"""Which obstacles are near which tiles, against every obstacle for every tile, while agents and obstacles move."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.neighbours.obstacle_lists import ObstacleLists
from flocking.engine.tiles.options import TilesOptions
from flocking.engine.tiles.session import TilesSession

RANGE = 4.2
SIDE = 300.0


def balls(rng, m, count):
    return [fk.Ball(rng.uniform(0, SIDE, m), float(rng.uniform(1, 20))) for _ in range(count)]


def moving(rng, m, count):
    return [fk.Ball(fk.Velocity(rng.normal(size=m) * 3, start=rng.uniform(0, SIDE, m)), 5.0) for _ in range(count)]


def on_paths(rng, m, count):
    found = []
    for _ in range(count):
        path = fk.Path(["0.05*exp(0.7*t)", *["0.1*sin(2*t)"] * (m - 1)], start=rng.uniform(0, SIDE, m))
        found.append(fk.Ball(path, 5.0))
    return found


def walls_and_balls(rng, m, count):
    return [fk.Wall(np.zeros(m), np.eye(m)[0]), fk.Wall(np.full(m, SIDE), -np.ones(m)), *balls(rng, m, count)]


def polygons(rng, m, count):
    corners = np.array([[0.0, 0.0], [30.0, 5.0], [10.0, 25.0]])
    return [fk.ConvexPolygon(corners + rng.uniform(0, SIDE, 2), 2.0) for _ in range(count)]


FIELDS = {"balls": balls, "moving": moving, "on paths": on_paths, "walls": walls_and_balls, "polygons": polygons}


def law_with(obstacles, m):
    way = fk.Velocity(np.eye(m)[0])
    avoid = fk.Avoid(tuple(obstacles), way, range=RANGE, attraction=fk.Potential("0.1*(r - 2)**2"))
    return fk.Law(fk.Proximity(1.5), [fk.Consensus(1.0), avoid])


def tiles_of(rng, m, count, where):
    """Agents of ``count`` tiles, those of a tile beside each other, shape (m, 16 count)."""
    middle = rng.uniform(0, SIDE, (count, m)) if where == "spread" else rng.normal(150.0, 20.0, (count, m))
    if where == "with strays":
        middle[::97] = rng.uniform(-1e7, 1e7, middle[::97].shape)
    return (middle[:, None] + rng.uniform(-2, 2, (count, 16, m))).reshape(-1, m).T.copy()


def every_one(lists, q, tiles, t):
    """What a look at every obstacle for every tile finds."""
    boxes = q.reshape(len(q), tiles, 16)
    low, high = boxes.min(axis=2), boxes.max(axis=2)
    centre, radius = 0.5 * (low + high).T, 0.5 * np.sqrt(((high - low) ** 2).sum(axis=0))
    found = []
    for g, reach in enumerate(lists.ranges):
        distance = lists.obstacle_distances.distances(g, centre, t)
        found.append(~(distance > reach + radius[:, None] * (1 + 1e-9) + lists.margin))
    return found


@pytest.mark.parametrize("where", ["spread", "in one place", "with strays"])
@pytest.mark.parametrize(("field", "m"), [(name, m) for name in FIELDS for m in (2, 3) if m == 2 or name != "polygons"])
def test_lists_are_those_of_a_look_at_every_obstacle(field, m, where):
    for tiles in (1, 7, 700):
        rng = np.random.default_rng(tiles)
        law = law_with(FIELDS[field](rng, m, 40), m)
        lists = ObstacleLists(law, [RANGE] * len(ObstacleLists(law, []).obstacle_distances.groups))
        q = tiles_of(rng, m, tiles, where)
        lists.require(q, tiles, 0.7, 0.01)
        some = 0
        for (begin, who), near in zip(lists.lists, every_one(lists, q, tiles, 0.7), strict=True):
            assert (np.diff(begin) == near.sum(axis=1)).all()
            assert (who == np.nonzero(near)[1]).all()
            some += near.sum()
        assert some > 0 or tiles < 700
        if field == "balls" and tiles == 700 and where == "spread":
            assert some < 0.3 * tiles * 40


def test_a_rank_without_agents_has_empty_lists():
    lists = ObstacleLists(law_with(balls(np.random.default_rng(0), 2, 5), 2), [RANGE])
    lists.require(np.zeros((2, 0)), 0, 0.0, 0.1)
    ((begin, who),) = lists.lists
    assert begin.tolist() == [0]
    assert len(who) == 0


def test_few_distances_are_computed(monkeypatch):
    rng = np.random.default_rng(0)
    lists, counted = ObstacleLists(law_with(balls(rng, 2, 60), 2), [RANGE]), []
    clearance = lists.obstacle_distances.clearance
    monkeypatch.setattr(
        lists.obstacle_distances, "clearance", lambda g, q, *a: counted.append(len(q)) or clearance(g, q, *a)
    )
    lists.require(tiles_of(rng, 2, 6250, "spread"), 6250, 0.0, 0.01)
    assert 0 < sum(counted) < 0.2 * 6250 * 60


@pytest.mark.parametrize("field", ["moving", "on paths"])
def test_nobody_in_range_is_missing_while_agents_and_obstacles_move(field):
    rng = np.random.default_rng(1)
    tiles, m, step = 300, 2, 0.05
    lists = ObstacleLists(law_with(FIELDS[field](rng, m, 40), m), [RANGE])
    q = tiles_of(rng, m, tiles, "spread")
    p = rng.normal(size=q.shape)
    p *= 0.1 / np.sqrt((p**2).sum(axis=0))
    builds, t, met = 0, 0.0, 0
    for _ in range(160):
        before = lists.lists
        lists.require(q, tiles, t, step)
        builds += lists.lists is not before
        begin, who = lists.lists[0]
        listed = np.zeros((tiles, 40), dtype=bool)
        listed[np.repeat(np.arange(tiles), np.diff(begin)), who] = True
        near = (lists.obstacle_distances.distances(0, q.T.copy(), t) <= RANGE).reshape(tiles, 16, 40).any(axis=1)
        assert not (near & ~listed).any()
        met += near.sum()
        q, t = q + step * p, t + step
        lists.moved(0.1 * step, step)
    assert met > 1000
    assert 3 < builds < 150
    assert listed.mean() < 0.3


def test_forces_have_the_bits_of_a_look_at_every_obstacle(monkeypatch):
    rng = np.random.default_rng(2)
    start = fk.start.box(2000, side=SIDE, speed=1.0, seed=0)
    for field in FIELDS:
        law = law_with(FIELDS[field](rng, 2, 40), 2)
        scenario = fk.Scenario(law, start, t_end=1.0, frames=2)
        found = []
        for everyone in (False, True):
            with monkeypatch.context() as patch:
                if everyone:
                    near = ObstacleLists._near

                    def all_of(self, group, centre, radius, t, near=near):
                        self.speed = np.inf
                        return near(self, group, centre, radius, t)

                    patch.setattr(ObstacleLists, "_near", all_of)
                session = TilesSession(scenario, TilesOptions(step=0.01))
                found.append(session.accelerations())
        assert (found[0] == found[1]).all()
