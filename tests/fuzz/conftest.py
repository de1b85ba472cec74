"""A cache of their own for formulas nobody will see again."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> None:
    """They do not belong in the user's cache."""
    monkeypatch.setenv("FLOCKING_CACHE", str(tmp_path_factory.getbasetemp() / "fuzz_cache"))
