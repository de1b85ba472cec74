"""Pair styles of LAMMPS in boxes that repeat, against sums over all images, the other engines and closed forms."""

from __future__ import annotations

import itertools
import subprocess
import sys

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.lammps_export import export_deck
from flocking.engine.lammps.options import LammpsOptions
from flocking.engine.lammps.session import LammpsSession
from flocking.errors import InvalidInput, SimulationError, StepTooLarge, UnsupportedLaw
from flocking.study.nets.winding import winding
from tests.mpi.jobs import launch
from tests.mpi.laws import PAIR_STYLES
from tests.mpi.test_export import LMP, frames

pytestmark = pytest.mark.mpi
RADIUS, REST, STIFF, GAIN = 2.2, 1.6, 3.0, 0.7
BOXES = [[7.0, 5.0], [7.0, None], [None, 6.0], [5.0, 6.0, 4.5], [5.0, None, 6.0]]
"""Lengths; in each some axes are shorter than twice the radius and the skin."""


def spring_law():
    """Springs and consensus over a hard net: the force of a pair jumps at the radius, so no link may be missed."""
    psi = fk.Potential("k*(r - b)**2/2", k=STIFF, b=REST)
    return fk.Law(fk.Proximity(RADIUS), [fk.Gradient(psi), fk.Consensus(GAIN)])


def group(lengths, n=60, seed=5, speed=1.0, shift=3, drift=0.0):
    """A disturbed lattice that fills the box and drifts, each agent ``shift`` lengths away from it at most."""
    rng = np.random.default_rng(seed)
    sides = np.array([6.0 if x is None else x for x in lengths])
    m = len(sides)
    each = int(np.ceil(n ** (1 / m)))
    points = np.stack(np.meshgrid(*[(np.arange(each) + 0.5) / each] * m), axis=-1).reshape(-1, m)[:n]
    q = points * sides + 0.4 * sides / each * rng.uniform(-1.0, 1.0, (n, m))
    repeats = np.array([x is not None for x in lengths])
    q += rng.integers(-shift, shift + 1, (n, m)) * sides * repeats
    return fk.State(q, speed * rng.normal(size=(n, m)) + drift)


def boxed(lengths, law=None, *, t_end=1.0, frames=5, agents=None, **options):
    return fk.Scenario(
        law or spring_law(), group(lengths, **options), t_end, agents or fk.Agents(), frames=frames,
        space=fk.Periodic(lengths),
    )  # fmt: skip


def summed_over_images(state, lengths):
    """Forces of `spring_law`, from every image of every agent within two lengths of a box."""
    reduced = state.q - np.where([x is not None for x in lengths], 1.0, 0.0) * np.floor(
        state.q / [x or 1.0 for x in lengths]
    ) * [x or 1.0 for x in lengths]
    force, size = np.zeros_like(state.q), np.zeros(state.n)
    for cell in itertools.product(*[range(-2, 3) if x is not None else (0,) for x in lengths]):
        d = reduced[None] + np.array(cell) * [x or 0.0 for x in lengths] - reduced[:, None]
        r = np.linalg.norm(d, axis=2)
        linked = (r > 0) & (r < RADIUS)
        pull = np.where(linked, STIFF * (r - REST) / np.where(r > 0, r, 1.0), 0.0)
        one = pull[..., None] * d + GAIN * linked[..., None] * (state.p[None] - state.p[:, None])
        force += one.sum(axis=1)
        size += np.linalg.norm(one, axis=2).sum(axis=1)
    return force, size


@pytest.mark.parametrize("lengths", BOXES, ids=str)
def test_forces_are_the_sums_over_all_images(lengths):
    made = boxed(lengths)
    session = LammpsSession(made, LammpsOptions(step=0.01, ledger=0))
    found, state = session.forces(), session.state
    session.close()
    expected, size = summed_over_images(made.start, lengths)
    across = np.abs(made.space.displacement(made.start.q[:, None] - made.start.q[None])) + 1e-9
    assert (across < np.abs(made.start.q[:, None] - made.start.q[None])).any()
    assert (np.linalg.norm(found - expected, axis=1) <= 1e-12 * size).all()
    np.testing.assert_allclose(state.q, made.start.q, rtol=0, atol=1e-14)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("lengths", BOXES[1::2], ids=str)
