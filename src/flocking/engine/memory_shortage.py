"""Recognises errors of any type that mean lack of memory."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterator

LEAST_ADDRESS_SPACE = 800 * 2**20
"""Bytes of address space that the library and its dependencies need to start."""

_WORDS = re.compile("can't start new thread|failed to map segment|[Cc]annot allocate memory")


def starved(error: BaseException) -> bool:
    """Whether an ``error`` or one of its causes is lack of memory."""
    return any(
        isinstance(x, MemoryError) or (isinstance(x, OSError) and x.errno == errno.ENOMEM) or _WORDS.search(str(x))
        for x in causes(error)
    )


def causes(error: BaseException | None) -> Iterator[BaseException]:
    """An ``error`` and its causes."""
    while error is not None:
        yield error
        error = error.__cause__ or error.__context__


def address_space() -> int | None:
    """Bytes of address space that this process may take (``ulimit -v``); None where there is no limit."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else int(limit)
