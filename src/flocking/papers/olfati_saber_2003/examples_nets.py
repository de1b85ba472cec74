"""Objects of the equation table for sections 2 and 3: nets, degrees, agreement, bumps, realizations and conformations.

Every function takes a factor of the number that determines its object; 1 gives the value of the paper.
"""

from __future__ import annotations

import numpy as np

from flocking.engine.reference.control import evaluate
from flocking.model.checks import Array
from flocking.model.graphs.connectivity import Links
from flocking.model.graphs.distance_graphs import Proximity
from flocking.model.graphs.smooth_cones import SmoothCone
from flocking.model.graphs.smooth_graphs import PerAgentRadii, Smooth
from flocking.model.graphs.views import Cone, FieldOfView
from flocking.model.potentials.bumps import BUMPS
from flocking.model.state import Agents, State
from flocking.papers.olfati_saber_2003 import conformations as shapes
from flocking.papers.olfati_saber_2003 import structural_nets as structure
from flocking.papers.olfati_saber_2003 import system
from flocking.study.nets import matrices as nets
from flocking.study.nets import rigidity
from flocking.study.nets.agreement import agree, agreement_law

OPENING = 0.6
"""phi_0 of the example cones."""
RATIO = 1.407
"""k of the example conformations: just below sqrt 2."""


def scattered() -> Array:
    """Positions of six agents, two of them 1.005 r apart, shape (6, 2)."""
    gap = 1.005 * system.RADIUS
    return np.array([[0.0, 0.0], [gap, 0.0], [3.0, 4.0], [gap + 2.0, 6.0], [-5.0, 5.5], [2.0, -6.5]])


def radii(scale: float) -> Array:
    """Radii of the six agents; that of the first is r times ``scale``."""
    return np.array([system.RADIUS * scale, 4.0, 7.0, 7.5, 3.0, 6.8])


def directions() -> Array:
    """Heading angles of the six agents, two of them 1.005 phi_0 apart, shape (6,)."""
    return np.array([0.0, 0.2, 1.005 * OPENING, 0.9, 1.4, -0.5])


def ball(scale: float) -> Links:
    """Agents in the ball around the first agent, shape (6,)."""
    return np.asarray(PerAgentRadii(radii(scale)).initial(scattered())[0])


def directed_net(scale: float) -> Array:
    """Adjacency matrix of the six agents with individual radii."""
    return nets.adjacency(PerAgentRadii(radii(scale)), scattered())


def neighbours(scale: float) -> list[list[int]]:
    """Neighbours of each of the six agents."""
    return [np.flatnonzero(row).tolist() for row in directed_net(scale)]


def radius_agreement(scale: float) -> tuple[Array, Array]:
    """Nets of two agents 1.005 r apart: with the same radius (one of them times ``scale``), and with 9 and 7."""
    q = scattered()[:2]
    same, other = np.array([system.RADIUS * scale, system.RADIUS]), np.array([9.0, 7.0])
    return nets.adjacency(PerAgentRadii(same), q), nets.adjacency(PerAgentRadii(other), q)


def cone(scale: float) -> Array:
    """Adjacency of the six agents under conic neighbourhoods whose opening is scaled by ``scale``."""
    return nets.adjacency(Cone(system.RADIUS, OPENING * scale), scattered(), directions())


def cones_of_their_own(scale: float) -> Array:
    """The same with an opening and a radius for each agent."""
    openings = OPENING * scale * np.array([1.0, 0.5, 1.0, 1.2, 0.8, 2.0])
    return nets.adjacency(Cone(radii(1.0), openings), scattered(), directions())


def rotations() -> Array:
    """Attitudes of five agents: turned by 0, 0.5, 1, 2 and 3 about one axis in space, shape (5, 3, 3)."""
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.array(
        [np.eye(3) + np.sin(a) * cross + (1 - np.cos(a)) * cross @ cross for a in (0.0, 0.5, 1.0, 2.0, 3.0)]
    )


