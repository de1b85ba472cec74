"""Documented names that have moved are still there, and warn."""

from importlib import import_module

import pytest

from flocking.moved_names import MOVED, found

NAMES = [(package, name, place) for package, names in MOVED.items() for name, place in names.items()]


@pytest.mark.parametrize(("package", "name", "place"), NAMES)
def test_the_old_place_names_the_new_one(package, name, place):
    with pytest.warns(DeprecationWarning, match=rf"{package}\.{name} has moved to {place}\."):
        value = getattr(import_module(package), name)
    assert value is found(place)
    assert getattr(value, "__qualname__", value.__name__) == place.split(".")[-1] or value.__name__ == place


def test_names_that_never_were_are_not_found():
    with pytest.raises(AttributeError, match=r"module 'flocking\.engine' has no attribute 'nothing'"):
        _ = import_module("flocking.engine").nothing
