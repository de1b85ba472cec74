"""The closest pair of linked agents, and what is observed of links, against all pairs one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flocking as fk
from flocking.engine.runs.run import OBSERVED_FIELDS
from flocking.engine.tiles.session import TilesOptions, TilesSession
from flocking.model.graphs.smooth_graphs import PerAgentRadii

SOFT = fk.Gradient(fk.Potential("(r - 1)**2/100"))


def run(law: fk.Law, start: fk.State, **options: Any) -> Any:
    control = {"control": options.pop("control")} if "control" in options else {}
    t_end = options.pop("t_end", 0.02)
    scenario = fk.Scenario(law, start, t_end=t_end, frames=2, **control)
    return fk.simulate(scenario, engine="tiles", progress=False, **{"step": 0.01, **options})


def pair_without_link() -> tuple[fk.Law, fk.State]:
    """Agents 0 and 1 are 1.5 apart and not linked, for they never were closer than 1; agents 2 and 3 are, at 1.8."""
    q = [[0.0, 0.0], [1.5, 0.0], [10.0, 0.0], [11.8, 0.0]]
    links = np.zeros((4, 4), dtype=bool)
    links[2, 3] = links[3, 2] = True
    return fk.Law(fk.Hysteresis(radius=2.0, gap=1.0), [SOFT]), fk.State(q, np.zeros((4, 2)), 0.0, links)


@pytest.mark.parametrize("control", [{}, {"control": fk.Held(0.01)}])
def test_a_closer_pair_without_a_link_is_not_named(control: dict[str, Any]) -> None:
    law, start = pair_without_link()
    found = run(law, start, **control).closest_linked
    assert found.pair == (2, 3)
    assert found.distance == pytest.approx(1.8, rel=1e-4)


def test_a_closer_pair_beyond_its_own_radii_is_not_named() -> None:
    law = fk.Law(PerAgentRadii([1.0, 1.0, 3.0, 3.0]), [SOFT])
    q = [[0.0, 0.0], [1.05, 0.0], [10.0, 0.0], [12.0, 0.0]]
    found = run(law, fk.State(q, np.zeros((4, 2)))).closest_linked
    assert found.pair == (2, 3)
    assert found.distance == pytest.approx(2.0, rel=1e-4)


@pytest.mark.parametrize("scheme", ["verlet", "rk4"])
def test_the_end_counts(scheme: str) -> None:
    law = fk.Law(fk.Proximity(2.0), [fk.Consensus(0.01)])
    start = fk.State([[0.0, 0.0], [1.9, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    found = run(law, start, step=0.1, t_end=0.5, scheme=scheme)
    assert found.closest_linked.distance == pytest.approx(np.linalg.norm(found.q[-1, 1] - found.q[-1, 0]), rel=1e-12)
    assert found.closest_linked.time == found.t[-1]


def test_links_of_no_length_are_all_alike() -> None:
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    q = [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0], [5.0, 5.0]]
    seen = run(law, fk.State(q, np.zeros((4, 2))), observe=True).observables[-1]
    assert seen["flocks"] == 2
    assert (seen["length"], seen["defect"], seen["closest"]) == (0.0, 0.0, 0.0)


def test_lengths_of_a_lattice_deviate_by_rounding_alone() -> None:
    """0 in a perfect lattice: a difference of sums of squares would leave 1e-8."""
    start = fk.start.hexagonal(400, spacing=7.0, noise=0.0, speed=0.0, seed=1)
    law = fk.Law(fk.Proximity(8.4), [fk.Gradient(fk.Potential("(r - 6.9)**2"))])
    session = TilesSession(fk.Scenario(law, start, t_end=0.01, frames=2), TilesOptions(step=0.01, observe=True))
    row = dict(zip(OBSERVED_FIELDS.names or (), session.records.observed[0], strict=True))
    assert 0 < row["defect"] < 1e-14
    assert row["length"] == pytest.approx(7.0, rel=1e-14)


@pytest.mark.parametrize("ledger", [True, False])
@pytest.mark.parametrize("scheme", ["verlet", "rk4"])
def test_accelerations_are_by_the_links_of_now(scheme: str, ledger: bool) -> None:
    """Two agents come within the radius in a step: the force is -3 (r - 1.4) from then on."""
    law = fk.Law(fk.Proximity(1.0), [fk.Gradient(fk.Potential("-3*(r - 1.4)**2/2"))])
    start = fk.State([[0.0, 0.0], [1.05, 0.0]], [[0.0, 0.0], [-1.0, 0.0]])
    session = TilesSession(
        fk.Scenario(law, start, t_end=2.0, frames=2), TilesOptions(step=0.1, scheme=scheme, ledger=ledger)
    )
    session.advance(0.1)
    found = session.accelerations()
    assert found == pytest.approx(np.array([[1.35, 0.0], [-1.35, 0.0]]), rel=1e-12)