def attitude_cone(scale: float) -> tuple[Array, Array, Array]:
    """Positions and attitudes of five agents in space, and their net under (6); the opening is scaled by ``scale``."""
    q = np.array([[0.0, 0, 0], [3, 0, 1], [0, 4, 2], [9, 9, 0], [2, 2, 2]])
    opening = (1 - np.cos(1.0)) / 1.005
    return q, rotations(), nets.adjacency(Cone(system.RADIUS, opening * scale, "rotation"), q, rotations())


def chain() -> Array:
    """Five agents on a line, the last two apart from the others by 1.005 r."""
    gap = 1.005 * system.RADIUS
    return np.array([[0.0, 0.0], [3.0, 0.0], [6.0, 0.0], [6.0 + gap, 0.0], [12.0 + gap, 0.0]])


def flocks(scale: float) -> list[list[int]]:
    """Flocks of five agents with individual radii, of which several sense an agent that does not sense them."""
    net = PerAgentRadii(np.array([4.0, 1.0, 4.0, system.RADIUS * scale, 7.0]))
    return [members.tolist() for members in nets.flock_members(net.initial(chain()))]


def density(scale: float) -> float:
    """Density of the net of the five agents."""
    return nets.density(Proximity(system.RADIUS * scale, closed=True).initial(chain()))


def quasi_flock(scale: float) -> tuple[float, bool]:
    """Density of a lattice of 19 and an agent 1.005 r away from it, and whether that is a quasi-flock."""
    from flocking.model.starts import hexagonal

    q = hexagonal(19, spacing=system.DISTANCE, seed=0).q
    right = q[np.argmax(q[:, 0])] + [1.005 * system.RADIUS, 0.0]
    links = Proximity(system.RADIUS * scale, closed=True).initial(np.vstack([q, right]))
    return nets.density(links), nets.is_quasi_flock(links)


def uniform_net(scale: float) -> Array:
    """Adjacency of the six agents under (8)."""
    return nets.adjacency(Proximity(system.RADIUS * scale, closed=True), scattered())


def degrees(scale: float) -> tuple[Array, Array]:
    """In- and out-degrees of the directed net."""
    net = directed_net(scale)
    return nets.in_degree(net), nets.out_degree(net)


def degree_matrix(scale: float) -> Array:
    """Degree matrix of the directed net."""
    return nets.degree_matrix(directed_net(scale))


def laplacian(scale: float) -> Array:
    """Laplacian of the directed net."""
    return nets.laplacian(directed_net(scale))


def uniform_balance(scale: float) -> tuple[bool, Array]:
    """Whether the net of six agents with one radius, that of the first times ``scale``, is balanced; and 1^T L."""
    net = nets.adjacency(PerAgentRadii(system.RADIUS * np.array([scale, 1, 1, 1, 1, 1])), scattered())
    return nets.is_balanced(net), np.ones(6) @ nets.laplacian(net)


def column_sums(scale: float) -> tuple[Array, Array, Array]:
    """1^T L, in-degrees and out-degrees of the directed net."""
    net = directed_net(scale)
    return np.ones(6) @ nets.laplacian(net), nets.in_degree(net), nets.out_degree(net)


def field_of_view() -> Array:
    """Adjacency of the six agents with a field of view of 60 degrees about their heading (Fig. 1(b))."""
    return nets.adjacency(FieldOfView(system.RADIUS, np.pi / 3), scattered(), directions())


def opinions() -> Array:
    """Values theta of the six agents."""
    return np.array([0.3, -1.0, 2.0, 0.7, -0.4, 1.1])


def agreement_motion(scale: float) -> tuple[Array, Array]:
    """Values theta and their rates of change over a millionth of a second, the weights times ``scale``."""
    step = 1e-6
    moved = agree(opinions(), [uniform_net(1.0) * scale], [0.0, step])
    return opinions(), (moved[1] - moved[0]) / step


