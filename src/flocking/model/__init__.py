"""The simulated system: states, potentials, graphs, terms and laws. Formulas only, no time loop, no files."""

from typing import TYPE_CHECKING

if not TYPE_CHECKING:
    from flocking.moved_names import moved_from

    __getattr__ = moved_from(__name__)
