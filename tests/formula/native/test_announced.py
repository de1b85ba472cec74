"""A function that takes seconds to compile says so where somebody waits, and when it is compiled alone."""

from __future__ import annotations

import io
import multiprocessing

import numpy as np
import pytest

from flocking.formula.native.functions import NativeFunction


def doubled(x, values):
    return 2.0 * x * values[0]


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def said(monkeypatch: pytest.MonkeyPatch, stream: io.StringIO, told: str) -> str:
    with monkeypatch.context() as patch:
        patch.setattr("sys.stderr", stream)
        assert NativeFunction(doubled, announced_as=told)(2.0, np.array([5.0])) == 20.0
    return stream.getvalue()


@pytest.fixture
def _empty_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path / "cache"))


@pytest.mark.usefixtures("_empty_cache")
def test_a_terminal_is_told_once(monkeypatch):
    line = said(monkeypatch, Terminal(), "the loop of a test")
    assert line.startswith("flocking: compiling the loop of a test for this processor, once")
    assert line.endswith("\n")
    assert line.count("\n") == 1
    assert said(monkeypatch, Terminal(), "the loop of a test") == "", "the machine code is in the cache"


@pytest.mark.usefixtures("_empty_cache")
def test_a_short_function_says_nothing(monkeypatch):
    assert said(monkeypatch, Terminal(), "") == ""


@pytest.mark.usefixtures("_empty_cache")
def test_a_file_is_told_nothing(monkeypatch):
    assert said(monkeypatch, io.StringIO(), "the loop of a test") == ""


@pytest.mark.usefixtures("_empty_cache")
def test_workers_say_nothing(monkeypatch):
    monkeypatch.setattr(multiprocessing, "parent_process", lambda: object())
    assert said(monkeypatch, Terminal(), "the loop of a test") == ""
