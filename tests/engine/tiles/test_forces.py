"""Forces of the tiled engine against the reference, which looks at all pairs."""

import numpy as np
import pytest

import flocking as fk
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.model.leaders_and_obstacles.obstacles import Ball
from flocking.model.terms.avoidance import Avoid
from tests.bodies import Heavy
from tests.engine.tiles.laws import (
    PerAgentRadii,
    Smooth,
    accelerations,
    saber,
    shi,
    states,
    structural,
    zhou,
)

KINDS = ("random", "clustered", "lattice", "line", "straggler")


def assert_close(found, expected, scale, share=1e-12):
    error = np.linalg.norm(found - expected, axis=1)
    own = np.linalg.norm(expected, axis=1)
    assert (error <= share * (scale + own) + 1e-300).all(), f"{(error / (scale + own + 1e-300)).max():.3g}"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [2, 16, 17, 700])
def test_structural_law_in_the_plane(kind, n):
    found, expected, scale = accelerations(saber(), states(n, 2, seed=n)[kind])
    assert_close(found, expected, scale)


@pytest.mark.parametrize("kind", KINDS)
def test_structural_law_in_space(kind):
    found, expected, scale = accelerations(saber(), states(600, 3, seed=5)[kind])
    assert scale.max() > 0
    assert_close(found, expected, scale)


@pytest.mark.parametrize("kind", ["random", "clustered", "straggler"])
def test_single_precision(kind):
    found, expected, scale = accelerations(saber(), states(700, 2, seed=3)[kind], precision="float32")
    # Positions rounded to single precision move by their size times 6e-8.
    share = 2e-5 if kind == "random" else 3e-4
    near = np.linalg.norm(states(700, 2, seed=3)[kind].q, axis=1) < 1e5
    assert_close(found[near], expected[near], scale[near] + 1.0, share)


def test_coinciding_agents_feel_only_consensus():
    q = np.repeat(np.array([[0.0, 0.0], [0.5, 0.2]]), 20, axis=0)
    state = fk.State(q, np.random.default_rng(1).normal(size=q.shape))
    found, expected, scale = accelerations(saber(), state)
    assert np.isfinite(found).all()
    assert_close(found, expected, scale)


def test_one_agent_alone():
    state = fk.State([[1.0, 2.0]], [[3.0, 4.0]])
    found, _, _ = accelerations(saber(), state)
    assert (found == 0).all()


def test_every_part_together():
    """Masses, damping, piecewise potential with sin and log, hashed weights, per-agent gains, leader, compensation."""
    n = 400
    rng = np.random.default_rng(2)
    agents = fk.Agents(masses=rng.uniform(0.05, 1, n), damping=rng.uniform(0, 2, n))
    leader = fk.Path(["sin(t)", "cos(t)"])
    law = fk.Law(
        fk.Proximity(4.0),
        [
            fk.Gradient(shi()),
            fk.Consensus(rng.uniform(0.5, 2, n), weights=fk.HashedWeights(0.2, 1.0, seed=7)),
            fk.Track(leader, position_gain=0.3, velocity_gain=rng.uniform(0, 1, n), per_mass=True),
            fk.Compensate(),
        ],
    )
    for kind in ("random", "clustered"):
        state = states(n, 2, seed=9, side=1.6)[kind]
        found, expected, scale = accelerations(law, fk.State(state.q, state.p, t=0.7), agents=agents)
        assert_close(found, expected, (scale + 1) / np.asarray(agents.masses))


def test_matrix_weights_and_shared_saturated_tracking():
    n = 60
    rng = np.random.default_rng(3)
    track = fk.Track(fk.Sink([5.0, 1.0]), position_gain=1.0, velocity_gain=0.5, shared=True, saturated=True)
    law = fk.Law(fk.Proximity(1.5), [fk.Consensus(0.7, weights=rng.random((n, n))), track])
    found, expected, scale = accelerations(law, states(n, 2, seed=4)["random"])
    assert_close(found, expected, scale + 1)


