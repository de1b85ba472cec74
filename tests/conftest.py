"""Settings shared by all tests: a profile for drawn examples, interrupts that arrive, counts and times at the end."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Generator

# Several processes of tests share the processors: threads of OpenBLAS that wait for one another would use them up.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import HealthCheck, settings

from tests.counting import (  # noqa: F401 - pytest finds them here
    _counts_are_told,
    pytest_runtest_makereport,
    pytest_runtest_protocol,
    pytest_sessionfinish,
    pytest_terminal_summary,
    pytest_testnodedown,
)
from tests.slow_cases import mark_slow_cases, put_longest_first

settings.register_profile(
    "project",
    deadline=None,  # the first example of a structure generates its functions
    derandomize=True,
    max_examples=40,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("project")

# Where Python may write no bytecode, as in many containers, each process that tests start compiles the library again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A shell starts jobs in the background with interrupts ignored, and processes inherit it: those of the tests need them.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect without searches for garbage: what is made lives to the end, and later full searches leave it out."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.set_threshold(GARBAGE, 10, 10)
        gc.enable()


GARBAGE = 20_000
"""Objects made between two searches for garbage, instead of 700: expressions of SymPy are many and live long."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put tests into the slow tier before pytest selects, and the longest first."""
    put_longest_first(items)
    missing = mark_slow_cases(items)
    if missing and not any("::" in argument for argument in config.args):
        raise pytest.UsageError(f"slow_cases.txt or sampled_cases.txt names tests that are missing: {sorted(missing)}")
