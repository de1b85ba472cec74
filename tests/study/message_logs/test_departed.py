"""What departed energy is due to: sums, exact zeros, closed forms and an independent quadrature."""

import numpy as np
import pytest

import flocking as fk
from flocking.errors import UnsupportedLaw
from flocking.study.message_logs.departed import CAUSES
from tests.study.message_logs.test_replay import ran, world

PAIR = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Consensus(1.0)])


def pair(**parts):
    start = fk.State([[0.0], [1.0]], [[0.0], [2.0]])
    given = {"control": fk.Held(0.1), "information": fk.Instant()}
    return fk.Scenario(PAIR, start, t_end=1.0, frames=3, energy=fk.Energy("lab"), **{**given, **parts})


def test_the_causes_add_up_to_what_departed():
    run = ran(world())
    found = fk.departed_causes(run)
    assert set(found.causes) == set(CAUSES)
    assert found.total is not run.trace["departed"]
    assert (found.total == run.trace["departed"]).all()
    assert np.abs(sum(found.causes.values()) - found.total).max() < 1e-12 * np.abs(run.trace["departed"]).max()
    for name in ("delay", "loss", "noise", "links", "hold"):
        assert np.abs(found.causes[name]).max() > 1e-3
    assert not found.causes["limits"].any()


@pytest.mark.parametrize(
    ("information", "none"),
    [
        (fk.Instant(), {"delay", "loss", "noise", "links"}),
        (fk.Messages(0.1), {"delay", "loss", "noise", "links"}),
        (fk.Messages(0.1, delay=0.05), {"loss", "noise", "links"}),
        (fk.Messages(0.1, loss=0.0, noise=fk.WhiteNoise(0.0, 0.2)), {"delay", "loss", "links"}),
        (fk.Messages(0.1, loss=0.4), {"delay", "noise", "links"}),
        (fk.Messages(0.1, loss=0.4, expires=0.15), {"delay", "noise"}),
    ],
)
def test_what_is_not_in_the_world_has_exactly_no_share(information, none):
    """Samples fall on the ticks: without delay they are the present, and loss alone makes them old."""
    found = fk.departed_causes(ran(pair(information=information)))
    shares = {name for name, values in found.causes.items() if not values.any()}
    assert shares == none | {"limits"}


def test_the_share_of_noise_is_the_work_of_its_errors():
    """Velocities of samples enter linearly: the force of an error e_j on agent i is e_j until the next tick."""
    noise = fk.WhiteNoise(0.0, 0.3)
    run = ran(pair(information=fk.Messages(0.1, noise=noise, seed=4)))
    found = fk.departed_causes(run)
    session, before, work = fk.start(pair(information=run.scenario.information), "sampled"), None, 0.0
    for k in range(11):
        session.advance(min(0.1 * k, 1.0))
        now = session.state.q[:, 0]
        if before is not None:
            errors = noise.normals(4, np.array([0, 1]), np.array([k - 1, k - 1]), 1)[1][:, 0] * 0.3
            work += float(errors[::-1] @ (now - before))
        before = now
    assert found.causes["noise"][-1] == pytest.approx(work, abs=1e-12)
    assert abs(work) > 1e-3


def test_the_share_of_hold_is_that_of_the_law_at_ticks_against_the_law_now():
    """The recursion of held consensus by hand, with an exact quadrature: both laws are linear in time."""
    run = ran(pair())
    found = fk.departed_causes(run)
    w, departed = np.array([0.0, 2.0]), 0.0
    for _ in range(10):
        u = w[::-1] - w
        # p(s) = w + u s and the law now is u + (u reversed - u) s: Simpson's rule is exact for their product.
        power = lambda s: float((-s * (u[::-1] - u)) @ (w + s * u))  # noqa: E731, B023
        departed += 0.1 / 6.0 * (power(0.0) + 4.0 * power(0.05) + power(0.1))
        w = w + 0.1 * u
    assert found.causes["hold"][-1] == pytest.approx(departed, abs=1e-12)
    assert abs(departed) > 1e-3


def test_it_is_drawn(tmp_path):
    from flocking.show.contents import contents

    run = ran(world())
    figure = fk.plot(run, "departed", save_as=tmp_path / "departed")
    assert (tmp_path / "departed.svg").exists()
    (panel,) = contents(figure)
    drawn = {mark.name: mark for mark in panel.marks if mark.kind == "line"}
    found = fk.departed_causes(run)
    for name in ("delay", "loss", "noise", "links", "hold"):
        assert drawn[name].points[-1, 1] == pytest.approx(found.causes[name][-1])
    assert drawn["total"].points[-1, 1] == pytest.approx(run.trace["departed"][-1])
    assert "limits" not in drawn


def test_agents_of_order_1_are_refused():
    law = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("r**2/2"))])
    made = fk.Scenario(law, fk.State([[0.0], [1.0]]), t_end=0.3, agents=fk.SingleIntegrator(), control=fk.Held(0.1))
    with pytest.raises(UnsupportedLaw, match="order 1"):
        fk.departed_causes(ran(made))
