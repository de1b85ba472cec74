"""Aircraft with four rotors: a second implementation, conserved quantities, Lyapunov's function, closed forms."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.errors import InvalidInput
from flocking.model.bodies.quadrotors import AXES

LAW = fk.Law(fk.Fixed(2, [(0, 1)]), [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.1)), fk.Consensus(0.1)])
PLACES, SPEEDS = np.array([[0.0, 0.0, 0.0], [2.0, 1.0, 0.5]]), np.array([[0.3, -0.2, 0.1], [0.0, 0.4, 0.0]])
MASS, W, Z, F, REACH, G = 0.028, 20.0, 0.7, 10.0, 0.8, 9.81


def tilted(angle, axis):
    """Axes that are turned by an angle about an axis (Rodrigues)."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def columns(*rotations, **others):
    return {name: np.array([R[:, k] for R in rotations]) for k, name in enumerate(AXES)} | others


def attitudes(run):
    return np.stack([run.columns[name] for name in AXES], axis=-1)


def wanted_attitude(force):
    b3 = force / np.linalg.norm(force)
    b2 = np.cross(b3, [1.0, 0.0, 0.0])
    b2 /= np.linalg.norm(b2)
    return np.stack([np.cross(b2, b3), b2, b3], axis=1)


def vee(A):
    return np.array([A[2, 1], A[0, 2], A[1, 0]])


def command(force, rate, second, h=1e-4):
    """Wanted attitude, angular velocity and its rate, by differences of a curve with these derivatives."""
    R = [wanted_attitude(force + s * rate + s * s * second / 2) for s in (-h, 0.0, h)]
    first, twice = (R[2] - R[0]) / (2 * h), (R[2] - 2 * R[1] + R[0]) / h**2
    return R[1], vee(R[1].T @ first), vee(first.T @ first + R[1].T @ twice)


def slope(_, y):
    """The second implementation: two aircraft as rows of position, velocity, attitude, spin, command, its rate."""
    rows, out = y.reshape(2, 24), np.zeros((2, 24))
    d, v = rows[1, :3] - rows[0, :3], rows[1, 3:6] - rows[0, 3:6]
    r = np.linalg.norm(d)
    for i, sign in ((0, 1.0), (1, -1.0)):
        q, p, R, spin, f, rate = np.split(rows[i], [3, 6, 15, 18, 21])
        R, u = R.reshape(3, 3), sign * (0.1 * (r - 1) * d / r + 0.1 * v)
        s = u / np.sqrt(1 + (np.linalg.norm(u) / (REACH * MASS * G)) ** 2)
        second = F**2 * (s - f) - 2 * F * rate
        force = f + [0, 0, MASS * G]
        Rc, turn, turning = command(force, rate, second)
        e_R, seen = vee(Rc.T @ R - R.T @ Rc) / 2, R.T @ Rc @ turn
        change = -(W**2) * e_R - 2 * Z * W * (spin - seen) - np.cross(spin, seen) + R.T @ Rc @ turning
        hat = np.array([[0, -spin[2], spin[1]], [spin[2], 0, -spin[0]], [-spin[1], spin[0], 0]])
        push = max(force @ R[:, 2], 0.0) * R[:, 2] / MASS - [0, 0, G]
        out[i] = np.concatenate([p, push, (R @ hat).ravel(), change, rate, second])
    return out.ravel()


@pytest.fixture(scope="module")
def flight():
    """Two aircraft, one of them on its side, that the law draws together."""
    R = tilted(1.2, [1.0, 0.5, 0.2]), tilted(0.0, [1.0, 0.0, 0.0])
    start = fk.State(PLACES, SPEEDS, columns=columns(*R, spin=np.array([[3.0, -2.0, 1.0], [0.0, 0.0, 0.5]])))
    made = fk.Scenario(LAW, start, t_end=1.5, frames=61, bodies=fk.Quadrotor(), tolerance=1e-10)
    return fk.simulate(made, progress=False)


def test_a_second_implementation_agrees(flight):
    R, spin = attitudes(flight)[0], flight.columns["spin"][0]
    first = [np.concatenate([PLACES[i], SPEEDS[i], R[i].ravel(), spin[i], np.zeros(6)]) for i in (0, 1)]
    y = solve_ivp(slope, (0, 1.5), np.concatenate(first), rtol=1e-9, atol=1e-10, t_eval=[0.5, 1.5]).y
    for k, frame in enumerate((20, 60)):
        rows = y[:, k].reshape(2, 24)
        assert np.abs(flight.q[frame] - rows[:, :3]).max() < 1e-5
        assert np.abs(attitudes(flight)[frame] - rows[:, 6:15].reshape(2, 3, 3)).max() < 1e-5
    assert np.abs(flight.residual).max() < 1e-6 * max(1.0, flight.turnover)
    assert abs(flight.trace["departed"][-1]) > 1e-3


def test_attitudes_stay_rotations(flight):
    R = attitudes(flight)
    assert np.abs(np.einsum("fnki,fnkj->fnij", R, R) - np.eye(3)).max() < 1e-9
    assert (np.linalg.det(R) > 0).all()


