"""Native functions compute bit for bit what Python computes, and say what they cannot translate."""

import math
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flocking.formula.native.functions import NativeFunction, native, native_of
from flocking.formula.native.kinds import UntranslatableError, arguments_of

TABLE = np.array([[1.0, 2.0, 4.0], [0.5, 0.25, 0.125]])


def same(a, b):
    """Equal bit for bit, NaN included."""
    return np.asarray(a, dtype=np.float64).tobytes() == np.asarray(b, dtype=np.float64).tobytes()


def held(name, source):
    """A native function of a text, as generated modules have them."""
    known = {"np": np, "math": math, "SOURCE": source, "TABLE": TABLE}
    exec(compile(source, "<text>", "exec"), known)
    return NativeFunction(known[name])


NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)
LEAVES = st.sampled_from(["a", "b", "c", "2.5", "3", "(1/3)", "-1", "1e-3", "math.pi"])
EXPRESSIONS = st.recursive(
    LEAVES,
    lambda part: st.one_of(
        st.builds("({} {} {})".format, part, st.sampled_from("+-*"), part),
        st.builds("({} / (abs({}) + 0.5))".format, part, part),
        st.builds("(abs({}) + 1.0)**{}".format, part, st.sampled_from(["-3.0", "(3/2)", "0.25"])),
        st.builds("math.sqrt(abs({}))".format, part),
        st.builds("math.{}({})".format, st.sampled_from(["sin", "cos", "tanh", "atan"]), part),
        st.builds("({} if {} < {} else {})".format, part, part, part, part),
        st.builds("min({}, max({}, {}))".format, part, part, part),
        st.builds("(-{})".format, part),
        st.builds("({} if {} > 0 and not {} >= {} or {} == {} else 1)".format, *([part] * 6)),
    ),
    max_leaves=12,
)


@settings(max_examples=20, deadline=None)
@given(EXPRESSIONS, st.lists(st.tuples(*[st.floats(-50, 50)] * 3), min_size=5, max_size=5))
def test_random_formulas_give_the_bits_of_python(text, values):
    function = held("f", f"def f(a, b, c):\n    return 1.0 * ({text})\n")
    for triple in values:
        try:
            known = function.py_func(*triple)
        except OverflowError:
            continue
        if not isinstance(known, complex):
            # Python multiplies whole numbers beyond 64 bits; formulas are printed with none.
            assert same(function(*triple), known) or abs(known) > 1e18


@pytest.mark.parametrize("exponent", [0, 1, 2, 3, 5, 12, -1, -2, -7])
def test_powers_are_products(exponent):
    function = held("f", f"def f(a):\n    return a**{exponent}, abs(a) ** ({exponent} + 0.5)\n")
    for a in (-2.5, -1e-3, 0.7, 3.0, 1e5):
        product = 1.0
        for _ in range(abs(exponent)):
            product *= a
        product = product if exponent >= 0 else 1.0 / product
        assert math.isclose(function(a)[0], product, rel_tol=1e-15 * max(abs(exponent), 1))
        assert same(function(a)[1], abs(a) ** (exponent + 0.5))


@native
def collatz(n: int) -> tuple[int, int]:
    """Steps to 1, and the largest number met."""
    steps, largest = 0, n
    while n != 1:
        if n % 2 == 0:
            n //= 2
        else:
            n = 3 * n + 1
        steps += 1
        largest = max(largest, n)
        if steps > 1000:
            break
    return steps, largest


def first_below(values, bound):
    """Index of the first value below the bound, or -1."""
    for k in range(values.shape[0]):
        if values[k] >= bound:
            continue
        return k
    return -1


@native
def uses(values, bound, out):
    """Calls another function twice; its returns lie within a loop."""
    n = values.shape[0]
    scratch = np.zeros((n, 2))
    for i in range(n - 1, -1, -1):
        scratch[i, 0] = values[i]
        scratch[i, 1] += TABLE[1, i % 3]
        row = scratch[i]
        out[i] = row[0] * row[1]
    flags = np.empty(4, np.bool_)
    for k in range(4):
        flags[k] = k > 1
    a = first_below(values, bound)
    b = first_below(out, bound)
    return a, b, flags[0], flags[3]


