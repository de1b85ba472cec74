"""Interaction graphs: who is a neighbour of whom, with which weight, and what the links are together."""

from typing import TYPE_CHECKING

if not TYPE_CHECKING:
    from flocking.moved_names import moved_from

    __getattr__ = moved_from(__name__)
