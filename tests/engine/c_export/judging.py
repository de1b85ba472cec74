"""What an exported law must give: the force by `control_of`, and the sum of the absolute values of what it adds up."""

from __future__ import annotations

import numpy as np

import flocking as fk
from flocking.engine.kernels.expressions import law_formulas
from flocking.engine.kernels.layout import Layout
from flocking.engine.kernels.obstacle_distances import ObstacleDistances
from flocking.engine.kernels.pieces import held
from flocking.engine.kernels.source_text import nonzero
from flocking.formula.printing import statements
from flocking.model.energy import Energy
from flocking.model.graph_functional import averages
from tests.engine.c_export.sizes import Sized, run
from tests.engine.c_export.steering import term_force


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
    if scenario.agents.order == 1:
        p, others = 0.0 * p, {j: (x, 0.0 * v) for j, (x, v) in others.items()}
    distance = {
        j: float(np.linalg.norm(scenario.space.displacement(np.asarray(x) - q))) for j, (x, _) in others.items()
    }
    linked = linked_at_start(law, n, agent, distance)
    mass, damping = (float(np.broadcast_to(x, n)[agent]) for x in (scenario.agents.masses, scenario.agents.damping))
    neighbours = {
        graph: [fk.Agent(*others[j], j) for j in sorted(found)] for graph, found in zip(law.graphs, linked, strict=True)
    }
    given = {"mass": mass, "damping": damping, "space": scenario.space}
    seen = [fk.Agent(*others[j], j) for j in sorted(others)]
    expected = fk.control_of(law, fk.Agent(q, p, agent), neighbours, t, seen=seen, **given)
    return expected, _sizes(scenario, agent, q, p, others, linked, t)


def _sizes(scenario, agent, q, p, others, linked, t):
    """Sums of the absolute values of all that is added up, see `tests.engine.c_export.sizes`."""
    law, n, m = scenario.law, scenario.start.n, len(q)
    layout = Layout(law, Energy(), space=scenario.space, steering=True)
    formulas = _formulas(scenario)
    P, A, W = layout.values(fk.Agents(scenario.agents.masses, scenario.agents.damping), n, t)
    total = np.zeros(m)
    own = {f"P{k}": Sized.of(x) for k, x in enumerate(P)} | {f"A{k}": Sized.of(row[agent]) for k, row in enumerate(A)}
    own |= {"t": Sized.of(t)}
    own |= {f"q{k}": Sized.of(q[k]) for k in range(m)} | {f"p{k}": Sized.of(p[k]) for k in range(m)}
    for number, found in enumerate(linked):
        for j in sorted(found):
            d, v = scenario.space.displacement(np.asarray(others[j][0]) - q), np.asarray(others[j][1]) - p
            r = float(np.sqrt((d**2).sum()))
            values = {"r": r, "side": r, "reach": r, "speed2": (v**2).sum(), "radial": (d * v).sum() / r}
            values |= {f"W{k}": matrix[agent, j] for k, matrix in enumerate(W)}
            values["functional"] = 1.0 / (1.0 + len(found)) if averages(law, number) else 1.0
            seen = run(formulas["pairs"][number], own | {name: Sized.of(x) for name, x in values.items()})
            none = Sized(0.0, 0.0)
            total += seen.get("along", none).size * np.abs(d) / r + seen.get("drag", none).size * np.abs(v)
    alone = run(formulas["body"], own)
    total += [alone[f"force{k}"].size if f"force{k}" in alone else 0.0 for k in range(m)]
    rows = layout.obstacle_rows()
    for group, (_, met) in enumerate(ObstacleDistances(law).met(np.asarray(q)[None], t)):
        for o in met:
            seen = dict(own) | {f"O{k}": Sized.of(row[o]) for k, row in enumerate(rows)}
            for lines in formulas["obstacles"][group]:
                seen = run(lines, seen)
                if "distance" in seen:
                    seen |= {"side": seen["distance"], "reach": seen["distance"]}
            total += [seen[f"force{k}"].size for k in range(m)]
    around = [(scenario.space.displacement(x - q), v) for _, (x, v) in sorted(others.items())]
    for term in law.steering_terms:
        total += [x.size for x in term_force(term, q, p, around)]
    return total


def steering_by_scalars(scenario, q, p, others):
    """Force of the steering terms written a second time, and its size, shape (m,) each."""
    around = [(scenario.space.displacement(x - q), v) for _, (x, v) in sorted(others.items())]
    force, size = np.zeros(len(q)), np.zeros(len(q))
    for term in scenario.law.steering_terms:
        found = term_force(term, q, p, around)
        force += [x.value for x in found]
        size += [x.size for x in found]
    return force, size


KNOWN = {}


def _formulas(scenario):
    """Printed statements of the law of a scenario."""
    if id(scenario) not in KNOWN:
        layout = Layout(scenario.law, Energy(), space=scenario.space, steering=True)
        found = law_formulas(layout, scenario.start.dimension, integrals=False)

        def lines(formulas, distance):
            chosen, _ = held(nonzero(formulas), distance)
            return statements(chosen, arrays=False, prefix="x_")

        KNOWN[id(scenario)] = scenario, {
            "pairs": [lines({"along": x.along, "drag": x.drag}, "r") for x in found.pairs],
            "body": lines({f"force{k}": f for k, f in enumerate(found.body.force)}, "r"),
            "obstacles": [[lines(stage, "distance") if k else
                           statements(stage, arrays=False, prefix="x_") for k, stage in enumerate(group.stages())]
                          for group in found.obstacles],
        }  # fmt: skip
    return KNOWN[id(scenario)][1]


def random_surroundings(rng, scenario, most=6):
    """A random agent with others around it: agent, q, p and what is known of the others."""
    law, n, m = scenario.law, scenario.start.n, scenario.start.dimension
    agent = int(rng.integers(n))
    radii = [float(np.max(g.break_radius)) for g in law.graphs if g.moves]
    radii += [t.reach for t in law.steering_terms if t.reach > 0.0]
    reach = 1.3 * max(radii) if radii and np.isfinite(max(radii)) else 6.0
    # Velocities as they are in the scenario, beside which formulas of speeds say something.
    speed = max(1.0, float(np.abs(scenario.start.p).max())) if law.steering_terms else 1.0
    k = int(rng.integers(0, min(most, n - 1) + 1))
    who = rng.choice([j for j in range(n) if j != agent], size=k, replace=False)
    q, p = scenario.start.q[rng.integers(n)] + rng.normal(size=m), speed * rng.normal(size=m)
    while True:
        x = q + rng.normal(size=(k, m)) / np.sqrt(m) * reach * rng.uniform(0.1, 1.0, (k, 1))
        r = np.linalg.norm(scenario.space.displacement(x - q), axis=1)
        if all(np.abs(r - b).min(initial=1.0) > 1e-6 for b in [0.0, *radii]):
            break
    return agent, q, p, {int(j): (x[i], speed * rng.normal(size=m)) for i, j in enumerate(who)}
