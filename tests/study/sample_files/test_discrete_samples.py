"""Samples of agents in discrete time beside their velocities: rounding and jumps count there too."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.study.claims.claim import Verdict
from flocking.study.sample_files.reading import read_samples
from flocking.study.sample_files.sampled_runs import motion_of
from flocking.study.sample_files.samples import Samples

RADIUS = 1.0005
TICK = 0.1


def headings(distance: float) -> fk.Run:
    """Two agents on parallel lines."""
    start = fk.State([[0.0, 0.0], [distance, 0.0]], [[0.0, 1.0], [0.0, 1.0]])
    law = fk.Law(fk.Proximity(RADIUS), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, start, 1.0, agents=fk.Heading(1.0), control=fk.Held(TICK), frames=11)
    return fk.simulate(scenario, progress=False)


@pytest.mark.parametrize(("form", "verdict"), [(".2f", Verdict.NOT_RESOLVED), (".17e", Verdict.FAILS)])
def test_rounding_of_places_is_an_error(tmp_path, form, verdict):
    """1.001 apart, beyond the radius, and written as 1.00 apart."""
    run, path = headings(1.001), tmp_path / "a.csv"
    rows = ["t,id,x,y,vx,vy"]
    for t, q, p in zip(run.t, run.q, run.p, strict=True):
        rows += [f"{float(t)!r},{i}," + ",".join(format(x, form) for x in (*q[i], *p[i])) for i in range(2)]
    path.write_text("\n".join(rows))
    samples = read_samples(path)
    found = motion_of(samples, run.scenario)
    assert found.audit()["connected"].verdict is verdict
    assert found.run.fidelity.position_error == pytest.approx(3 * samples.rounding[0])


def test_places_that_are_wrapped_into_a_box_jump():
    """The agents pass the side of a box of length 0.55, together."""
    run = headings(0.3)
    exact = motion_of(Samples(run.t, run.q, run.p, ("a", "b")), run.scenario)
    assert exact.run.fidelity.position_error == 0.0
    wrapped = run.q.copy()
    wrapped[..., 1] %= 0.55
    found = motion_of(Samples(run.t, wrapped, run.p, ("a", "b")), run.scenario)
    assert found.run.fidelity.position_error == pytest.approx(0.55)
    assert "jump" in str(found.run.provenance["velocities"])


@pytest.mark.parametrize("every", [1, 7])
def test_headings_that_turn_at_random_do_not_jump(every):
    start = fk.start.box(20, side=3.0, speed=1.0, seed=2, velocities="sphere")
    agents = fk.Heading(1.0, noise=2.0, seed=3)
    law = fk.Law(fk.Proximity(0.5), [fk.Consensus(1.0)])
    scenario = fk.Scenario(law, start, 21.0, agents=agents, control=fk.Held(TICK), frames=211)
    run = fk.simulate(scenario, progress=False)
    samples = Samples(run.t[::every], run.q[::every], run.p[::every], tuple(map(str, range(20))))
    assert motion_of(samples, scenario).run.fidelity.position_error == 0.0
    assert np.ptp(run.p) > 1.0
