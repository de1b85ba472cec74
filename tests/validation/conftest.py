"""The judge, compiled once for all tests of a session."""

from __future__ import annotations

import pytest

from tests.validation.judge.motion import CompilerMissing, Judge


@pytest.fixture(scope="session")
def judge_folder(tmp_path_factory):
    """Where the compiled judge is."""
    return tmp_path_factory.mktemp("judge")


def _made(folder, digits: int) -> Judge:
    try:
        return Judge(folder, digits=digits)
    except CompilerMissing as reason:
        # The slow comparison compiles its own and fails: `make validate` sees to the compiler.
        pytest.skip(str(reason))


@pytest.fixture(scope="session")
def judge(judge_folder) -> Judge:
    """The judge with 80-bit numbers."""
    return _made(judge_folder, 18)


@pytest.fixture(scope="session")
def judges(judge, judge_folder) -> dict[int, Judge]:
    """The judge with 80-bit and with 128-bit numbers, by digits."""
    return {18: judge, 30: _made(judge_folder, 30)}