def agreement(scale: float) -> Array:
    """Rates omega of the six agents under (13) on the uniform net, its radius times ``scale``."""
    law = agreement_law(uniform_net(scale) > 0)
    return evaluate(law, State(opinions()[:, None]), agents=Agents(order=1)).u[:, 0]


def two_agents(distance: float, scale: float) -> Array:
    """Adjacency of two agents at ``distance``, the radius times ``scale``."""
    q = np.array([[0.0, 0.0], [distance, 0.0]])
    return nets.adjacency(Proximity(system.RADIUS * scale, closed=True), q)


def apart_and_together(scale: float) -> tuple[Array, Array]:
    """A_1 and A_2: two agents just beyond r, and just within r."""
    return two_agents(1.005 * system.RADIUS, scale), two_agents(0.995 * system.RADIUS, scale)


def two_laplacians(scale: float) -> tuple[Array, Array]:
    """L_1 and L_2."""
    first, second = apart_and_together(scale)
    return nets.laplacian(first), nets.laplacian(second)


def bump_points() -> Array:
    """Arguments of the bumps."""
    return np.array([-1.0, 0.0, 0.5, 0.83, 0.86, 0.9, 0.95, 0.99, 1.0, 1.5])


def bumps(scale: float) -> dict[str, tuple[Array, Array]]:
    """Values and slopes of each bump for k0 = 5/6 times ``scale``."""
    z, k0 = bump_points(), system.ONSET * scale
    return {name: (bump(z, k0), bump.slope(z, k0)) for name, bump in BUMPS.items()}


def steepest(scale: float) -> dict[str, float]:
    """L_rho of each bump for 1 - k0 = 1/6 times ``scale``."""
    return {name: bump.steepest(1.0 - scale / 6.0) for name, bump in BUMPS.items()}


def close() -> Array:
    """Positions of six agents, many of them between k0 r and r apart."""
    return np.array([[0.0, 0.0], [7.5, 0.0], [3.5, 6.8], [11.0, 6.6], [-4.1, 6.2], [3.0, -7.2]])


def smooth_net(scale: float) -> Array:
    """Adjacency of the close agents under (17)."""
    return nets.adjacency(Smooth(system.RADIUS * scale, system.ONSET), close())


def smooth_cone(scale: float) -> Array:
    """Adjacency of the close agents under (18), phi_0 times ``scale``."""
    return nets.adjacency(SmoothCone(system.RADIUS, system.ONSET, OPENING * scale), close(), directions())


def smooth_laplacian(scale: float) -> Array:
    """(19) for two agents 7.8 apart."""
    q = np.array([[0.0, 0.0], [7.8, 0.0]])
    return nets.laplacian(nets.adjacency(Smooth(system.RADIUS * scale, system.ONSET), q))


def beyond_reach(scale: float) -> tuple[float, float]:
    """Weight and its slope by finite differences for a pair 1.005 r apart, the radius times ``scale``."""
    graph = Smooth(system.RADIUS * scale, system.ONSET)
    gaps = 1.005 * system.RADIUS + np.array([-1e-6, 0.0, 1e-6])
    values = [nets.adjacency(graph, np.array([[0.0, 0.0], [g, 0.0]]))[0, 1] for g in gaps]
    return float(values[1]), float((values[2] - values[0]) / 2e-6)


# -- structural nets ------------------------------------------------------------------------------------


def structural_net(scale: float) -> tuple[int, float, float, float]:
    """n, d_alpha, r and k0 of the paper's simulations, as in the scenarios; r times ``scale``."""
    graph = system.smooth_net()
    return system.AGENTS, system.DISTANCE, graph.radius * scale, graph.onset


def framework(scale: float) -> Array:
    """Rigidity matrix of a chain of three, one agent's position times ``scale``."""
    q = np.array([[0.0, 0.0], [7.0 * scale, 0.0], [7.0, 7.0]])
    return rigidity.rigidity_matrix(q, Proximity(system.RADIUS).initial(q))


