"""What an exported law must give: the force by `control_of`, and the sum of the absolute values of what it adds up."""

from __future__ import annotations

import numpy as np

import flocking as fk
from flocking.engine.kernels.codegen import array_kernels
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.model.energy import Energy
from flocking.model.graph_functional import averages


def linked_at_start(law, n, agent, distance):
    """Others linked at a start in each graph, by the radii and the lists of the graphs."""
    found = []
    for graph in law.graphs:
        if graph.moves:
            radius = float(np.broadcast_to(graph.break_radius, n)[agent])
            closed = bool(getattr(graph, "closed", False))
            found.append({j for j, r in distance.items() if r < radius or (closed and r == radius)})
        else:
            links = graph.initial(np.zeros((n, 1)))
            found.append({j for j in distance if links[agent, j]})
    return found


def judged(scenario, agent, q, p, others, t):
    """Force of `control_of`, and the sum of the absolute values of all addends, shape (m,)."""
    law, n = scenario.law, scenario.start.n
    distance = {
        j: float(np.linalg.norm(scenario.space.displacement(np.asarray(x) - q))) for j, (x, _) in others.items()
    }
    linked = linked_at_start(law, n, agent, distance)
    mass, damping = (float(np.broadcast_to(x, n)[agent]) for x in (scenario.agents.masses, scenario.agents.damping))
    neighbours = {
        graph: [fk.Agent(*others[j], j) for j in sorted(found)] for graph, found in zip(law.graphs, linked, strict=True)
    }
    given = {"mass": mass, "damping": damping, "space": scenario.space}
    expected = fk.control_of(law, fk.Agent(q, p, agent), neighbours, t, **given)
    return expected, _sizes(scenario, agent, q, p, others, linked, t)


def _sizes(scenario, agent, q, p, others, linked, t):
    law, n, m = scenario.law, scenario.start.n, len(q)
    layout = Layout(law, Energy(), space=scenario.space)
    module = array_kernels(layout, m)
    P, A, W = layout.values(fk.Agents(scenario.agents.masses, scenario.agents.damping), n, t)
    total = np.zeros(m)
    own = {f"A{k}": row[agent] for k, row in enumerate(A)}
    for number, found in enumerate(linked):
        who = sorted(found)
        if not who:
            continue
        d = scenario.space.displacement(np.array([others[j][0] for j in who]) - q)
        v = np.array([others[j][1] for j in who]) - p
        r = np.sqrt((d**2).sum(axis=1))
        values = own | {"r": r, "speed2": (v**2).sum(axis=1), "radial": (d * v).sum(axis=1) / r, "push": 0.0 * r,
                        "pull": 0.0 * r}  # fmt: skip
        values |= {f"W{k}": matrix[agent, who] for k, matrix in enumerate(W)}
        values["functional"] = 1.0 / (1.0 + len(who)) if averages(law, number) else 1.0
        sizes = getattr(module, f"pair_sizes{number}")(P, values)
        unit = np.abs(d) / r[:, None]
        parts = np.broadcast_to(sizes["along"], r.shape)[:, None] * unit
        total += (
            parts
            + np.broadcast_to(sizes["drag"], r.shape)[:, None] * (np.abs(others_velocities(others, who)) + np.abs(p))
        ).sum(axis=0)
    given = own | {"t": t, **{f"q{k}": q[k] for k in range(m)}, **{f"p{k}": p[k] for k in range(m)}}
    given |= {f"mean_{letter}{k}": np.nan for letter in "qp" for k in range(m)}
    body = module.body_sizes(P, given)
    total += [float(body[f"force{k}"]) for k in range(m)]
    rows = layout.obstacle_rows()
    for group, (_, met) in enumerate(ObstacleDistances(law).met(np.asarray(q)[None], t)):
        for o in met:
            values = {k: np.reshape(x, 1) if k != "t" else x for k, x in given.items()}
            values |= {f"O{k}": np.array([row[o]]) for k, row in enumerate(rows)}
            force = getattr(module, f"obstacles{group}")(P, values)
            total += [abs(float(np.ravel(force[f"force{k}"])[0])) for k in range(m)]
    return total


def others_velocities(others, who):
    return np.array([others[j][1] for j in who])


def random_surroundings(rng, scenario, most=6):
    """A random agent with others around it: agent, q, p and what is known of the others."""
    law, n, m = scenario.law, scenario.start.n, scenario.start.dimension
    agent = int(rng.integers(n))
    radii = [float(np.max(g.break_radius)) for g in law.graphs if g.moves]
    reach = 1.3 * max(radii) if radii and np.isfinite(max(radii)) else 6.0
    k = int(rng.integers(0, min(most, n - 1) + 1))
    who = rng.choice([j for j in range(n) if j != agent], size=k, replace=False)
    q, p = scenario.start.q[rng.integers(n)] + rng.normal(size=m), rng.normal(size=m)
    while True:
        x = q + rng.normal(size=(k, m)) / np.sqrt(m) * reach * rng.uniform(0.1, 1.0, (k, 1))
        r = np.linalg.norm(scenario.space.displacement(x - q), axis=1)
        if all(np.abs(r - b).min(initial=1.0) > 1e-6 for b in [0.0, *radii]):
            break
    return agent, q, p, {int(j): (x[i], rng.normal(size=m)) for i, j in enumerate(who)}
