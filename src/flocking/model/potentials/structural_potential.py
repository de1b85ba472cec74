"""The potential of structural nets: zero at one distance, bounded slopes on either side (Olfati-Saber (29))."""

from __future__ import annotations

from flocking.model.checks import number
from flocking.model.potentials.potential import Potential

FORMULA = (
    "(a + b)/2*(sqrt(1 + (r - d + (b - a)/(2*sqrt(a*b)))**2) - sqrt(1 + ((b - a)/(2*sqrt(a*b)))**2))"
    " + (a - b)/2*(r - d)"
)
"""psi_alpha(r - d), with c = (b - a)/(2 sqrt(a b)) written out."""


def structural_potential(distance: float, a: float = 1.0, b: float = 5.0) -> Potential:
    """psi_alpha(r - d_alpha) of Olfati-Saber (29), whose slope is the action function phi_alpha.

    Parameters
    ----------
    distance
        d_alpha, where potential and slope vanish; positive.
    a, b
        Bounds of attraction and repulsion, 0 < a <= b: phi_alpha increases, attraction is less than a and repulsion
        less than b at every distance.

    Raises
    ------
    InvalidInput
        If a value is out of range.

    Examples
    --------
    >>> psi = structural_potential(7.0)
    >>> float(psi(7.0)), float(psi.slope(7.0))
    (0.0, 0.0)
    """
    owner = "structural_potential"
    d = number(owner, "distance", distance, above=0.0)
    low = number(owner, "a", a, above=0.0)
    return Potential(FORMULA, a=low, b=number(owner, "b", b, least=low), d=d)