def lattice(scale: float) -> tuple[Array, bool]:
    """Nineteen lattice points, d_alpha times ``scale`` apart, and whether they realize (d_alpha, r)."""
    from flocking.model.starts import hexagonal

    q = hexagonal(19, spacing=system.DISTANCE * scale, seed=0).q
    return q, structure.is_realization(q, system.DISTANCE, system.RADIUS)


def polygon(scale: float) -> tuple[Array, Links, bool]:
    """Regular hexagon of side d_alpha times ``scale``: corners, links, whether it realizes (d_alpha, r)."""
    angle = np.arange(6) * np.pi / 3
    q = system.DISTANCE * scale * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    links = Proximity(system.RADIUS, closed=True).initial(q)
    return q, links, structure.is_realization(q, system.DISTANCE, system.RADIUS)


def permuted(scale: float) -> tuple[Array, bool]:
    """The lattice with its agents renumbered, and whether it still realizes (d_alpha, r)."""
    q = lattice(scale)[0][np.random.default_rng(1).permutation(19)]
    return q, structure.is_realization(q, system.DISTANCE, system.RADIUS)


def placed(scale: float) -> list[tuple[str, Array, Links]]:
    """Every conformation of (4, d_alpha, 1.2 d_alpha): name, positions times ``scale``, and links under (8)."""
    found = []
    for shape in shapes.conformations(4, 1.2):
        q = shape.placed(system.DISTANCE, 1.2) * scale
        found.append((shape.name, q, Proximity(system.RADIUS * (1 + 1e-12), closed=True).initial(q)))
    return found


def alpha_flocks(scale: float) -> list[tuple[bool, int]]:
    """Of every conformation of four agents: whether it realizes the net, and how many flocks it has."""
    return [
        (structure.is_realization(q, system.DISTANCE, system.RADIUS), nets.flocks(links))
        for _, q, links in placed(scale)
    ]


def figure_3(scale: float) -> list[tuple[Array, Links]]:
    """The six realizations of Fig. 3, (a) to (f), agents numbered as there: (e), (f) are flexings of the cycle (c)."""
    shape_and_agents = (
        ("four agents", (0, 1, 2, 3)), ("two links", (0, 1, 2, 3)), ("cycle of 4", (0, 1, 3, 2)),
        ("chain of 4", (0, 1, 2, 3)), ("two triangles", (0, 2, 3, 1)), ("two triangles", (2, 0, 1, 3)),
    )  # fmt: skip
    found = {name: q for name, q, _ in placed(scale)}
    net = Proximity(system.RADIUS * (1 + 1e-12), closed=True)
    numbered = [found[name][list(agents)] for name, agents in shape_and_agents]
    return [(q, net.initial(q)) for q in numbered]


def counts(scale: float) -> list[int]:
    """f(n, k) for n = 1 to 4 at k just below sqrt 2 times ``scale``."""
    return [shapes.count(n, RATIO * scale) for n in range(1, 5)]


def counts_over_ratio(scale: float) -> list[int]:
    """f(4, k) for some k times ``scale``."""
    return [shapes.count(4, k * scale) for k in (1.2, RATIO, 1.5, 1.75, 1.94, 2.1)]


def upper_bounds(scale: float) -> list[tuple[int, int]]:
    """f(n, k) and its upper bound for n = 1 to 4."""
    return [(found, shapes.upper_bound(n + 1)) for n, found in enumerate(counts(scale))]


def neighbourhoods(scale: float) -> dict[str, object]:
    """Fig. 1: the agents (a) within r and (b) within r and 60 degrees of the first agent's heading."""
    shell = Proximity(system.RADIUS * scale, closed=True).initial(scattered())[0]
    view = FieldOfView(system.RADIUS * scale, np.pi / 3).start_links(scattered(), directions())
    return {"shell": shell, "view": view}
