"""Reads text files of a limited size; refuses what is not a regular file."""

from __future__ import annotations

from pathlib import Path

from flocking.engine.storage.regular_files import opened
from flocking.errors import InvalidInput


def read_text_file(owner: str, path: str | Path, largest: int, fix: str = "") -> str:
    """Text of a file, without a byte-order mark.

    Parameters
    ----------
    owner
        Name of the reader in messages.
    path
        The file.
    largest
        Largest size in bytes.
    fix
        Advice in the message on a larger one.

    Raises
    ------
    InvalidInput
        When it is not a file, cannot be read or is too large.
    UnicodeDecodeError
        When it is not UTF-8 text.
    """
    try:
        with opened(Path(path)) as stream:
            content = stream.read(largest + 1)
    except IsADirectoryError:
        raise InvalidInput(owner, "path", "cannot be read (it is a folder)", str(path), "Give a file.") from None
    except (OSError, ValueError, TypeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidInput(owner, "path", f"cannot be read ({reason})", str(path)) from None
    if len(content) > largest:
        raise InvalidInput(owner, "path", f"must be a file of at most {largest} bytes", str(path), fix)
    return content.decode("utf-8-sig")
