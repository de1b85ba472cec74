"""The elementary functions of exported C against mpmath, within the bounds that they state."""

import ctypes

import mpmath
import numpy as np
import pytest

from flocking.engine.c_export.elementary_functions import BOUNDS, Precision, elementary_functions
from tests.engine.c_export.building import needs_compiler, shared_object

pytestmark = needs_compiler
NAMES = ["sqrt", "exp", "log", "sin", "cos", "floor", "fabs", "copysign", "pow", "power7"]
BINARY = {"copysign", "pow"}


class Functions:
    def __init__(self, folder, single):
        self.real, kind = (ctypes.c_float, "FLT") if single else (ctypes.c_double, "DBL")
        self.kind = np.float32 if single else np.float64
        head = "#include <stdint.h>\n#include <float.h>\n"
        head += f"typedef {'float' if single else 'double'} law_real;\n"
        head += f"#define LAW_LARGEST {kind}_MAX\n#define LAW_LEAST_NORMAL {kind}_MIN\n"
        tail = ""
        for name in NAMES:
            arguments = "const law_real *a, const law_real *b, law_real *c"
            call = f"law_{name}(a[i]{', b[i]' if name in BINARY else ''})"
            tail += f"void many_{name}(int n, {arguments});\n"
            tail += f"void many_{name}(int n, {arguments})\n{{ (void)b; for (int i = 0; i < n; i++) c[i] = {call}; }}\n"
        source = elementary_functions(NAMES, "law_", Precision(single))
        self.library = shared_object(folder, {"functions.c": head + source + tail})

    def __call__(self, name, a, b=None):
        a = np.ascontiguousarray(a, self.kind)
        b = a if b is None else np.ascontiguousarray(b, self.kind)
        c = np.empty_like(a)
        pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (a, b, c)]
        getattr(self.library, f"many_{name}")(len(a), *pointers)
        return c


@pytest.fixture(scope="module", params=[False, True], ids=["double", "single"])
def functions(request, tmp_path_factory):
    return Functions(tmp_path_factory.mktemp("functions"), request.param)


def worst(functions, name, a, b=None):
    """Largest error in units of the last place, of sines and cosines in units of that of 1."""
    exact, kind, found = getattr(mpmath, {"pow": "power"}.get(name, name)), functions.kind, functions(name, a, b)
    worst = 0.0
    with mpmath.workdps(40):
        for k, got in enumerate(found):
            given = [mpmath.mpf(float(kind(x[k]))) for x in (a, b) if x is not None]
            value = exact(*given)
            unit = np.spacing(kind(1.0)) if name in ("sin", "cos") else np.spacing(kind(abs(float(value))))
            worst = max(worst, float(abs(mpmath.mpf(float(got)) - value) / mpmath.mpf(float(unit))))
    return worst


def draws(functions, count):
    rng, single = np.random.default_rng(4), functions.kind is np.float32
    angle = Precision(single).largest_angle
    large, small = (86.0, -87.0) if single else (700.0, -700.0)
    wide = np.exp(rng.uniform(small, large, count))
    return {
        "sqrt": [(wide,), (rng.uniform(0.9, 1.1, count),)],
        "exp": [(rng.uniform(small, large, count),), (rng.uniform(-1, 1, count),)],
        "log": [(wide,), (rng.uniform(0.5, 2, count),), (1 + rng.uniform(-1e-3, 1e-3, count),)],
        "sin": [(rng.uniform(-7, 7, count),), (rng.uniform(-angle, angle, count),)],
        "cos": [(rng.uniform(-7, 7, count),), (rng.uniform(-angle, angle, count),)],
        "pow": [(rng.uniform(0.01, 100, count), rng.uniform(-9, 9, count)),
                (rng.uniform(0.5, 2, count), rng.uniform(-50, 50, count)),
                (rng.uniform(-9, -0.1, count), rng.integers(-9, 9, count))],
    }  # fmt: skip


@pytest.mark.parametrize("name", sorted(BOUNDS))
def test_errors_stay_within_their_bounds(functions, name):
    for given in draws(functions, 1500)[name]:
        given = tuple(np.asarray(x, functions.kind) for x in given)
        assert worst(functions, name, *given) <= BOUNDS[name][0]


def test_ends_of_the_range(functions):
    inf, nan, least = np.inf, np.nan, np.nextafter(functions.kind(0), functions.kind(1))
    assert functions("exp", [inf, -inf, 2000, -2000, 0]).tolist() == [inf, 0, inf, 0, 1]
    assert functions("log", [0, inf, 1]).tolist() == [-inf, inf, 0]
    assert functions("sqrt", [0, inf, 4]).tolist() == [0, inf, 2]
    assert functions("pow", [0, 0, 0, 3], [2, -1, 0, 0]).tolist() == [0, inf, 1, 1]
    for name, values in (("exp", [nan]), ("log", [nan, -1]), ("sqrt", [nan, -1]), ("sin", [nan, 1e7]), ("cos", [inf])):
        assert np.isnan(functions(name, values)).all()
    assert functions("pow", [-3, -2, -2, -2, -1], [2, 3, -2, 0, -5]).tolist() == [9, -8, 0.25, 1, -1]
    assert np.isnan(functions("pow", [-1, nan, 2, -2], [0.5, 1, nan, 2.5])).all()
    tiny = np.arange(1, 3000).astype(functions.kind) * least
    assert (functions("sqrt", tiny) == np.sqrt(tiny)).all()
    x = np.random.default_rng(0).uniform(-1e5, 1e5, 1000).astype(functions.kind)
    assert (functions("floor", x) == np.floor(x)).all()
    assert (functions("fabs", x) == np.abs(x)).all()
    assert (functions("copysign", x, -x) == -x).all()


@pytest.mark.slow
def test_roots_of_all_mantissas_are_correctly_rounded(functions):
    if functions.kind is np.float32:
        x = np.arange(0x3F800000, 0x40800000, dtype=np.uint32).view(np.float32)
        assert (functions("sqrt", x) == np.sqrt(x)).all()
    x = np.random.default_rng(1).uniform(1, 4, 10**7).astype(functions.kind)
    assert (functions("sqrt", x) == np.sqrt(x)).all()
    for name in BOUNDS:
        for given in draws(functions, 50_000)[name]:
            assert worst(functions, name, *(np.asarray(v, functions.kind) for v in given)) <= BOUNDS[name][0]
