"""The standard laws by a user's route alone: a TOML file, or fifteen lines of Python, give the runs of the packages."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

import flocking as fk

SECOND_ALGORITHM = """
format = 1
t_end = 2.0
frames = 5

[graph]
kind = "smooth"
radius = 8.4
onset = 0.2
sigma_norm = 0.1

[[terms]]
kind = "gradient"
weighting = "force"
formula = "5*sqrt(1 + ((sqrt(1 + eps*r**2) - 1)/eps - d)**2)"
parameters = { eps = 0.1, d = 14.289915602982239 }

[[terms]]
kind = "consensus"
gain = 1.0
weighted = true

[[terms]]
kind = "track"
position_gain = 0.05
velocity_gain = 0.4472135954999579
leader = { kind = "velocity", value = [5.0, 0.0] }

[start]
draw = "box"
n = 12
side = 20.0
speed = 1.0
seed = 3
"""

THIRD_ALGORITHM = """
format = 1
t_end = 2.0
frames = 5
start = { draw = "box", n = 12, side = 20.0, speed = 1.0, seed = 3 }

[graph]
kind = "smooth"
radius = 8.4
onset = 0.2
sigma_norm = 0.1

[[terms]]
kind = "gradient"
weighting = "force"
formula = "5*sqrt(1 + ((sqrt(1 + eps*r**2) - 1)/eps - d)**2)"
parameters = { eps = 0.1, d = 14.289915602982239 }

[[terms]]
kind = "consensus"
gain = 2.0
weighted = true

[[terms]]
kind = "track"
position_gain = 1.2
velocity_gain = 0.0
saturated = true
leader = { kind = "velocity", value = [5.0, 0.0] }

[[terms]]
kind = "track"
velocity_gain = 2.1908902300206643
leader = { kind = "velocity", value = [5.0, 0.0] }

[[terms]]
kind = "avoid"
obstacles = [{ kind = "ball", centre = { kind = "sink", point = [8.0, 4.0] }, radius = 2.0 }]
range = 4.2
repulsion_gain = 4.5
damping_gain = 4.242640687119285
onset = 0.9
sigma_norm = 0.1
fading_damping = true
gamma_agents = false

