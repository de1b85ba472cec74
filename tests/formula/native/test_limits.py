"""What native functions cannot translate faithfully they refuse by name; the rest follows Python to its corners."""

import functools
import math

import numpy as np
import pytest

from flocking.formula.native.functions import NativeFunction, native, native_of
from flocking.formula.native.kinds import UntranslatableError

last = 7.0


def held(body, arguments="a"):
    """A native function of a text, as generated modules have them."""
    text = f"def f({arguments}):\n" + "".join(f"    {line}\n" for line in body.split("\n"))
    known = {"np": np, "math": math, "SOURCE": text, "last": last}
    exec(compile(text, "<text>", "exec"), known)
    return NativeFunction(known["f"])


REFUSED = {
    "else of while": "while a > 0:\n    a -= 1\nelse:\n    a = 5.0\nreturn a",
    "or gives a value": "b = a or 3.0\nreturn b",
    "and gives a value": "return a and 2.0",
    "one branch only": "if a > 0:\n    b = 1.0\nreturn b",
    "counter of an empty range": "for k in range(int(a)):\n    pass\nreturn k",
    "bound in a loop": "for k in range(int(a)):\n    b = k\nreturn b",
    "local read before": "s = 0.0\nfor k in range(3):\n    s += last\n    last = s\nreturn s",
    "no return at the end": "if a > 0:\n    return 1.0",
    "number then array": "b = 1.0\nb = np.zeros(3)\nreturn b[0] + b",
    "array then number": "b = np.zeros(3)\nif a > 0:\n    b = 2.0\nreturn 1.0 * b",
    "tuple then number": "b = (a, a)\nb = 2.0\nreturn b",
    "tuple bound twice": "b = (1.0, 2.0)\nif a > 0:\n    b = (3.0, 4.0)\nreturn b[0]",
    "function bound twice": "g = math.sin\nif a > 0:\n    g = math.cos\nreturn g(a)",
    "kind of array": "b = np.zeros(3, np.int16)\nreturn b[0]",
    "kind int": "b = np.zeros(3, int)\nb[0] = a\nreturn b[0]",
    "base of log": "return math.log(a, 2.0)",
    "too many for int": "return int(a, 16)",
    "too few": "return float()",
    "real index": "b = np.zeros(3)\nb[2] = 5.0\nreturn b[a]",
    "real range": "s = 0\nfor k in range(a):\n    s += k\nreturn s",
    "range of four": "s = 0\nfor k in range(1, 2, 1, 1):\n    s += k\nreturn s",
    "large integer": "return a * 2 + (2**70 - 3)",
    "large unsigned": "return np.uint64(2**64 + 1) + np.uint64(a)",
    "too large for 32 bits": "return np.int32(2**40)",
    "signed and unsigned": "return np.uint64(a) < np.int64(a)",
    "join of signed and unsigned": "b = np.int64(a)\nif a > 3:\n    b = np.uint64(a)\nreturn b >> 1",
    "made in a loop": "p = np.zeros(3)\nfor k in range(4):\n    c = np.zeros(3)\n    p = c\nreturn p[0]",
    "power not known": "return 2 ** int(a)",
    "minimum of NaN": "return np.minimum(math.nan, a)",
    "shift below zero": "return int(a) << -1",
    "shift beyond 64 bits": "return int(a) << 64",
    "complement of a flag": "return ~(a > 3)",
    "deleted": "b = a\ndel b\nreturn a",
    "keyword": "return max(a, key=abs)",
    "two returned functions": "return math.sin if a > 3 else math.cos",
    "array below no length": "b = np.zeros(-1)\nreturn a",
}  # fmt: skip


@pytest.mark.parametrize("what", REFUSED)
def test_what_would_differ_from_python_is_refused(what):
    with pytest.raises(UntranslatableError, match="f cannot be compiled"):
        held(REFUSED[what])(2.0)


@pytest.mark.parametrize("arguments", ["a, b=2.0", "a, *, b", "*a", "**a", "a, /"])
def test_arguments_of_other_forms_are_refused(arguments):
    with pytest.raises(UntranslatableError, match=r"f cannot be compiled.*argument"):
        held("return 1.0", arguments)(2.0)


BIG = 2**63
FOLLOWED = {
    "unsigned result": ("return np.uint64(2**64 - 3)", 1.0, 2**64 - 3),
    "unsigned maximum": ("return max(np.uint64(2**63 + 5), np.uint64(3))", 1.0, 2**63 + 5),
    "unsigned minimum": ("return min(np.uint64(2**63 + 5), np.uint64(3))", 1.0, 3),
    "unsigned size": ("return abs(np.uint64(2**63 + 5))", 1.0, 2**63 + 5),
    "unsigned of a real": ("return np.uint64(a)", 2.0**63 + 4096, 2**63 + 4096),
    "flags": ("return 1 * max(a > 1, a > 5), 1 * min(a > 1, a > 5)", 2.0, (1, 0)),
    "minus a flag": ("return -(a > 1)", 2.0, -1),
    "absolute flag": ("return 3 * abs(a > 1)", 2.0, 3),
    "shift of flags": ("return (a > 1) >> (a > 1)", 2.0, 0),
    "flag of a number": ("return 1 * np.bool_(2)", 2.0, 1),
    "shift to nothing": ("return (-5) >> int(a), 5 >> int(a)", 64.0, (-1, 0)),
    "none": ("a += 1.0\nreturn None", 2.0, None),
    "NaN least": ("return min(a, 1.0), min(1.0, a), max(1.0, a)", math.nan, (math.nan, 1.0, 1.0)),
    "least of kinds": ("return min(int(a), 2.5), max(int(a), 2.5)", 2.0, (2, 2.5)),
    "swap": ("b = np.zeros(2)\nb[0] = a\nb[0], b[1] = b[1], b[0]\nreturn b[0], b[1]", 2.0, (0.0, 2.0)),
    "loop variable": ("s = 0\nfor k in range(4):\n    k += 2\n    s += k\nreturn s, k", 2.0, (14, 5)),
    "lazy parts": ("n = int(a)\nb = np.zeros(4)\nreturn 0 < n < 4 and b[n] == 0.0", 2.0, True),
    "nothing to nothing": ("return 0**0, a**0, 0.0**0", 0.0, (1, 1.0, 1.0)),
}  # fmt: skip


