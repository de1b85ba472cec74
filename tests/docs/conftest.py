"""The modules that make the pages."""

import sys
from pathlib import Path

import pytest

EXTENSIONS = Path(__file__).parents[2] / "docs" / "_extensions"


@pytest.fixture
def notebooks(monkeypatch):
    """The module that runs tutorials and writes them as notebooks."""
    monkeypatch.syspath_prepend(str(EXTENSIONS))
    import notebooks as found

    yield found
    sys.modules.pop("notebooks", None)
