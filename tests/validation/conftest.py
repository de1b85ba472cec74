"""The judge, compiled once for all tests of a session."""

from __future__ import annotations

import shutil

import pytest

from tests.validation.judge.motion import Judge

JUDGED = {"judge", "judges", "judge_folder"}


def pytest_collection_modifyitems(config, items):
    """Without a C compiler the quick tests that need the judge are deselected; the slow ones fail and say so."""
    if shutil.which("cc") or shutil.which("gcc"):
        return
    dropped = [
        item
        for item in items
        if JUDGED & set(getattr(item, "fixturenames", ())) and not item.get_closest_marker("slow")
    ]
    if dropped:
        config.hook.pytest_deselected(items=dropped)
        items[:] = [item for item in items if item not in dropped]


@pytest.fixture(scope="session")
def judge_folder(tmp_path_factory):
    """Where the compiled judge is."""
    return tmp_path_factory.mktemp("judge")


@pytest.fixture(scope="session")
def judge(judge_folder) -> Judge:
    """The judge with 80-bit numbers."""
    return Judge(judge_folder, digits=18)


@pytest.fixture(scope="session")
def judges(judge, judge_folder) -> dict[int, Judge]:
    """The judge with 80-bit and with 128-bit numbers, by digits."""
    return {18: judge, 30: Judge(judge_folder, digits=30)}