[terms.repulsion]
formula = "sqrt(1 + ((sqrt(1 + eps*r**2) - 1)/eps - d)**2) - ((sqrt(1 + eps*r**2) - 1)/eps - d)"
parameters = { eps = 0.1, d = 6.625281952496325 }
"""

ALIGNMENT = """
format = 1
t_end = 2.0
frames = 5
graph = { kind = "complete" }
terms = [{ kind = "cucker_smale", gain = 0.3, exponent = 0.4 }]
start = { draw = "ball", n = 9, radius = 3.0, speed = 3.0, seed = 4 }
"""


HEADINGS = """
format = 1
t_end = 20.0
frames = 21
graph = { kind = "proximity", radius = 1.0 }
terms = [{ kind = "velocity_average" }]
agents = { kind = "heading", speed = 0.03, noise = 2.0, seed = 5 }
control = { kind = "held", period = 1.0 }
space = { kind = "periodic", lengths = [5.0, 5.0] }
start = { draw = "box", n = 100, side = 5.0, speed = 0.03, velocities = "sphere", seed = 5 }
"""


def test_headings_from_a_file_and_in_fifteen_lines(tmp_path) -> None:
    path = tmp_path / "headings.toml"
    path.write_text(HEADINGS)
    law = fk.Law(fk.Proximity(1.0), fk.VelocityAverage())
    start = fk.start.box(100, side=5.0, speed=0.03, velocities="sphere", seed=5)
    world = {"agents": fk.Heading(0.03, noise=2.0, seed=5), "control": fk.Held(1.0), "space": fk.Periodic([5.0, 5.0])}
    written = fk.simulate(fk.Scenario(law, start, t_end=20.0, frames=21, **world), progress=False)
    packaged = fk.papers.vicsek_1995.system.group(100, 5.0, 2.0, seed=5, duration=20)
    for scenario in (fk.read_scenario(path), packaged):
        assert fk.first_difference(fk.simulate(scenario, progress=False), written) is None


def test_algorithm_1_from_a_file(tmp_path) -> None:
    head, tail = SECOND_ALGORITHM.index('[[terms]]\nkind = "track"'), SECOND_ALGORITHM.index("[start]")
    path = tmp_path / "first.toml"
    path.write_text(SECOND_ALGORITHM[:head] + SECOND_ALGORITHM[tail:])
    found = fk.read_scenario(path)
    system = fk.papers.olfati_saber_2006.system
    law = system.law(system.Algorithm(1))
    assert len(found.law.terms) == 2
    assert_allclose(fk.control(found.law, found.start), fk.control(law, found.start), rtol=1e-9, atol=1e-11)


def test_algorithm_2_from_a_file(tmp_path) -> None:
    path = tmp_path / "second.toml"
    path.write_text(SECOND_ALGORITHM)
    found = fk.read_scenario(path)
    system = fk.papers.olfati_saber_2006.system
    law = system.law(system.Algorithm(2, (1.0, 1.0, 0.05), goal=fk.Velocity([5.0, 0.0])))
    assert_allclose(fk.control(found.law, found.start), fk.control(law, found.start), rtol=1e-9, atol=1e-11)
    runs = [fk.simulate(found.with_(law=each), progress=False) for each in (found.law, law)]
    assert_allclose(runs[0].q, runs[1].q, atol=1e-7)
    assert fk.audit(runs[0])["ledger"].verdict == "holds"


def test_algorithm_3_in_fifteen_lines() -> None:
    sigma = "((sqrt(1 + eps*r**2) - 1)/eps - d)"
    reach = [(np.sqrt(1 + 0.1 * z**2) - 1) / 0.1 for z in (7.0, 4.2)]
    push = fk.Potential(f"sqrt(1 + {sigma}**2) - {sigma}", eps=0.1, d=reach[1])
    goal = fk.Velocity([5.0, 0.0])
    avoid = fk.Avoid(
        fk.Ball([8.0, 4.0], 2.0), range=4.2, repulsion=push, repulsion_gain=4.5, damping_gain=2 * np.sqrt(4.5),
        onset=0.9, sigma_norm=0.1, fading_damping=True, gamma_agents=False,
    )  # fmt: skip
    law = fk.Law(fk.Smooth(8.4, 0.2, sigma_norm=0.1), (
        fk.Gradient(fk.Potential(f"5*sqrt(1 + {sigma}**2)", eps=0.1, d=reach[0]), weighting="force"),
        fk.Consensus(2.0, weighted=True), fk.Track(goal, 1.2, 0.0, saturated=True),
        fk.Track(goal, velocity_gain=2 * np.sqrt(1.2)), avoid,
    ))  # fmt: skip
    begin = fk.start.box(12, side=20.0, speed=1.0, seed=3)
    system = fk.papers.olfati_saber_2006.system
    packaged = system.law(system.Algorithm(3, obstacles=(fk.Ball([8.0, 4.0], 2.0),), goal=goal))
    assert_allclose(fk.control(law, begin), fk.control(packaged, begin), rtol=1e-9, atol=1e-10)


def test_algorithm_3_from_a_file(tmp_path) -> None:
    path = tmp_path / "third.toml"
    path.write_text(THIRD_ALGORITHM)
    found = fk.read_scenario(path)
    system = fk.papers.olfati_saber_2006.system
    goal = fk.Velocity([5.0, 0.0])
    packaged = system.law(system.Algorithm(3, obstacles=(fk.Ball([8.0, 4.0], 2.0),), goal=goal))
    near = np.linalg.norm(found.start.q - [8.0, 4.0], axis=1) - 2.0
    assert near.min() < 4.2
    assert_allclose(fk.control(found.law, found.start), fk.control(packaged, found.start), rtol=1e-9, atol=1e-10)


def test_algorithms_1_and_2_in_fifteen_lines() -> None:
    reach = (np.sqrt(1 + 0.1 * 7.0**2) - 1) / 0.1
    psi = fk.Potential("5*sqrt(1 + ((sqrt(1 + eps*r**2) - 1)/eps - d)**2)", eps=0.1, d=reach)
    goal = fk.Velocity([5.0, 0.0])
    first = [fk.Gradient(psi, weighting="force"), fk.Consensus(1.0, weighted=True)]
    net = fk.Smooth(8.4, 0.2, sigma_norm=0.1)
    begin = fk.start.box(12, side=20.0, speed=1.0, seed=3)
    system = fk.papers.olfati_saber_2006.system
    for law, algorithm in (
        (fk.Law(net, first), system.Algorithm(1)),
        (fk.Law(net, [*first, fk.Track(goal, 0.05, 2 * np.sqrt(0.05))]), system.Algorithm(2, (1, 1, 0.05), goal=goal)),
    ):
        assert_allclose(fk.control(law, begin), fk.control(system.law(algorithm), begin), rtol=1e-9, atol=1e-10)


def test_alignment_in_fifteen_lines() -> None:
    law = fk.Law(fk.Complete(), fk.CuckerSmale(0.3, 0.4))
    begin = fk.start.ball(9, radius=3.0, speed=3.0, seed=4)
    packaged = fk.papers.cucker_smale_2007.system.law(0.3, 0.4)
    assert law == packaged
    late = {"information": fk.Delayed(0.4)}
    for world in ({}, late, {"agents": fk.Impulsive(), "control": fk.Held(0.1)}):
        runs = [
            fk.simulate(fk.Scenario(x, begin, t_end=1.0, frames=5, **world), progress=False) for x in (law, packaged)
        ]
        assert fk.first_difference(*runs) is None


def test_alignment_from_a_file(tmp_path) -> None:
    path = tmp_path / "alignment.toml"
    path.write_text(ALIGNMENT)
    found = fk.read_scenario(path)
    law = fk.papers.cucker_smale_2007.system.law(0.3, 0.4)
    assert found.law == law
    q, p = found.start.q, found.start.p
    offset = q[None] - q[:, None]
    weights = 0.3 / (1 + (offset**2).sum(axis=-1)) ** 0.4
    expected = np.einsum("ij,ijk->ik", weights, p[None] - p[:, None])
    assert_allclose(fk.control(found.law, found.start), expected, rtol=1e-12, atol=1e-13)
    assert fk.certify(found)["alignment_rate"].granted


BOIDS = """
format = 1
t_end = 2.0
frames = 3
graph = { kind = "proximity", radius = 9.0 }
agents = { kind = "impulsive", force = 27.0, speed = 9.0, update = "forward" }
control = { kind = "held", period = 0.04 }
terms = [
    { kind = "separation", weight = 12.0, radius = 5.0, cosine = -0.707, near = 1.5 },
    { kind = "alignment", weight = 8.0, radius = 7.5, cosine = 0.7, near = 1.5 },
    { kind = "cohesion", weight = 8.0, radius = 9.0, cosine = -0.15, near = 1.5 },
    { kind = "turn_back", radius = 50.0, speed = 9.0 },
]

