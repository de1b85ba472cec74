"""Native functions take named tuples, read their fields by name, make them and pass them on."""

from typing import NamedTuple

import numpy as np
import pytest

from flocking.formula.native.functions import native, native_apart
from flocking.formula.native.kinds import RecordKind, UntranslatableError, arguments_of


class Span(NamedTuple):
    """An interval."""

    begin: float
    end: float


class Path(NamedTuple):
    """Places over an interval."""

    span: Span
    places: np.ndarray
    closed: bool


class Other(NamedTuple):
    """Has the fields of `Span` by other names."""

    low: float
    high: float


@native
def length(path, scale):
    total = 0.0
    for k in range(path.places.shape[0] - 1):
        total += abs(path.places[k + 1] - path.places[k])
    if path.closed:
        total += abs(path.places[0] - path.places[path.places.shape[0] - 1])
    return scale * total / (path.span.end - path.span.begin)


@native_apart
def width(span):
    return span.end - span.begin


@native
def half_width(path):
    half = Span(path.span.begin, 0.5 * (path.span.begin + path.span.end))
    path.places[0] = half.end
    begin, end = half
    return width(half) + 0.0 * (begin + end) + width(path.span) * 0.0


@native
def misread(span):
    return span.middle


@native
def ambiguous(span, other, choose):
    found = span
    if choose:
        found = other
    return found[0]


PLACES = np.array([0.0, 3.0, 1.0, 0.1])


@pytest.mark.parametrize("closed", [False, True])
def test_fields_are_read_by_name_as_python_reads_them(closed):
    path = Path(Span(0.5, 2.0), PLACES, closed)
    assert length(path, 3.0) == length.py_func(path, 3.0)
    # The second call takes the fast way; another record of the same fields' kinds does not slip through it.
    assert length(path, 3.0) == length.py_func(path, 3.0)


def test_records_are_made_and_passed_to_functions_compiled_separately():
    path = Path(Span(1.0, 4.0), PLACES.copy(), True)
    assert half_width(path) == 1.5
    assert path.places[0] == 2.5


def test_another_record_is_another_function():
    assert width(Span(1.0, 4.0)) == 3.0
    with pytest.raises(UntranslatableError, match="the attribute end of a Other"):
        width(Other(1.0, 4.0))
    assert width(Span(1.0, 5.0)) == 4.0


def test_what_has_no_such_field_is_refused():
    with pytest.raises(UntranslatableError, match="the attribute middle of a Span"):
        misread(Span(0.0, 1.0))
    with pytest.raises(UntranslatableError, match="found, which is given records of several kinds"):
        ambiguous(Span(0.0, 1.0), Other(0.0, 1.0), True)


def test_arrays_of_records_must_be_stored_row_by_row():
    with pytest.raises(TypeError, match="row by row"):
        length(Path(Span(0.5, 2.0), PLACES[::2], True), 3.0)


def test_signatures_name_records():
    kind = RecordKind(Path, arguments_of(f"{Span.__module__}:Span(f8, f8), f8[:], b1"), Path._fields)
    assert arguments_of(f"i8, {kind}, f8[:,:]") == (*arguments_of("i8"), kind, *arguments_of("f8[:,:]"))
