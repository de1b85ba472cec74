"""All with a seed takes `rng` as SPEC 7 names it: integers keep their bits, generators draw where no seed is stored."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import flocking as fk
from flocking.model.parts.description import DESCRIPTIONS, registered_names
from flocking.model.parts.seeds import seed_from
from flocking.model.parts.values import LARGEST_SEED
from flocking.papers import ALL_KEYS, paper
from flocking.study.scenario_files.scenario_file import ScenarioFileError

STARTS = {
    "start.box": lambda **seed: fk.start.box(5, side=3.0, speed=1.0, **seed),
    "start.ball": lambda **seed: fk.start.ball(5, radius=3.0, speed=1.0, **seed),
    "start.hexagonal": lambda **seed: fk.start.hexagonal(5, spacing=1.0, noise=0.1, speed=1.0, **seed),
}
FIRST = fk.start.box(3, side=3.0, speed=1.0, seed=0)
LAW = fk.Law(fk.Proximity(2.0), [fk.Consensus(1.0)])
SEEDED = {
    "Disturbed": lambda **seed: fk.Disturbed(fk.PointMass(), 0.1, 0.5, **seed),
    "Fixes": lambda **seed: fk.Fixes(0.2, **seed),
    "HashedWeights": lambda **seed: fk.HashedWeights(0.5, 1.0, **seed),
    "Heading": lambda **seed: fk.Heading(1.0, **seed),
    "Impulsive": lambda **seed: fk.Impulsive(**seed),
    "Messages": lambda **seed: fk.Messages(0.1, **seed),
    "Sample": lambda **seed: fk.Sample("random", 3, {"a": (0.0, 1.0)}, **seed),
    "Scenario": lambda **seed: fk.Scenario(LAW, FIRST, 1.0, **seed),
    "VelocityUnit": lambda **seed: fk.VelocityUnit(1.0, **seed),
}
GENERATORS = (np.random.default_rng(1), np.random.PCG64(1), np.random.RandomState(1))


def same(a: fk.State, b: fk.State) -> bool:
    return a.q.tobytes() == b.q.tobytes() and a.p.tobytes() == b.p.tobytes()


def test_every_registered_part_with_a_seed_is_tried_here() -> None:
    found = {name for name, part in registered_names().items() if part.own_fields and "seed" in part.fields}
    assert {name for name in found if hasattr(fk, name)} == SEEDED.keys() - {"Sample"}


@pytest.mark.parametrize("owner", STARTS)
def test_starts_take_whatever_makes_a_generator(owner: str) -> None:
    make = STARTS[owner]
    old = make(seed=7)
    for given in (7, np.int64(7), np.random.SeedSequence(7), np.random.default_rng(7)):
        assert same(make(rng=given), old)
    assert not same(make(rng=8), old)
    parent = np.random.SeedSequence(7)
    child = parent.spawn(1)[0]
    assert same(make(rng=child), make(seed=np.random.default_rng(child)))
    drawn = np.random.default_rng(7)
    assert same(make(rng=drawn), old)
    assert not same(make(rng=drawn), old), "a generator goes on"


@pytest.mark.parametrize("owner", STARTS)
def test_starts_refuse_two_seeds_none_and_what_makes_no_generator(owner: str) -> None:
    make = STARTS[owner]
    with pytest.raises(fk.InvalidInput, match=f"{owner}: rng must not be given beside seed"):
        make(seed=1, rng=1)
    with pytest.raises(fk.InvalidInput, match=f"{owner}: seed must be given, or rng"):
        make()
    for wrong in (-1, 1.5, True, "7", [1, 2], np.random.RandomState(1)):
        with pytest.raises(fk.InvalidInput, match=f"{owner}: rng must be"):
            make(rng=wrong)
    with pytest.raises(fk.InvalidInput, match=f"{owner}: seed must be an integer"):
        make(seed=np.random.SeedSequence(1))


def test_a_random_graph_takes_whatever_makes_a_generator() -> None:
    old = fk.Fixed.random_connected(9, 0.4, 3)
    for given in (3, np.random.SeedSequence(3), np.random.default_rng(3)):
        assert fk.Fixed.random_connected(9, 0.4, rng=given) == old
    assert fk.Fixed.random_connected(9, 0.4, rng=4) != old
    for wrong in ({}, {"seed": 1, "rng": 1}, {"rng": "x"}, {"seed": -1}):
        with pytest.raises(fk.InvalidInput, match=r"Fixed\.random_connected: (seed|rng) must"):
            fk.Fixed.random_connected(9, 0.4, **wrong)


@pytest.mark.parametrize("owner", SEEDED)
def test_what_stores_its_seed_takes_an_integer_or_a_sequence_of_seeds(owner: str) -> None:
    make = SEEDED[owner]
    assert make(seed=7).seed == 7
    for given in (7, np.int64(7), np.random.SeedSequence(7)):
        assert make(rng=given).seed == 7
        assert type(make(rng=given).seed) is int
    parent = np.random.SeedSequence(7)
    seeds = [make(rng=child).seed for child in parent.spawn(3)]
    assert len({7, *seeds}) == 4
    assert seeds == [make(rng=child).seed for child in np.random.SeedSequence(7).spawn(3)]
    assert all(0 <= seed <= LARGEST_SEED for seed in seeds)


@pytest.mark.parametrize("owner", SEEDED)
def test_what_stores_its_seed_refuses_generators_two_seeds_and_none(owner: str) -> None:
    make = SEEDED[owner]
    for wrong in GENERATORS:
        with pytest.raises(fk.InvalidInput, match=f"{owner}: rng must not be a generator.*written into files"):
            make(rng=wrong)
    with pytest.raises(fk.InvalidInput, match=f"{owner}: rng must not be given beside seed"):
        make(seed=0, rng=0)
    with pytest.raises(fk.InvalidInput, match=f"{owner}: rng must not be None"):
        make(rng=None)
    for false in (-1, 1.5, True, "7"):
        with pytest.raises(fk.InvalidInput, match=f"{owner}: rng must be"):
            make(rng=false)


def test_a_seed_given_by_place_and_rng_are_two_seeds() -> None:
    with pytest.raises(fk.InvalidInput, match="HashedWeights: rng must not be given beside seed"):
        fk.HashedWeights(0.5, 1.0, 3, rng=3)


def test_large_sequences_of_seeds_fit_into_files() -> None:
    wide = np.random.SeedSequence(2**127 + 5)
    assert 0 <= seed_from("x", wide) <= LARGEST_SEED
    assert seed_from("x", wide) == seed_from("x", wide) != seed_from("x", np.random.SeedSequence(5))
    assert seed_from("x", np.random.SeedSequence(LARGEST_SEED)) == LARGEST_SEED
    assert 0 <= seed_from("x", np.random.SeedSequence([1, 2])) <= LARGEST_SEED


def moved(*, gain: float, seed: int) -> fk.Scenario:
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(gain)])
    return fk.Scenario(law, fk.start.box(3, side=3.0, speed=1.0, seed=seed), 0.1)


def test_sweeps_take_the_root_of_their_seeds_by_either_name() -> None:
    def seeds(**root) -> list[int]:
        table = fk.sweep(moved, grid={"gain": [1.0]}, seeds=2, workers=1, progress=False, **root)
        return list(table.columns["seed"])

    assert seeds() == seeds(seed=0) == seeds(rng=0)
    assert seeds(seed=5) == seeds(rng=5) == seeds(rng=np.random.SeedSequence(5)) != seeds()
    for wrong, told in (({"seed": 0, "rng": 0}, "beside seed"), ({"rng": np.random.default_rng(0)}, "a generator")):
        with pytest.raises(fk.InvalidInput, match=f"sweep: rng must not be .*{told}"):
            seeds(**wrong)


def test_files_are_read_with_either_name(tmp_path) -> None:
    path = tmp_path / "few.toml"
    path.write_text(
        't_end = 1.0\n[graph]\nkind = "proximity"\nradius = 2.0\n[[terms]]\nkind = "consensus"\ngain = 1.0\n'
        '[start]\ndraw = "box"\nn = 3\nside = 3.0\nseed = 1\n'
    )
    plain = fk.read_scenario(path)
    assert_array_equal(plain.start.q, fk.start.box(3, side=3.0, seed=1).q)
    assert same(fk.read_scenario(path, rng=np.random.SeedSequence(4)).start, fk.read_scenario(path, seed=4).start)
    assert not same(fk.read_scenario(path, rng=4).start, plain.start)
    for wrong in ({"seed": 0, "rng": 0}, {"rng": np.random.default_rng(0)}):
        with pytest.raises(fk.InvalidInput, match="read_scenario: rng must not be"):
            fk.read_scenario(path, **wrong)
    path.write_text(path.read_text().replace("seed = 1\n", ""))
    with pytest.raises(ScenarioFileError, match="seed"):
        fk.read_scenario(path)
    path.write_text(path.read_text() + "rng = 1\n")
    with pytest.raises(ScenarioFileError, match="rng"):
        fk.read_scenario(path)


def test_files_say_seed_and_must_say_it() -> None:
    drawn = {
        part.word: part.fields for part in DESCRIPTIONS if part.word in ("box", "ball", "hexagonal", "random_connected")
    }
    assert len(drawn) == 4
    for fields in drawn.values():
        assert fields["seed"].required
        assert "rng" not in fields


def seeded_functions():
    """Functions of the papers with a seed that people call: what packages name, and the systems."""
    import inspect
    from importlib import import_module

    for key in ALL_KEYS:
        package = import_module(f"flocking.papers.{key.replace('-', '_')}")
        system = vars(import_module(f"{package.__name__}.system"))
        own = {name: f for name, f in system.items() if getattr(f, "__module__", "") == system["__name__"]}
        for name, f in {**own, **{name: getattr(package, name) for name in package.__all__}}.items():
            if inspect.isfunction(f) and not name.startswith("_") and "seed" in inspect.signature(f).parameters:
                yield f"{key} {name}", f


def test_all_functions_of_papers_with_a_seed_take_rng_and_say_so() -> None:
    import inspect

    found = dict(seeded_functions())
    assert len(found) > 30
    # This one is the rule that draws a single number.
    assert [k for k, f in found.items() if "rng" not in inspect.signature(f).parameters] == ["cucker-smale-2007 drawn"]


@pytest.mark.parametrize("key", ALL_KEYS)
def test_scenarios_of_papers_take_rng_in_the_place_of_seed(key: str) -> None:
    make = paper(key).scenario
    assert pickle.loads(pickle.dumps(make)) is make
    for given in (3, np.random.SeedSequence(3)):
        assert same(make(rng=given).start, make(seed=3).start)
        assert make(rng=given).seed == 3
    with pytest.raises(fk.InvalidInput, match="scenario: rng must not be given beside seed"):
        make(seed=3, rng=3)
    with pytest.raises(fk.InvalidInput, match="scenario: rng must not be a generator"):
        make(rng=np.random.default_rng(3))


def test_showcases_take_rng() -> None:
    from flocking.papers.showcases.shipped import SHOWCASES

    show = next(iter(SHOWCASES.values())) if isinstance(SHOWCASES, dict) else SHOWCASES[0]
    assert same(show.scenario(rng=5, agents=20).start, show.scenario(seed=5, agents=20).start)
    with pytest.raises(fk.InvalidInput, match="scenario: rng must not be given beside seed"):
        show.scenario(seed=5, rng=5, agents=20)
