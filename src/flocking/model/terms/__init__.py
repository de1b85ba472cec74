"""Terms of a control law, the symbols they are stated in, and the balance of their energies."""

from typing import TYPE_CHECKING

if not TYPE_CHECKING:
    from flocking.moved_names import moved_from

    __getattr__ = moved_from(__name__)