[start]
draw = "ball"
n = 200
radius = 20.0
speed = 2.6999999999999997
velocities = "sphere"
dimension = 3
seed = 3
"""

DRONES = """
format = 1
t_end = 4.0
frames = 5
graph = { kind = "proximity", radius = 45.6668 }
control = { kind = "held", period = 0.2 }
start = { draw = "box", n = 100, side = 250.0, corner = [-125.0, -125.0], speed = 4.0, velocities = "sphere", seed = 4 }

[[terms]]
kind = "self_propulsion"
speed = 4.0

[[terms]]
kind = "linear_repulsion"
slope = 0.4
radius = 25.6668
most = 6.19664

[[terms]]
kind = "braking_alignment"
gain = 0.023802
slack = 0.5
radius = 35.6668
slope = 0.4
acceleration = 2.5
range = 100.0

[[terms]]
kind = "shill_walls"
half_width = 230.0
speed = 6.52174
acceleration = 2.5
slope = 0.4

[agents]
kind = "velocity_unit"
time_constant = 1.0
acceleration = 6.0
speed = 8.0
diffusion = 0.2
substeps = 20
seed = 4

[information]
kind = "fixes"
period = 0.2
delay = 1.0
range = 100.0
diffusion = 0.005
damping = 0.1
stiffness = 0.010540925533894598
seed = 4
"""


def test_boids_from_a_file_and_in_fifteen_lines(tmp_path) -> None:
    path = tmp_path / "boids.toml"
    path.write_text(BOIDS)
    near = {"near": 1.5}
    law = fk.Law(fk.Proximity(9.0), [
        fk.Separation(12.0, 5.0, -0.707, **near), fk.Alignment(8.0, 7.5, 0.7, **near),
        fk.Cohesion(8.0, 9.0, -0.15, **near), fk.TurnBack(50.0, 9.0),
    ])  # fmt: skip
    start = fk.start.ball(200, radius=20.0, speed=0.3 * 9.0, velocities="sphere", dimension=3, seed=3)
    world = {"agents": fk.Impulsive(force=27.0, speed=9.0, update="forward"), "control": fk.Held(0.04)}
    written = fk.simulate(fk.Scenario(law, start, t_end=2.0, frames=3, **world), progress=False)
    packaged = fk.papers.reynolds_1987.system.boids(seed=3, duration=2.0).with_(frames=3)
    for scenario in (fk.read_scenario(path), packaged):
        assert fk.first_difference(fk.simulate(scenario, progress=False), written) is None


BIRDS = """
format = 1
t_end = 10.0
frames = 11
graph = { kind = "proximity", radius = 5.0 }
agents = { kind = "heading", speed = 1.0, update = "shuffled", seed = 4 }
control = { kind = "held", period = 1.0 }
space = { kind = "periodic", lengths = [20.0, 20.0] }
terms = [
    { kind = "cohesion", weight = 0.03, radius = 5.0, total = "mean" },
    { kind = "separation", weight = 0.015, radius = 1.0, total = "mean", exponent = 0.0, among = 5.0 },
    { kind = "alignment", weight = 0.05, radius = 5.0, total = "mean", compared = "velocities", relative = false },
]
start = { draw = "box", n = 30, side = 20.0, speed = 1.0, velocities = "sphere", seed = 4 }
"""


def test_birds_from_a_file_and_in_fifteen_lines(tmp_path) -> None:
    path = tmp_path / "birds.toml"
    path.write_text(BIRDS)
    mean = {"total": "mean"}
    law = fk.Law(fk.Proximity(5.0), [
        fk.Cohesion(0.03, 5.0, **mean), fk.Separation(0.015, 1.0, exponent=0.0, among=5.0, **mean),
        fk.Alignment(0.05, 5.0, compared="velocities", relative=False, **mean),
    ])  # fmt: skip
    start = fk.start.box(30, side=20.0, speed=1.0, velocities="sphere", seed=4)
    world = {"agents": fk.Heading(1.0, update="shuffled", seed=4), "control": fk.Held(1.0)}
    scenario = fk.Scenario(law, start, t_end=10.0, frames=11, space=fk.Periodic([20.0, 20.0]), **world)
    written = fk.simulate(scenario, progress=False)
    packaged = fk.papers.reynolds_1987.system.birds(30, 20.0, 5.0, seed=4, updates=10)
    for made in (fk.read_scenario(path), packaged):
        assert fk.first_difference(fk.simulate(made, progress=False), written) is None


def test_drones_from_a_file_and_in_fifteen_lines(tmp_path) -> None:
    path = tmp_path / "drones.toml"
    path.write_text(DRONES)
    law = fk.Law(fk.Proximity(45.6668), [
        fk.SelfPropulsion(4.0), fk.LinearRepulsion(0.4, 25.6668, 6.19664),
        fk.BrakingAlignment(0.023802, 0.5, 35.6668, 2.5, 0.4, range=100.0), fk.ShillWalls(230.0, 6.52174, 2.5, 0.4),
    ])  # fmt: skip
    start = fk.start.box(100, side=250.0, corner=[-125.0, -125.0], speed=4.0, velocities="sphere", seed=4)
    spring = float(np.sqrt(10.0)) / 300
    fixes = fk.Fixes(0.2, delay=1.0, range=100.0, diffusion=0.005, damping=0.1, stiffness=spring, seed=4)
    unit = fk.VelocityUnit(1.0, acceleration=6.0, speed=8.0, diffusion=0.2, substeps=20, seed=4)
    world = {"agents": unit, "information": fixes, "control": fk.Held(0.2)}
    written = fk.simulate(fk.Scenario(law, start, t_end=4.0, frames=5, **world), progress=False)
    packaged = fk.papers.vasarhelyi_2018.system.flock(seed=4, duration=4.0)
    for scenario in (fk.read_scenario(path), packaged):
        found = fk.simulate(scenario, progress=False)
        assert_allclose(found.q, written.q, atol=1e-9)
        assert_allclose(found.p, written.p, atol=1e-9)
