"""HOW a scenario is computed: generated kernels, located switches, sessions and runs."""

from typing import TYPE_CHECKING

if not TYPE_CHECKING:
    from flocking.moved_names import moved_from

    __getattr__ = moved_from(__name__)
