"""Results as JSON on standard output."""

from __future__ import annotations

import codecs
import json
import math
import sys
from collections.abc import Mapping


def print_json(data: object) -> None:
    """Print plain ``data`` as JSON; numbers that are not finite are null, as JSON has none.

    JSON is UTF-8. Where the output has another encoding, what is not ASCII is written as JSON's escapes.
    """
    print(json.dumps(_finite(data), indent=2, allow_nan=False, ensure_ascii=not _is_utf8(), default=str))


def _is_utf8() -> bool:
    """Whether standard output is UTF-8; a stream without an encoding keeps the text as it is."""
    encoding = getattr(sys.stdout, "encoding", None)
    try:
        return encoding is None or codecs.lookup(encoding).name == "utf-8"
    except LookupError:
        return False


def _finite(data: object) -> object:
    if isinstance(data, float) and not math.isfinite(data):
        return None
    if isinstance(data, Mapping):
        return {name: _finite(value) for name, value in data.items()}
    return [_finite(value) for value in data] if isinstance(data, list | tuple) else data