@pytest.mark.parametrize("bump", ["cosine", "quintic", "infinite"])
def test_smooth_graphs(bump):
    law = fk.Law(Smooth(1.4, 0.6, bump), [fk.Gradient(structural()), fk.Consensus(1.0, weighted=True)])
    found, expected, scale = accelerations(law, states(400, 2, seed=6)["random"])
    assert_close(found, expected, scale)


def test_one_radius_per_agent_with_force_weighting():
    n = 300
    radii = np.random.default_rng(8).uniform(0.5, 2.5, n)
    law = fk.Law(PerAgentRadii(radii), [fk.Gradient(structural()), fk.Consensus(1.0)])
    found, expected, scale = accelerations(law, states(n, 2, seed=8)["clustered"])
    assert_close(found, expected, scale)


def test_fixed_graph():
    n = 50
    law = fk.Law(
        fk.Fixed.random_connected(n, 0.2, seed=1), [fk.Gradient(fk.Potential("1/r**2 + log(r**2)")), fk.Consensus(1.0)]
    )
    for kind in ("random", "straggler"):
        found, expected, scale = accelerations(law, states(n, 2, seed=1)[kind])
        assert_close(found, expected, scale)


def test_two_graphs_in_one_law():
    n = 120
    everyone = fk.Fixed(n, tuple((k, (k + 1) % n) for k in range(n)), directed=True)
    law = fk.Law(fk.Proximity(1.2), [fk.Gradient(structural()), fk.Consensus(0.5, over=everyone)])
    found, expected, scale = accelerations(law, states(n, 2, seed=2)["random"])
    assert_close(found, expected, scale)


def test_hysteresis_starts_linked_within_the_radius():
    state = states(200, 2, seed=4, side=3.0)["random"]
    found, expected, scale = accelerations(zhou(), state)
    assert_close(found, expected, scale)


def test_hysteresis_takes_given_links():
    law = zhou()
    q = np.array([[0.0, 0.0], [3.8, 0.0], [0.0, 3.85], [2.0, 2.0]])
    links = np.zeros((4, 4), dtype=bool)
    links[0, 1] = links[1, 0] = True
    state = fk.State(q, np.zeros_like(q), links=law.graph.update(q, links))
    assert not state.links[0, 2]
    found, expected, scale = accelerations(law, state)
    assert_close(found, expected, scale)


FORMULAS = [
    "exp(-r)*cos(3*r) + tanh(r)/2",
    "where(r < 0.8, 1/r, where(r <= 1.1, 2.5 - 1.5*r, 0.1*r**3)) + atan(r)",
    "abs(r - 0.9)**3 + sqrt(r)*log(1 + r) - r**1.7",
]


@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.0])
def test_powers_with_a_parameter_have_whole_exponents_of_negative_numbers(exponent, precision):
    law = fk.Law(fk.Proximity(1.6), [fk.Gradient(fk.Potential("(r - 1)**k + (1 + r)**(-k)", k=exponent))])
    # The square of side 1 has distances at which the base is zero.
    state = fk.State([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.3, 0.2]])
    found, expected, scale = accelerations(law, state, precision=precision)
    assert_close(found, expected, scale + 1.0, 1e-12 if precision == "float64" else 1e-5)


@pytest.mark.parametrize("formula", FORMULAS)
def test_formulas_of_users(formula):
    law = fk.Law(fk.Proximity(1.2), [fk.Gradient(fk.Potential(formula))])
    found, expected, scale = accelerations(law, states(300, 2, seed=7)["random"])
    assert_close(found, expected, scale, 1e-11)


def test_five_thousand_agents_against_a_tree():
    """Pairs from another program, slopes from the potential itself."""
    from scipy.spatial import cKDTree

    psi, state = structural(), states(5000, 2, seed=12)["clustered"]
    session = TilesSession(fk.Scenario(saber(), state, t_end=1, frames=1), TilesOptions(step=0.01, ledger=False))
    i, j = cKDTree(state.q).query_pairs(1.2, output_type="ndarray").T
    d, v = state.q[j] - state.q[i], state.p[j] - state.p[i]
    r = np.linalg.norm(d, axis=1)
    force = (psi.slope(r) / r)[:, None] * d + v
    expected, scale = np.zeros_like(state.q), np.zeros(state.n)
    for sign, who in ((1, i), (-1, j)):
        np.add.at(expected, who, sign * force)
        np.add.at(scale, who, np.linalg.norm(force, axis=1))
    assert_close(session.accelerations(), expected, scale)


