"""The spread of velocities is one number wherever it is shown: about the velocity of the centre of mass."""

from __future__ import annotations

import pytest

import flocking as fk
from flocking.apps.commands.run_summary import summary
from flocking.apps.lab.panels.measures import measured
from flocking.engine.storage.export_formats import observable_table
from flocking.show.contents import contents
from flocking.study.evidence import Evidence


@pytest.mark.parametrize("masses", [[1.0, 9.0], [3.0, 3.0]])
def test_the_spread_is_about_the_centre_of_mass(masses):
    """Velocities 1 and -1: the centre of 1 and 9 goes by -0.8, from which the first differs by 1.8."""
    law = fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)])
    start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
    run = fk.simulate(fk.Scenario(law, start, 1e-6, agents=fk.PointMass(masses)), progress=False)
    spread = 1.8 if masses[0] != masses[1] else 1.0
    drawn = contents(fk.plot(run, "spread"))[0].named("largest").points[-1, 1]
    lab = measured(run.state(-1), 0.0, masses=run.scenario.agents.masses)["velocity spread"]
    table, data = observable_table(run)["velocity_spread"][-1], summary(run)["velocity_spread"]
    found = [Evidence(run).velocity_spread[-1], drawn, lab, table, data]
    assert found == pytest.approx([spread] * 5, rel=1e-4)


def test_the_spread_of_a_run_without_frames_is_that_of_equal_masses_alone():
    """Engines observe differences from the mean over agents, which is another velocity where masses differ."""
    for masses in (2.0, [1.0, 9.0]):
        start = fk.State([[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [-1.0, 0.0]])
        made = fk.Scenario(fk.Law(fk.Proximity(3.0), [fk.Consensus(1.0)]), start, 1e-6, agents=fk.PointMass(masses))
        run = fk.simulate(made, engine="tiles", step=1e-6, observe=True, keep_frames=False, progress=False)
        told = summary(run)
        assert len(run.t) == 0
        assert ("velocity_spread" in told) == (masses == 2.0)
        assert told.get("velocity_spread", 1.0) == pytest.approx(1.0, rel=1e-4)