@pytest.mark.parametrize("what", FOLLOWED)
def test_corners_of_arithmetic_are_those_of_python(what):
    body, given, known = FOLLOWED[what]
    found = held(body)(given)
    assert np.array_equal(np.asarray(found, object), np.asarray(known, object)) or str(found) == str(known)


def test_later_parts_of_a_chain_are_computed_only_where_the_earlier_leave_it_open():
    function = held("return 0.0 < a < b[0]", "a, b")
    unreadable = held("return 0 <= k < b.shape[0] < b[k]", "k, b")
    assert function(1.0, np.array([2.0])) is True
    assert function(-1.0, np.array([2.0])) is False
    assert unreadable(2**40, np.array([2.0])) is False


def test_numbers_that_do_not_fit_are_refused():
    with pytest.raises(OverflowError, match="64 bits"):
        held("return a")(2**63)
    narrow = native_of("i4, u4")(_both)
    assert narrow(-(2**31), 2**32 - 1) == (-(2**31), 2**32 - 1)
    for bad in ((2**31, 0), (0, -1), (0, 2**32)):
        with pytest.raises(OverflowError, match="bits"):
            narrow(*bad)


def _both(a, b):
    return a, b


def test_flags_other_than_one_are_true():
    flags = np.array([0, 1, 2, 254], np.uint8).view(np.bool_)
    assert [held("return b[k]", "k, b")(k, flags) for k in range(4)] == [False, True, True, True]


def test_memory_maps_of_other_kinds_are_told_apart(tmp_path):
    total = held("s = 0.0\nfor k in range(b.shape[0]):\n    s += b[k]\nreturn s", "b")
    for number, kind in enumerate((np.float64, np.float32, np.int32)):
        np.arange(4, dtype=kind).tofile(tmp_path / str(number))
        assert total(np.memmap(tmp_path / str(number), kind, "r")) == 6.0


def test_arrays_that_are_not_aligned_are_refused():
    crooked = np.zeros(17, np.uint8)[1:].view(np.float64)
    with pytest.raises(TypeError, match="aligned"):
        held("return b[0]", "b")(crooked)
    function = held("return b[0]", "b")
    assert function(np.ones(2)) == 1.0
    with pytest.raises(TypeError, match="aligned"):
        function(crooked)


def _made(number):
    if number == 1:

        def f(a):
            return a + 1.0
    else:

        def f(a):
            return a + 2.0

    return f


def _closed(number):
    def f(a):
        return a + number

    return f


def _thrice(function):
    @functools.wraps(function)
    def f(a):
        return 3.0 * function(a)

    return f


@_thrice
def decorated(a):
    return a + 1.0


def test_functions_of_one_name_in_one_file_are_told_apart():
    assert [native(_made(k))(1.0) for k in (1, 2)] == [2.0, 3.0]


@pytest.mark.parametrize("function", [_closed(4.0), decorated])
def test_closures_and_decorated_functions_are_refused(function):
    with pytest.raises(UntranslatableError):
        native(function)(1.0)


FACTOR = 2.0
WEIGHTS = np.array([1.0, 2.0])


@native
def scaled(a):
    return helper(a) * WEIGHTS[1]


def helper(a):
    return a * FACTOR


def test_code_on_disk_belongs_to_the_numbers_it_was_made_with(monkeypatch):
    assert NativeFunction(scaled.py_func)(3.0) == 12.0
    monkeypatch.setitem(globals(), "FACTOR", 5.0)
    assert NativeFunction(scaled.py_func)(3.0) == 30.0
    monkeypatch.setitem(globals(), "WEIGHTS", np.array([1.0, 3.0]))
    assert NativeFunction(scaled.py_func)(3.0) == 45.0


def test_faults_of_a_run_are_errors_of_python():
    with pytest.raises(MemoryError):
        held("b = np.zeros((n, 1000000))\nreturn b[0, 0]", "n")(2**38)
    with pytest.raises(ZeroDivisionError):
        held("return 5 // n", "n")(0)
    with pytest.raises(ZeroDivisionError):
        held("return 5 % n", "n")(0)
    assert held("return n // -1, n % -1", "n")(-(2**63)) == (-(2**63), 0)


def test_the_processor_is_chosen_by_the_names_of_the_library_or_of_numba(monkeypatch):
    from flocking.formula.native.objects import processor

    for chosen in ("NUMBA", "FLOCKING"):
        monkeypatch.setenv(f"{chosen}_CPU_NAME", f"x86-64-{chosen}")
        monkeypatch.setenv(f"{chosen}_CPU_FEATURES", f"+{chosen}")
        assert processor.__wrapped__() == (f"x86-64-{chosen}", f"+{chosen}")
