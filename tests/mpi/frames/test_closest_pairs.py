"""Closest pairs, links at one place and at exactly the radius, and scheduled gains on one rank: as the tiled engine."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flocking as fk
from tests.engine.fixed_step.test_closest_pairs import SOFT, pair_without_link
from tests.engine.fixed_step.test_scheduled_gains import gained, pulled

pytestmark = pytest.mark.mpi


def run(law: fk.Law, start: fk.State, t_end: float = 0.02, **options: Any) -> Any:
    scenario = fk.Scenario(law, start, t_end=t_end, frames=2)
    return fk.simulate(scenario, engine="lammps", progress=False, **{"step": 0.01, **options})


def test_a_closer_pair_without_a_link_is_not_named() -> None:
    assert run(*pair_without_link()).closest_linked.pair == (2, 3)


def test_the_end_counts() -> None:
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.01)])
    found = run(law, fk.State([[0.0, 0.0], [1.9, 0.0]], [[1.0, 0.0], [-1.0, 0.0]]), step=0.1, t_end=0.5)
    assert found.closest_linked.distance == pytest.approx(np.linalg.norm(found.q[-1, 1] - found.q[-1, 0]), rel=1e-12)


def test_links_of_no_length_are_all_alike() -> None:
    q = [[0.0, 0.0], [0.0, 0.0], [5.0, 5.0]]
    seen = run(fk.Law(fk.Proximity(1.0), [SOFT]), fk.State(q, np.zeros((3, 2))), observe=True).observables[-1]
    assert (seen["flocks"], seen["length"], seen["defect"], seen["closest"]) == (2, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("agents", [fk.Agents(), fk.SingleIntegrator()])
def test_the_jump_of_a_scheduled_gain(agents: fk.Agents | fk.SingleIntegrator) -> None:
    found = fk.simulate(pulled(agents), engine="lammps", step=0.005, scheme="rk4", progress=False)
    assert found.trace["jumped"][-1] == pytest.approx(gained(found.q[1]), rel=1e-12)
    assert np.abs(found.residual).max() < 1e-6 * found.turnover


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("forces", ["kernels", "pair styles"])
def test_pairs_at_exactly_the_radius_are_linked_where_the_graph_says_so(forces: str, closed: bool) -> None:
    """A square lattice whose spacing is the radius: each of the 24 links has the energy (1/2)^2."""
    q = np.stack(np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij"), axis=-1).reshape(-1, 2)
    law = fk.Law(fk.Proximity(1.0, closed=closed), [fk.Gradient(fk.Potential("(r - 0.5)**2")), fk.Consensus(0.5)])
    found = run(law, fk.State(q, np.zeros((16, 2))), t_end=1e-3, step=1e-4, observe=True, forces=forces)
    assert found.trace["energy"][0] == (6.0 if closed else 0.0)
    assert found.observables["neighbours"][0] == (3.0 if closed else 0.0)
    assert found.p[-1, 0] == pytest.approx([1e-3 * closed] * 2, rel=1e-3)
