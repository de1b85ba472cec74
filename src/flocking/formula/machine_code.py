"""Numba, with its machine code kept in this library's own cache folder, sealed as everything there.

Numba keeps machine code beside the source or in the user's folder for it, and unpickles what it finds there. Modules
of this library take ``numba`` from here, so that theirs, and the code they generate, goes to `cache.cache_folder`.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numba as numba
from numba.core import caching

from flocking.formula.cache import GENERATED, MACHINE, NOWHERE, cache_folder, is_sealed, sealing

PACKAGE = Path(__file__).resolve().parent.parent


class Locator(caching._SourceFileBackedLocatorMixin, caching._CacheLocator):  # type: ignore[misc]
    """Where machine code of this library's functions is kept: for functions of others it has no answer.

    Parameters
    ----------
    py_func
        The function.
    py_file
        File that it was written in.
    """

    def __init__(self, py_func: Any, py_file: str) -> None:
        self._py_file = py_file
        self._lineno = py_func.__code__.co_firstlineno
        home = os.path.dirname(os.path.abspath(py_file))
        if not Path(py_file).name.startswith(GENERATED):
            home = f"{Path(home).name}_{hashlib.sha256(home.encode()).hexdigest()[:16]}"
        else:
            home = "generated"
        self._folder = cache_folder() / MACHINE / home

    def get_cache_path(self) -> str:
        """Folder of the machine code."""
        return str(self._folder)

    def ensure_cache_path(self) -> None:
        """Files make their folder when they are written."""

    def get_source_stamp(self) -> Any:
        """What tells versions of the source apart; a generated one that is not kept has one version."""
        return None if Path(self._py_file).is_relative_to(NOWHERE) else super().get_source_stamp()

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Locator | None:
        """A locator for a function of this library, or None.

        Parameters
        ----------
        py_func
            The function.
        py_file
            File that it was written in.
        """
        path = Path(py_file)
        ours = path.name.startswith(GENERATED) or PACKAGE in path.resolve().parents
        return cls(py_func, py_file) if ours and (path.exists() or path.is_relative_to(NOWHERE)) else None


_File = caching.IndexDataCacheFile


class SealedFile(_File):  # type: ignore[misc,valid-type]
    """Machine code that is read only where it is as it was written, and nobody else may write it."""

    def _load_index(self) -> dict[Any, Any]:
        return dict(super()._load_index()) if is_sealed(Path(self._index_path)) else {}

    def _load_data(self, name: str) -> Any:
        if not is_sealed(Path(self._data_path(name))):
            raise FileNotFoundError(name)
        return super()._load_data(name)

    @contextmanager
    def _open_for_write(self, filepath: str) -> Iterator[Any]:
        with sealing(Path(filepath)) as file:
            yield file


def _file(cache_path: str, filename_base: str, source_stamp: Any) -> Any:
    """Sealed files for this library's functions, Numba's own for those of others."""
    ours = MACHINE in Path(cache_path).parts and Path(cache_path).parent == cache_folder() / MACHINE
    return (SealedFile if ours else _File)(cache_path, filename_base, source_stamp)


if Locator not in caching.CacheImpl._locator_classes:
    caching.CacheImpl._locator_classes.insert(0, Locator)
    caching.IndexDataCacheFile = _file
