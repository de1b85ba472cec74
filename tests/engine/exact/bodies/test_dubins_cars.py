"""A car that drives forward at one speed and turns no tighter than a radius (Dubins 1957), declared from outside."""

from dataclasses import dataclass

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import flocking as fk
from flocking.model.bodies.body import Limit

SPEED, TURN = 1.5, 0.8


@dataclass(frozen=True, eq=False)
class DubinsCar(fk.Body):
    """q' = v e, e' = w n: the car turns towards the desired velocity of the law, |w| at most ``turn``."""

    speed: float = SPEED
    turn: float = TURN
    masses: object = 1.0
    damping: object = 0.0
    order = 1
    homogeneous = True
    columns = (fk.Column("heading", 2),)
    parameters = property(lambda self: {"speed": self.speed, "turn": self.turn})

    def __post_init__(self):
        self.check_fields()

    def start(self, column, q, p):
        return np.tile([1.0, 0.0], (len(q), 1))

    def lets(self, x):
        a, b = x.columns["heading"]
        return {"wanted": a * x.u[1] - b * x.u[0]}

    def held(self, dimension):
        return ("left", "right")

    def limits(self, x):
        a, b = x.columns["heading"]
        wanted, most = a * x.u[1] - b * x.u[0], x.parameter("turn")
        return {"left": Limit(wanted - most, most - wanted), "right": Limit(-wanted - most, wanted + most)}

    def rates(self, x):
        a, b = x.columns["heading"]
        most = x.parameter("turn")
        w = sympy.Piecewise((most, x.held("left") > 0.5), (-most, x.held("right") > 0.5), (x.let("wanted"), True))
        return {
            "q": [x.parameter("speed") * a, x.parameter("speed") * b],
            "heading": [-w * b + a * (1 - a**2 - b**2) / 2, w * a + b * (1 - a**2 - b**2) / 2],
        }


LAW = fk.Law(fk.Fixed.complete(3), [fk.Gradient(fk.Potential("r**2/2"))])
PLACES = np.array([[0.0, 0.0], [4.0, 1.0], [1.0, 5.0]])


def run_of(t_end, **options):
    return fk.simulate(fk.Scenario(LAW, fk.State(PLACES), t_end=t_end, frames=31, bodies=DubinsCar(), **options),
                       progress=False)  # fmt: skip


def test_cars_drive_as_a_second_implementation_with_angles_says():
    def slope(_, y):
        q, angle = y[:6].reshape(3, 2), y[6:]
        u = q.sum(axis=0) - 3 * q
        w = np.clip(np.cos(angle) * u[:, 1] - np.sin(angle) * u[:, 0], -TURN, TURN)
        return np.concatenate([(SPEED * np.stack([np.cos(angle), np.sin(angle)], axis=1)).ravel(), w])

    run = run_of(6.0, tolerance=1e-10)
    y = solve_ivp(slope, (0, 6), [*PLACES.ravel(), 0, 0, 0], rtol=1e-11, atol=1e-12, t_eval=run.t, max_step=0.01).y
    assert np.abs(run.q - y[:6].T.reshape(-1, 3, 2)).max() < 1e-6
    assert np.abs(run.columns["heading"][..., 0] - np.cos(y[6:].T)).max() < 1e-6
    assert np.abs(np.linalg.norm(run.columns["heading"], axis=2) - 1).max() < 1e-8
    assert np.abs(run.residual).max() < 1e-6 * run.turnover
    assert np.abs(run.trace["departed"][-1]) > 1.0


def test_a_car_that_is_behind_drives_the_tightest_circle():
    """Turning at its most for all the time, a car is on the circle of radius v/w about its left or right."""
    run = run_of(0.5)
    side = np.array([1.0, 1.0, -1.0])
    centre = PLACES + np.stack([np.zeros(3), side * SPEED / TURN], axis=1)
    held = np.sign(PLACES.sum(axis=0)[1] - 3 * PLACES[:, 1]) == side
    assert held.all()
    radius = np.linalg.norm(run.q - centre, axis=2)
    assert radius == pytest.approx(SPEED / TURN, abs=1e-7)
