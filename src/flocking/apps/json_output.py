"""Results as JSON on standard output."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping


def print_json(data: object) -> None:
    """Print plain ``data`` as JSON; numbers that are not finite are null, as JSON has none."""
    print(json.dumps(_finite(data), indent=2, allow_nan=False, ensure_ascii=False))


def _finite(data: object) -> object:
    if isinstance(data, float) and not math.isfinite(data):
        return None
    if isinstance(data, Mapping):
        return {name: _finite(value) for name, value in data.items()}
    return [_finite(value) for value in data] if isinstance(data, list | tuple) else data
