from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.potentials.state_energy import agent_energies, total_energy

PSI = fk.Potential("1/r**2 + log(r**2)")
LAW = fk.Law(fk.Proximity(2.0), [fk.Gradient(PSI), fk.Consensus(1.0)])
STATE = fk.State([[0.0, 0.0], [1.5, 0.0], [2.9, 0.0]], [[0.0, 1.0], [0.0, 0.0], [2.0, 0.0]])


def test_unlinked_pairs_count_once() -> None:
    linked = 1 / 1.5**2 + np.log(1.5**2) + 1 / 1.4**2 + np.log(1.4**2)
    assert total_energy(LAW, STATE) == pytest.approx(linked + 2.5)
    assert total_energy(LAW, STATE, fk.Energy(unlinked=7.0)) == pytest.approx(linked + 2.5 + 7.0)


def test_it_is_what_the_ledger_starts_from() -> None:
    energy = fk.Energy(unlinked=1.25)
    run = fk.simulate(fk.Scenario(LAW, STATE, t_end=0.0, frames=1, energy=energy), progress=False)
    assert run.trace["energy"][0] == pytest.approx(total_energy(LAW, STATE, energy), rel=1e-14)


def test_agent_energies_share_the_potential_of_all_pairs() -> None:
    energy = fk.Energy(unlinked=1.25)
    each = agent_energies(LAW, STATE, energy)
    assert each[0] == pytest.approx(1 / 1.5**2 + np.log(1.5**2) + 1.25)
    assert each.sum() / 2 + 2.5 == pytest.approx(total_energy(LAW, STATE, energy))


def test_memory_decides_who_is_linked() -> None:
    apart = fk.State(STATE.q, STATE.p, links=np.zeros((3, 3), dtype=bool))
    assert total_energy(LAW, apart, fk.Energy(unlinked=2.0)) == pytest.approx(2.5 + 6.0)


def test_masses_weigh_the_kinetic_energy_in_its_frame() -> None:
    masses = np.array([0.5, 2.0, 1.0])
    mean = masses @ STATE.p / masses.sum()
    kinetic = 0.5 * (masses[:, None] * (STATE.p - mean) ** 2).sum()
    energy = fk.Energy("centre of mass", unlinked=1.25)
    unmoved = total_energy(LAW, fk.State(STATE.q), fk.Energy(unlinked=1.25))
    assert total_energy(LAW, STATE, energy, agents=fk.Agents(masses)) == pytest.approx(unmoved + kinetic)


def test_headings_decide_who_is_linked_under_a_field_of_view() -> None:
    law = fk.Law(fk.FieldOfView(2.0, np.pi / 2), [fk.Gradient(PSI)])
    found = total_energy(law, fk.State(STATE.q), fk.Energy(unlinked=7.0), agents=fk.Agents(headings=np.zeros(3)))
    linked = 0.5 * (1 / 1.5**2 + np.log(1.5**2) + 1 / 1.4**2 + np.log(1.4**2))
    assert found == pytest.approx(linked + 0.5 * 4 * 7.0)


def test_agent_energies_share_what_the_ledger_counts_of_all_graphs() -> None:
    """A second graph, a graph given again for a term, and a weighted force, whose integral is what links store."""
    wide = fk.Proximity(5.0)
    for law in (
        fk.Law(fk.Proximity(2.0), [fk.Gradient(PSI), fk.Gradient(fk.Potential("r"), over=wide)]),
        fk.Law(wide, [fk.Gradient(PSI, over=wide)]),
        fk.Law(wide, [fk.Gradient(PSI, over=fk.Proximity(5.0))]),
        fk.Law(fk.Smooth(3.0, 0.4), [fk.Gradient(PSI, "force")]),
    ):
        energy = fk.Energy(unlinked=1.25)
        each = agent_energies(law, STATE, energy)
        assert each.sum() / 2 == pytest.approx(total_energy(law, fk.State(STATE.q), energy))
        assert each.sum() != 0.0
