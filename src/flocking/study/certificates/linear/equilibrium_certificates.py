"""Guarantees of the linearisation of a law at an equilibrium of its potentials, such as a lattice.

They concern small deformations of that equilibrium, which is named in each: not of the motion from the start to it.
"""

from __future__ import annotations

import numpy as np

from flocking.formula.intervals import Interval
from flocking.formula.safe_digits import given_text, rounded_down, rounded_up
from flocking.model.law import Scenario
from flocking.study.certificates.certificate import Certificate, Enclosure, decided, not_applicable
from flocking.study.certificates.consensus_certificates import SETTLED, TOGETHER
from flocking.study.certificates.linear.lossy_lattice import LossyLattice
from flocking.study.certificates.linear.near_equilibrium import NearEquilibrium
from flocking.study.certificates.sources import sources

KEYS = (
    "equilibrium", "equilibrium_decay_rate", "equilibrium_settling_time", "equilibrium_delay", "equilibrium_period",
    "equilibrium_loss", "equilibrium_noise",
)  # fmt: skip
"""Keys of the certificates."""


def equilibrium_certificates(scenario: Scenario) -> tuple[Certificate, ...]:
    """All guarantees of the linearisation of a scenario at the equilibrium to which descent from its start leads.

    Parameters
    ----------
    scenario
        The scenario.
    """
    system, source = NearEquilibrium(scenario), sources()["equilibrium"]
    if not all(h.holds for h in system.speaks):
        return not_applicable(KEYS, source, system.speaks)
    hypotheses = system.hypotheses
    if not hypotheses[-1].holds:
        return tuple(decided(key, source, hypotheses) for key in KEYS)
    first, least_stiffness = system.order == 1, system.least_stiffness
    said = f"Of the linearisation near the equilibrium of {system.name}: "
    found = [decided(
        KEYS[0], source, hypotheses, bound=Enclosure(0.0, system.equilibrium.radius), side="is",
        quantity="distance of the computed from the exact equilibrium",
        statement=f"An exact equilibrium of {system.name}, is stable in the ideal world: the least stiffness of a "
        f"deformation is at least {rounded_down(least_stiffness.lo)}.",
    )]  # fmt: skip

    def row(key: str, bound: Interval | None, quantity: str, words: str, reason: str = "") -> None:
        if bound is not None and not (np.isfinite(bound.lo) and np.isfinite(bound.hi)):
            reason = reason or "the numbers are too large or too small for an enclosure in double precision"
        statement = "" if bound is None else said + words
        found.append(decided(
            key, source, hypotheses, reason=reason, bound=bound, side="is", quantity=quantity, statement=statement
        ))  # fmt: skip

    rate = system.rate()
    reason = rate if isinstance(rate, str) else "" if rate.lo > 0.0 else "the rate was not proven to be positive"
    bound = None if isinstance(rate, str) else rate
    low = 0.0 if bound is None else float(bound.lo)
    words = f"in the ideal world every deformation decays, in the end, at the rate {rounded_down(low)} or faster."
    row(KEYS[1], bound, "rate of decay", words, reason)
    settling = None if reason or bound is None else Interval.of(SETTLED).log() / bound
    late = 0.0 if settling is None else float(settling.hi)
    row(KEYS[2], settling, "time to 2 %",
        f"in the ideal world a deformation has fallen to 2 % after {rounded_up(late)}.",
        reason or ("" if first else "before it decays a deformation of second order may grow"))  # fmt: skip
    unknown = "no limit of the ratio of stiffness to damping was proven"
    delay, period = system.delay(), system.period()
    row(KEYS[3], delay, "delay of all states, the own one too",
        "" if delay is None else f"under continuous control no such delay below {rounded_down(delay.lo)} makes a "
        "deformation grow.",
        unknown if delay is None else "")  # fmt: skip
    row(KEYS[4], period, "period of held control",
        "" if period is None else f"under held control, with the present known, {TOGETHER}, no deformation grows for "
        f"periods below {rounded_down(period.lo)}.",
        unknown if period is None else "")  # fmt: skip
    row(KEYS[5], *_loss(system, period))
    noise = system.noise()
    what = "deformation" if first else "velocity relative to the mean"
    gives = "rates gives" if first else "accelerations gives at most"
    row(KEYS[6], noise, f"mean square {what} of an agent, all axes together, for each unit of noise intensity",
        f"in the ideal world white noise of intensity s^2 on all {gives} s^2 times {rounded_up(noise.hi)} in the long "
        "run.")  # fmt: skip
    return tuple(found)


STRESSED = (
    "links are not known to be without stress there, and where one presses or pulls no deformation falls to zero: a "
    "lost message leaves the forces of other links without their counterpart"
)
"""Why nothing is stated of lost messages at an equilibrium under stress."""

LEFT = "a link there is longer than the distance at which links appear: once a message is lost it does not come back"
"""Why nothing is stated of lost messages under hysteresis."""

NO_FORCE = "forces of links there, below 1e-9 of their stiffness times the smallest distance, count as none"
"""What is neglected at an equilibrium without stress."""


def _loss(system: NearEquilibrium, period: Interval | None) -> tuple[Interval | None, str, str, str]:
    """Bound, quantity, words and reason against it of what lost messages do to deformations."""
    first = system.order == 1
    reason = STRESSED if not system.unstressed else "" if system.links_return else LEFT
    if first:
        words = (
            "where every message may be lost, independently with any probability below 1, and is then left out, the "
            f"mean square of deformations falls under held control, {TOGETHER}, for periods below "
            f"{rounded_down(period.lo)}; {NO_FORCE}."
            if period is not None
            else ""
        )
        return period, "period of held control, with messages lost", words, reason
    quantity = "factor of the mean square of deformations and relative velocities from tick to tick, in the long run"
    lattice = LossyLattice(system)
    failed = next((h for h in lattice.hypotheses if not h.holds), None)
    if not reason and failed is not None:
        reason = (
            "of order 2 the period and the probability matter, and this is not declared: "
            f"{failed.statement} ({failed.found})"
        )
    if reason:
        return None, quantity, "", reason
    low, high = lattice.growth
    if low >= 1.0:
        reason = f"it does not fall: the {quantity} is at least {rounded_down(low)}"
    elif not high < 1.0:
        reason = (
            f"it is not certain that it falls: the {quantity} lies between {rounded_down(low)} and {rounded_up(high)}"
        )
    world = lattice.world
    words = (
        f"under control held for {given_text(world.period)}, with {given_text(world.probability)} of the messages "
        f"lost and left out, the {quantity}, is at most {rounded_up(high)}; {NO_FORCE}."
    )
    return Interval.of(low, high), quantity, words, reason
