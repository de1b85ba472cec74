"""Results as JSON on standard output."""

from __future__ import annotations

import json


def print_json(data: object) -> None:
    """Print plain ``data`` as JSON; numbers that are not finite are refused, as JSON has none."""
    print(json.dumps(data, indent=2, allow_nan=False, ensure_ascii=False))