def test_ledger_kernel_gives_the_same_forces_and_the_reference_energies():
    law, state = saber(), states(300, 2, seed=10)["random"]
    scenario = fk.Scenario(law, state, t_end=1, frames=1)
    session = TilesSession(scenario, TilesOptions(step=0.01))
    told = fk.evaluate(law, state)
    sums = session._integrator.ledger_sums.sums
    assert sums["pairs"] + sums["bodies"] == pytest.approx(told.storage, rel=1e-12)
    assert sums["kinetic"] == pytest.approx(told.kinetic, rel=1e-12)
    assert sums["dissipated"] == pytest.approx(told.dissipation, rel=1e-12)
    assert_close(session.accelerations(), told.u, told.pair_force_sum)


def test_refuses_by_name():
    state = states(10, 2)["random"]
    with pytest.raises(fk.FlockingError, match=r"Heavy agents, whose kinetic energy is another one.*exact"):
        fk.simulate(fk.Scenario(saber(), state, t_end=1, agents=Heavy()), engine="tiles")
    flat = fk.State(np.zeros((3, 1)) + np.arange(3)[:, None])
    with pytest.raises(fk.FlockingError, match="1 dimensions"):
        fk.simulate(fk.Scenario(fk.Law(fk.Proximity(1.0), [fk.Consensus(1.0)]), flat, t_end=1), engine="tiles")
    with pytest.raises(fk.InvalidInput, match="steps"):
        fk.simulate(fk.Scenario(saber(), state, t_end=1), engine="tiles", steps=3)


def avoiding(obstacles):
    leader = fk.Velocity([2.0, 0.5])
    return fk.Law(
        fk.Proximity(1.2),
        [
            fk.Gradient(structural()),
            fk.Consensus(1.0),
            fk.Track(leader, velocity_gain=2.0),
            Avoid(obstacles, leader, range=1.5, attraction=structural(2.0)),
        ],
    )


def test_many_obstacles():
    rng = np.random.default_rng(5)
    balls = [Ball(c, r) for c, r in zip(rng.random((40, 2)) * 25, rng.uniform(0.3, 2.0, 40), strict=True)]
    moving = Ball(fk.Velocity([3.0, 1.0], start=[5.0, 5.0]), 1.0)
    state = states(600, 2, seed=5)["random"]
    found, expected, scale = accelerations(avoiding([*balls, moving]), fk.State(state.q, state.p, t=0.3))
    assert_close(found, expected, scale + 1 + np.linalg.norm(expected, axis=1), 1e-11)


@pytest.mark.parametrize("kind", ["random", "clustered"])
def test_sigma_norms_of_links_and_obstacles(kind):
    leader = fk.Velocity([2.0, 1.0], start=[5.0, 5.0])
    potential = fk.Potential("sqrt(1 + (r**2/(1 + sqrt(1 + r**2/10)) - 1)**2)")
    balls = tuple(Ball([x, y], 1.0) for x, y in ((3.0, 4.0), (9.0, 12.0), (20.0, 1.0)))
    avoid = Avoid(balls, range=1.2, gamma_agents=False, sigma_norm=0.1, fading_damping=True, onset=0.7)
    terms = (
        fk.Gradient(potential, weighting="force"), fk.Consensus(1.0, weighted=True),
        fk.Track(leader, 0.7, 0.0, saturated=True), fk.Track(leader, 0.0, 0.3), avoid,
    )  # fmt: skip
    law = fk.Law(Smooth(1.4, 0.2, sigma_norm=0.1), terms)
    found, expected, scale = accelerations(law, states(700, 2, seed=9)[kind])
    assert_close(found, expected, scale + np.linalg.norm(expected, axis=1), share=1e-11)
