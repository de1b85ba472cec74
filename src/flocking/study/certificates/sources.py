"""Theorems behind the certificates, and where they are stated; `sources.toml` holds the texts."""

from __future__ import annotations

from functools import cache
from importlib.resources import files


@cache
def sources() -> dict[str, str]:
    """Texts of all theorems by key."""
    import tomllib

    return tomllib.loads(files(__package__).joinpath("sources.toml").read_text(encoding="utf-8"))
