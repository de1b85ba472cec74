"""The stored summary of a large run: density maps and numbers, small enough for the library."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flocking.arrays import AnyArray
from flocking.engine.archives.archive import NPZ_ERRORS
from flocking.engine.storage.atomic_files import write_file
from flocking.errors import InvalidInput
from flocking.model.checks import Array

FACTS = "facts"
LOWEST, HIGHEST = 0.05, 20.0
"""Range of stored densities relative to the reference: 254 levels in steps of 2.4 per cent, and zero."""


@dataclass(frozen=True, eq=False)
class StoredSummary:
    """Summary of a run.

    Parameters
    ----------
    facts
        Numbers and provenance, as plain data for JSON.
    arrays
        Maps and positions, by name.
    """

    facts: dict[str, Any]
    arrays: Mapping[str, AnyArray]

    @property
    def drawable(self) -> bool:
        """Whether it contains anything to draw; a run that ended before the first view does not."""
        return bool(self.arrays)

    def write(self, path: str | Path) -> Path:
        """Write to a compressed NumPy file.

        Raises
        ------
        StorageError
            If it cannot be written.
        """
        text = json.dumps(self.facts, indent=1, allow_nan=False, sort_keys=True)
        parts: dict[str, AnyArray] = {FACTS: np.frombuffer(text.encode(), np.uint8), **self.arrays}
        file = io.BytesIO()
        np.savez_compressed(file, allow_pickle=False, **parts)
        return write_file(Path(path), file.getvalue(), "write the summary of the run")

    @classmethod
    def read(cls, path: str | Path) -> StoredSummary:
        """Read a file of `write`.

        Raises
        ------
        InvalidInput
            If there is no such file, or it has another content.
        """
        try:
            with np.load(path, allow_pickle=False) as found:
                arrays = {name: found[name] for name in found.files}
            return cls(json.loads(arrays.pop(FACTS).tobytes()), arrays)
        except (*NPZ_ERRORS, OSError, KeyError) as error:
            raise InvalidInput("showcases", "path", f"must contain the summary of a run ({error})", str(path)) from None


def packed(densities: Array) -> NDArray[np.uint8]:
    """Densities in a byte each, evenly on a logarithmic scale; 0 is less than the lowest.

    Parameters
    ----------
    densities
        Agents per area, any shape.
    """
    share = np.log(np.maximum(densities, 1e-300) / LOWEST) / np.log(HIGHEST / LOWEST)
    return np.where(share < 0, 0, 1 + np.rint(254 * np.minimum(share, 1.0))).astype(np.uint8)


def unpacked(codes: NDArray[np.uint8]) -> Array:
    """Inverse of `packed`, to about one per cent.

    Parameters
    ----------
    codes
        Bytes, any shape.
    """
    share = (codes.astype(np.float64) - 1) / 254
    return np.where(codes == 0, 0.0, LOWEST * (HIGHEST / LOWEST) ** share)
