"""Checkpoints of runs on ranks that somebody else has written: refused in a sentence, or gone on with."""

from __future__ import annotations

import numpy as np
import pytest

import flocking as fk
from flocking.engine.driver.checkpoint import pack
from flocking.errors import FlockingError, StorageError
from tests.counting import count
from tests.engine.storage.crafted import changed, contents, scenario, written
from tests.engine.storage.stored_runs import unpack
from tests.engine.storage.test_crafted_checkpoints import WHERE
from tests.fuzz.guard import interrupted_after

pytestmark = pytest.mark.mpi


@pytest.mark.parametrize("world", ["tiles", "held tiles"])
def test_crafted_checkpoints_on_ranks(world: str) -> None:
    """Whatever is changed, going on works or is refused in one sentence."""
    made = scenario(world)
    session = fk.start(made, engine="lammps")
    session.advance(0.25)
    data, run, said = pack(session), session.run("unfinished"), []

    def go_on(bytes_of_it: bytes) -> None:
        again = unpack(bytes_of_it, run, None, WHERE, name="lammps")

        def advance() -> None:
            try:
                again.advance(min(made.t_end, again.time + 0.06))
            except StorageError:
                raise
            except FlockingError:
                pass

        interrupted_after(0.3, advance)

    go_on(data)
    go_on(written(*contents(data)))
    numbers, arrays = contents(data)
    shapeless = written(numbers, {name: np.zeros((40, 40)) for name in arrays})
    with pytest.raises(StorageError, match="not a checkpoint from which this version can continue"):
        go_on(shapeless)
    for seed in range(1000, 1100):
        wrong, what = changed(data, seed)
        try:
            go_on(wrong)
        except StorageError as error:
            said.append(str(error))
        except Exception as error:
            raise AssertionError(f"{world}, seed {seed}: {what}: {error!r}") from error
        count("runs on disk: crafted checkpoints (ranks)")
    assert len(said) > 50
    assert all(20 < len(text) < 400 for text in said)