def test_the_attitude_error_only_falls(flight):
    """V = |e_W|^2/2 + w^2 trace(1 - Rc' R)/2 has the rate -2 z w |e_W|^2, whatever the desired attitude does."""
    for i in (0, 1):
        values = []
        for k in range(len(flight.t)):
            f, rate = flight.columns["command"][k, i], flight.columns["command_rate"][k, i]
            R, spin = attitudes(flight)[k, i], flight.columns["spin"][k, i]
            Rc, turn, _ = command(f + [0, 0, MASS * G], rate, np.zeros(3))
            off = spin - R.T @ Rc @ turn
            values.append(off @ off / 2 + W**2 * np.trace(np.eye(3) - Rc.T @ R) / 2)
        assert (np.diff(values) <= 1e-6 * values[0]).all()
        assert values[-1] < 1e-3 * max(values[0], 1.0)


@dataclass(frozen=True, eq=False)
class Free(fk.Quadrotor):
    """Rotors that exert no moments."""

    def moments(self, x):
        return [0 * s for s in x.columns["spin"]]


def test_without_moments_energy_and_angular_momentum_are_kept():
    J = np.array([16.571710e-6, 16.655602e-6, 29.261652e-6])
    spin = np.array([[5.0, 1.0, 2.0], [0.1, 6.0, 0.3]])
    start = fk.State(PLACES, SPEEDS, columns={"spin": spin})
    run = fk.simulate(fk.Scenario(LAW, start, t_end=2.0, frames=21, bodies=Free(), tolerance=1e-11), progress=False)
    found = run.columns["spin"]
    energy = (J * found**2).sum(axis=2)
    momentum = np.einsum("fnij,fnj->fni", attitudes(run), J * found)
    assert np.abs(energy / energy[0] - 1).max() < 1e-8
    assert np.abs(momentum - momentum[0]).max() < 1e-8 * np.abs(momentum).max()
    assert np.ptp(found[:, 0], axis=0).max() > 0.5


def test_upside_down_is_an_equilibrium_of_the_controller():
    """Without a force to fly after, the error e_R of half a turn is zero: rotors idle, and the aircraft falls."""
    over = np.diag([1.0, -1.0, -1.0])
    law = fk.Law(fk.Fixed(2, []), [fk.Consensus(0.1)])
    start = fk.State(PLACES, np.zeros((2, 3)), columns=columns(over, tilted(3.0, [1, 0, 0])))
    run = fk.simulate(fk.Scenario(law, start, t_end=2.0, frames=5, bodies=fk.Quadrotor()), progress=False)
    assert np.abs(run.p[:, 0] - np.outer(run.t, [0.0, 0.0, -G])).max() < 1e-7
    assert np.abs(attitudes(run)[:, 0] - over).max() < 1e-12
    # A little less than half a turn is righted.
    assert np.abs(attitudes(run)[-1, 1] - np.eye(3)).max() < 1e-3


@pytest.mark.parametrize("ratio", [0.3, 0.7])
def test_a_small_tilt_rings_and_settles_as_an_oscillator(ratio):
    """Tilt e'' + 2 z w e' + w^2 e = 0: it overshoots by exp(-pi z/sqrt(1 - z^2)) of itself."""
    small = 1e-3
    start = fk.State(PLACES, np.zeros((2, 3)), columns=columns(tilted(small, [1, 0, 0]), tilted(small, [0, 1, 0])))
    law = fk.Law(LAW.graph, [fk.Gradient(fk.Potential("k*(r - 1)**2/2", k=0.0)), fk.Consensus(0.0)])
    bodies = fk.Quadrotor(attitude_damping=ratio)
    run = fk.simulate(fk.Scenario(law, start, t_end=0.6, frames=601, bodies=bodies, tolerance=1e-11), progress=False)
    tilt = np.arcsin(attitudes(run)[:, 0, 2, 1]) / small
    fast = W * np.sqrt(1 - ratio**2)
    exact = np.exp(-ratio * W * run.t) * (np.cos(fast * run.t) + ratio * W / fast * np.sin(fast * run.t))
    assert np.abs(tilt - exact).max() < 1e-4
    assert -tilt.min() == pytest.approx(np.exp(-np.pi * ratio / np.sqrt(1 - ratio**2)), rel=0.01)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: fk.Quadrotor(reach=1.0), "reach must be below 1"),
        (lambda: fk.Quadrotor(yaw_inertia=0.0), "yaw_inertia"),
        (lambda: fk.Scenario(LAW, fk.State(PLACES[:, :2]), 1.0, bodies=fk.Quadrotor()), "must have 3 dimensions"),
        (lambda: fk.Scenario(LAW, fk.State(PLACES, columns={"axis_1": np.ones((2, 3))}), 1.0, bodies=fk.Quadrotor()),
         "right-handed orthonormal axes"),
    ],
)  # fmt: skip
def test_wrong_values_are_refused(make, says):
    with pytest.raises(InvalidInput, match=says):
        make()