def test_loops_branches_and_returns_of_several():
    for n in (1, 2, 7, 27, 97, 871):
        assert collatz(n) == collatz.py_func(n)
    assert collatz(27) == (111, 9232)
    for m, k in ((-7, 2), (7, -2), (-7, -2), (7, 2)):
        modulo = held("f", "def f(a, b):\n    return a // b, a % b\n")
        assert modulo(m, k) == (m // k, m % k)


def test_arrays_calls_in_place_and_scratch():
    values = np.random.default_rng(3).normal(size=9)
    for bound in (-0.5, 0.0, -100.0):
        mine, theirs = np.empty(9), np.empty(9)
        assert uses(values, bound, mine) == uses.py_func(values, bound, theirs)
        assert same(mine, theirs)


def test_a_variable_takes_the_widest_kind_it_is_given():
    function = held("f", "def f(n):\n    x = 0\n    for k in range(n):\n        x = x + 0.5\n    return x\n")
    assert function(3) == 1.5
    narrow = held("f", "def f(a):\n    return np.float32(a) * np.float32(0.1)\n")
    assert narrow(0.3) == float(np.float32(0.3) * np.float32(0.1))


@pytest.mark.parametrize("sign", ["<", "<=", ">", ">=", "==", "!="])
def test_comparisons_with_nan_are_those_of_python(sign):
    function = held("f", f"def f(a, b):\n    return a {sign} b, not a {sign} b\n")
    for a in (math.nan, 0.0, -0.0, math.inf, 1.0):
        for b in (math.nan, 0.0, math.inf):
            assert function(a, b) == function.py_func(a, b)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("def f(a):\n    return [a]\n", "expression"),
        ("def f(a):\n    with a:\n        pass\n", "statement With"),
        ("def f(a):\n    return open(a)\n", "function open"),
        ("def f(a):\n    return nothing\n", "name nothing"),
        ("def f(a):\n    for x in (1, 2):\n        pass\n", "loop over"),
        ("def f(a):\n    return f(a)\n", "calls itself"),
        ("def f(a):\n    return a[0]\n", "no array"),
    ],
)
def test_what_cannot_be_translated_is_named(text, says):
    with pytest.raises(UntranslatableError, match=f"f cannot be compiled.*{says}"):
        held("f", text)(1.0)


def test_arguments_of_other_kinds_are_refused_and_never_misread():
    double = native_of("f8, f8[:]")(first_argument)
    assert double(2.0, np.array([3.0])) == 6.0
    assert double(2, np.array([3.0])) == 6.0
    for bad in (np.array([3.0], np.float32), np.array([3]), np.array([[3.0]])):
        with pytest.raises(TypeError, match="Argument 1 of first_argument"):
            double(2.0, bad)
    with pytest.raises(TypeError, match="row by row"):
        double(2.0, np.arange(8.0)[::2])
    with pytest.raises(TypeError, match="not str"):
        double("2", np.array([3.0]))
    assert len(arguments_of("f8, i4[:,:], b1")) == 3


def first_argument(a, b):
    return a * b[0]


def test_a_function_notices_every_other_array():
    function = native(first_argument)
    arrays = [np.array([float(k)]) for k in range(5)]
    for k in (0, 1, 1, 4, 2, 4):
        assert function(3.0, arrays[k]) == 3.0 * k
    assert function(2.0, np.array([7], np.int64)) == 14.0
    assert function(2.0, arrays[3]) == 6.0


def test_threads_share_a_function():
    function, wrong = native(first_argument), []

    def many(k):
        own = np.array([float(k)])
        wrong.extend(1 for _ in range(2000) if function(2.0, own) != 2.0 * k)

    threads = [threading.Thread(target=many, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_machine_code_is_kept_and_made_anew_where_it_was_changed(tmp_path, monkeypatch):
    from flocking.formula.native import objects

    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path / "cache"))
    made = []
    real = objects.object_code
    monkeypatch.setattr(objects, "object_code", lambda text: (made.append(1), real(text))[1])

    def again():
        return NativeFunction(first_argument)(2.0, np.array([5.0]))

    assert again() == 10.0
    assert len(made) == 1
    assert again() == 10.0
    assert len(made) == 1
    (path,) = (tmp_path / "cache").rglob("*.o")
    whole = path.read_bytes()
    for damaged in (b"", whole[:100], whole[:-1], whole[:200] + bytes([whole[200] ^ 1]) + whole[201:]):
        path.write_bytes(damaged)
        before = len(made)
        assert again() == 10.0
        assert len(made) == before + 1
    path.chmod(0o666)
    before = len(made)
    assert again() == 10.0
    assert len(made) == before + 1


def test_scratch_memory_is_given_back():
    import resource

    function = held(
        "f",
        "def f(n):\n    for k in range(5):\n        a = np.empty(n)\n        for i in range(n):\n            a[i] = k\n"
        "    return a[n - 1]\n",
    )
    assert function(200_000) == 4.0
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(40):
        function(200_000)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 40_000
