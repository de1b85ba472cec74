"""Syntax trees while other threads parse."""

from __future__ import annotations

import ast
import gc
import threading
import time

import pytest

from flocking.formula import syntax_trees
from flocking.formula.syntax_trees import parsed

TEXT = "\n".join(f"def f{k}(a, b):\n    return a*(b + {k})**2 - sin(a/{k + 1})" for k in range(40))


def test_threads_that_parse_at_once_all_get_their_trees():
    """Searches for garbage let other threads run amid a tree: `ast.parse` itself then fails on Python 3.11."""
    before, failed = gc.get_threshold(), []

    def other_threads_run(phase: str, about: dict[str, int]) -> None:
        time.sleep(0.0)

    def work() -> None:
        for _ in range(20):
            try:
                assert len(parsed(TEXT).body) == 40
            except SystemError as error:
                failed.append(error)

    gc.callbacks.append(other_threads_run)
    gc.set_threshold(50, 2, 2)
    try:
        threads = [threading.Thread(target=work) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        gc.set_threshold(*before)
        gc.callbacks.remove(other_threads_run)
    assert not failed


def test_a_parser_that_fails_by_chance_is_asked_again(monkeypatch):
    """As it does where a library parses in another thread."""
    real, failures = ast.parse, [1, 1]

    def parse(text: str, mode: str = "exec") -> ast.AST:
        if failures:
            failures.pop()
            raise SystemError("AST constructor recursion depth mismatch (before=57, after=52)")
        return real(text, mode=mode)

    monkeypatch.setattr(syntax_trees.ast, "parse", parse)
    assert len(parsed("def f(x):\n    return x\n").body) == 1
    assert isinstance(parsed("1 + x", "eval"), ast.Expression)
    failures += [1] * syntax_trees.PARSES
    with pytest.raises(SystemError, match="recursion depth"):
        parsed("x")
