"""The exact engine: adaptive steps of order 8 that end at every switch of a link."""

from typing import TYPE_CHECKING

if not TYPE_CHECKING:
    from flocking.moved_names import moved_from

    __getattr__ = moved_from(__name__)