def test_steps_links_and_clusters_are_those_of_the_tiled_engine(lengths, order):
    agents = fk.Agents() if order == 2 else fk.SingleIntegrator()
    drift = fk.Track(fk.Velocity([6.0] * len(lengths)), velocity_gain=1.0)
    flow = fk.Law(fk.Proximity(RADIUS), [fk.Gradient(fk.Potential("(r - 1.6)**2/2")), drift])
    law = spring_law() if order == 2 else flow
    moving = {"speed": 3.0, "drift": 9.0} if order == 2 else {"speed": 0.0}
    made = boxed(lengths, law, agents=agents, t_end=0.6, seed=8, **moving)
    step = {"step": 0.005, "progress": False}
    one = fk.simulate(made, **PAIR_STYLES, **step, observe=True)
    other = fk.simulate(made, engine="tiles", **step, observe=True, scheme="verlet" if order == 2 else "euler")
    crossed = np.floor(one.q[-1] / [x or np.inf for x in lengths]) != np.floor(
        one.q[0] / [x or np.inf for x in lengths]
    )
    assert crossed.sum() > 3
    np.testing.assert_allclose(one.q, other.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(one.p, other.p, rtol=0, atol=1e-9)
    assert np.array_equal(one.links, other.links)
    for name in one.observables.dtype.names:
        np.testing.assert_allclose(one.observables[name], other.observables[name], rtol=1e-9, atol=1e-9, err_msg=name)
    for k in range(len(one.t)):
        assert np.array_equal(*(winding(run.links[k], run.q[k], made.space) for run in (one, other)))
    for name in ("energy", "dissipated"):
        scale = np.abs(other.trace["energy"]).max()
        gap = np.abs(np.interp(other.trace["time"], one.trace["time"], one.trace[name]) - other.trace[name])
        assert gap.max() < 0.02 * scale, name


def test_errors_halve_with_the_step():
    # All is smooth, at contact too, and damping makes the scheme one of order 1.
    law = fk.Law(fk.Smooth(RADIUS, 0.3, "quintic"), [fk.Gradient(fk.Potential("4*exp(-r**2)"))])
    made = boxed([7.0, 5.0], law, agents=fk.Agents(damping=2.0), n=30, t_end=0.5, frames=2, speed=3.0)
    exact = fk.simulate(made, engine="exact", progress=False)
    errors = [
        np.abs(fk.simulate(made, **PAIR_STYLES, step=step, ledger=0, progress=False).q[-1] - exact.q[-1]).max()
        for step in (0.02, 0.01, 0.005)
    ]
    assert errors[-1] < 1e-2
    assert 1.6 < errors[0] / errors[1] < 2.4
    assert 1.6 < errors[1] / errors[2] < 2.4


def test_momentum_is_kept_and_the_ledger_closes():
    made = boxed([7.0, 5.0], t_end=1.0, speed=3.0)
    run = fk.simulate(made, **PAIR_STYLES, step=0.002, progress=False)
    assert np.abs(run.p.sum(axis=1) - run.p[0].sum(axis=0)).max() < 1e-12 * np.abs(run.p[0]).sum()
    lost = run.trace["dissipated"][-1]
    assert lost > 0.3 * run.trace["kinetic"][0]
    assert np.abs(run.residual).max() < 0.02 * lost


def test_two_ranks_give_what_one_gives(tmp_path):
    out = tmp_path / "run.npz"
    text = (
        "import numpy as np, flocking as fk\n"
        "from tests.mpi.boxes.test_periodic_boxes import PAIR_STYLES, boxed\n"
        "made = boxed([7.0, None, 5.0], t_end=1.0, speed=3.0, drift=9.0)\n"
        "run = fk.simulate(made, **PAIR_STYLES, step=0.005, progress=False)\n"
        f"run is None or len(run.t) and np.savez({str(out)!r}, q=run.q, p=run.p, energy=run.trace['energy'])\n"
    )
    script = tmp_path / "two.py"
    script.write_text(text)
    done = launch(2, sys.executable, "-c", f"import sys; sys.path.insert(0, '.'); exec(open({str(script)!r}).read())")
    assert done.returncode == 0, done.stderr[-2000:]
    one = fk.simulate(
        boxed([7.0, None, 5.0], t_end=1.0, speed=3.0, drift=9.0), **PAIR_STYLES, step=0.005, progress=False
    )
    with np.load(out) as found:
        np.testing.assert_allclose(found["q"], one.q, rtol=0, atol=1e-9)
        np.testing.assert_allclose(found["p"], one.p, rtol=0, atol=1e-9)
        np.testing.assert_allclose(found["energy"], one.trace["energy"], rtol=1e-10)


def test_agents_that_cross_the_box_more_often_than_lammps_can_count():
    """All have one velocity, so they feel no force: q = q0 + v t, 900 lengths on; LAMMPS counts to 511."""
    still = group([7.0, 5.0], n=8, speed=0.0)
    v = np.array([-1575.0, 2250.0])
    law = fk.Law(fk.Proximity(RADIUS), [fk.Consensus(1.0)])
    made = fk.Scenario(law, fk.State(still.q, still.p + v), 4.0, frames=2, space=fk.Periodic([7.0, 5.0]))
    run = fk.simulate(made, **PAIR_STYLES, step=0.002, ledger=0, progress=False)
    assert (np.abs(run.q[-1] - run.q[0]) / [7.0, 5.0] > 511).all()
    np.testing.assert_allclose(run.q[-1], still.q + 4.0 * v, rtol=0, atol=1e-8)


def test_a_session_goes_on_from_its_restart_in_the_same_images():
    made = boxed([7.0, 5.0], t_end=2.0, speed=3.0, drift=9.0)
    options = LammpsOptions(step=0.005, ledger=0)
    going = LammpsSession(made, options)
    going.advance(0.7)
    again = LammpsSession(made, options, restart=going.restart())
    going.advance(1.5)
    again.advance(1.5)
    one, other = going.state, again.state
    going.close()
    again.close()
    assert np.abs(one.q - made.start.q).max() > 7.0
    np.testing.assert_allclose(other.q, one.q, rtol=0, atol=1e-10)


def test_lammps_alone_runs_the_deck(tmp_path):
    made = boxed([7.0, None], t_end=0.6, frames=4, speed=3.0, drift=9.0)
    deck = export_deck(made, tmp_path / "deck", step=0.005)
    done = subprocess.run([LMP, "-in", deck.name], cwd=deck.parent, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    q, p = frames(deck.parent / "frames.lammpstrj", made.start.n, 2)
    run = fk.simulate(made, **PAIR_STYLES, step=0.005, ledger=0, progress=False)
    assert np.abs(q[-1, :, 0] - q[0, :, 0]).max() > 5.0
    np.testing.assert_allclose(q, run.q, rtol=0, atol=1e-10)
    np.testing.assert_allclose(p, run.p, rtol=0, atol=1e-10)


def test_a_deck_ends_with_an_error_before_lammps_loses_count(tmp_path):
    still = group([7.0, 5.0], n=8, speed=0.0)
    law = fk.Law(fk.Proximity(RADIUS), [fk.Consensus(1.0)])
    made = fk.Scenario(law, fk.State(still.q, still.p + [0.0, -2250.0]), 2.0, frames=2, space=fk.Periodic([7.0, 5.0]))
    deck = export_deck(made, tmp_path / "deck", step=0.002)
    done = subprocess.run([LMP, "-in", deck.name], cwd=deck.parent, capture_output=True, text=True, timeout=200)
    assert done.returncode != 0
    assert "images_y" in done.stdout + done.stderr
    far = made.with_(start=fk.State(still.q + [7.0 * 500, 0.0], still.p))
    with pytest.raises(InvalidInput, match="start must be within 400 lengths"):
        export_deck(far, tmp_path / "far", step=0.002)


def test_what_cannot_be_is_refused():
    made = boxed([7.0, 5.0])
    with pytest.raises(InvalidInput, match=r"skin must be at most 2\.8, .*radius 2\.2.*3\.0"):
        fk.start(made, **PAIR_STYLES, step=0.01, skin=3.0)
    q = made.start.q.copy()
    q[7] = q[3] + [-14.0, 5.0]
    with pytest.raises(UnsupportedLaw, match="agents 3 and 7 at the same point"):
        fk.start(made.with_(start=fk.State(q, made.start.p)), **PAIR_STYLES, step=0.01)


@pytest.mark.parametrize("skin", [0.01, 0.3, 2.7])
def test_a_skin_beyond_half_a_length_adds_no_force(skin):
    made = boxed([7.0, 5.0], t_end=0.3, frames=2, speed=3.0)
    one = fk.simulate(made, **PAIR_STYLES, step=0.005, skin=skin, progress=False)
    other = fk.simulate(made, engine="tiles", step=0.005, scheme="verlet", progress=False)
    np.testing.assert_allclose(one.q, other.q, rtol=0, atol=1e-10)


def test_an_agent_that_flies_over_the_box_in_one_step_is_an_error():
    made = boxed([7.0, 5.0], fk.Law(fk.Proximity(RADIUS), [fk.Gradient(fk.Potential("(r - 1.6)**2"))]))
    p = made.start.p.copy()
    p[4] = [0.0, 3000.0]
    with pytest.raises(SimulationError) as error:
        fk.simulate(made.with_(start=fk.State(made.start.q, p)), **PAIR_STYLES, step=0.01, ledger=0, progress=False)
    assert isinstance(error.value, StepTooLarge)


def test_pairs_that_meet_across_the_border_set_the_step():
    """Distance 0.8 across it, closing at speed 4: a step of 0.06 is 0.3 of the distance, and only 0.25 is allowed."""
    law = fk.Law(fk.Proximity(RADIUS), [fk.Gradient(fk.Potential("1/r"))])
    state = fk.State([[6.6, 1.0], [7.4 - 14.0, 1.0], [3.5, 2.0]], [[2.0, 0.0], [-2.0, 0.0], [0.0, 0.0]])
    made = fk.Scenario(law, state, 0.12, frames=2, space=fk.Periodic([7.0, 5.0]))
    chosen = [fk.start(made, engine, **more) for engine, more in (("lammps", {"forces": "pair styles"}), ("tiles", {}))]
    steps = [session.step for session in chosen]
    for session in chosen:
        session.close()
    assert steps[0] == pytest.approx(steps[1], rel=1e-12)
    assert steps[0] < 0.02 * 0.8 / 4.0 * (1 + 1e-12)
    with pytest.raises(StepTooLarge) as error:
        fk.simulate(made, **PAIR_STYLES, step=0.06, progress=False)
    assert error.value.agents == (0, 1)


def test_the_step_that_is_recommended_for_agents_that_cross_many_boxes_does():
    """Both at a speed of 1e4 in a box of 4: 50 in a step of 0.005, of which LAMMPS carries back one length."""
    law = fk.Law(fk.Proximity(1.5), [fk.Gradient(fk.Potential("(r - 1)**2"))])
    start = fk.State([[0.0, 0.0], [1.0, 0.3]], [[1e4, 0.0], [1e4, 0.0]])
    made = fk.Scenario(law, start, 0.05, frames=2, space=fk.Periodic([4.0, 4.0]))
    with pytest.raises(StepTooLarge, match="would do") as found:
        fk.simulate(made, **PAIR_STYLES, step=0.005, progress=False)
    run = fk.simulate(made, **PAIR_STYLES, step=found.value.would_do, progress=False)
    assert run.q[-1].mean(axis=0) == pytest.approx(start.q.mean(axis=0) + [500.0, 0.0], abs=1e-8)
