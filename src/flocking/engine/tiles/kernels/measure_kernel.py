"""The kernel that takes samples: true states with drawn errors, rounded, sixteen agents at a time.

Errors are those of `flocking.model.world.noises`: the same draws, with logarithms and waves of vectors, which differ
from those of the mathematics library by a few units in the last place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import ModuleType

from flocking.engine.kernels.source_text import indented
from flocking.engine.tiles.simd import elementary_functions as vector_math
from flocking.formula.compiled import generated_module
from flocking.model.world.random_numbers import PURPOSE_SHIFT, Purpose


@dataclass(frozen=True)
class MeasureKind:
    """What determines the source of the kernel.

    Parameters
    ----------
    dimension
        2 or 3.
    noise
        Whether samples have errors.
    correlated
        Whether the errors of an agent depend on those of its sample before.
    rounded
        Whether positions and velocities are rounded.
    precision
        That of the state; errors are drawn in double precision.
    """

    dimension: int
    noise: bool
    correlated: bool
    rounded: tuple[bool, bool]
    precision: str


def measure_kernel(kind: MeasureKind) -> ModuleType:
    """Module with the kernel ``measure``.

    Its arguments: ``first_tile``, ``last_tile``; ``due``, 1 for each agent that takes a sample and 0 for the others,
    shape (size,); the state ``X``, shape (size, 2m); the ``target`` of the same shape; the identities ``ids``; the
    ``numbers`` of the samples from 0, uint64, shape (size,) or (1,); the ``errors``, shape (2m, size), of which those
    of the agents with memory go on; their ``memory``, shape (size,) or (1,); ``sizes``: standard deviations of
    positions and velocities, and what these are rounded to; the words of the seed; and ``off``, which takes the
    largest squared deviation of a position and of a velocity by tile, shape (tiles, 2).
    """
    return generated_module(("measure", kind), (), (), lambda: (), lambda _: _source(kind))


def _source(kind: MeasureKind) -> str:
    axes = range(kind.dimension)
    own = [f"{letter}{k}" for letter in "qp" for k in axes]
    lines = [
        "base = tile * 16", "off[tile, 0], off[tile, 1] = 0.0, 0.0", "busy = load(due, base)",
        "if highest(busy) == 0:", "    continue", "hold = busy == np.uint32(0)",
        f"{', '.join(own)} = load_agents(X, base)",
        f"{', '.join('was_' + x for x in own)} = load_agents(target, base)",
    ]  # fmt: skip
    if kind.noise:
        lines += ["agent = widen(load(ids, base))", "zero = agent & np.uint64(0)"]
        lines += ["number = zero + (load(numbers, base) if numbers.shape[0] > 1 else spread(numbers[0]))"]
        if kind.correlated:
            lines += ["correlation = load(memory, base) if memory.shape[0] > 1 else spread(memory[0])"]
            lines += [
                "correlation = select(number == np.uint64(0), spread(0.0), correlation)",
                "new = root(1.0 - correlation * correlation)",
            ]
        word = int(Purpose.NOISE) << PURPOSE_SHIFT
        for k in axes:
            words = f"number, np.uint64({word}), agent, zero + np.uint64({k}), np.uint64(key), np.uint64(key2)"
            lines += [
                f"a, b, c, d = philox_words({words})",
                "radius = root(-2.0 * fast_log(open_unit(a, b)))", f"angle = {2.0 * math.pi!r} * open_unit(c, d)",
                f"e{k}, e{kind.dimension + k} = radius * fast_cos(angle), radius * fast_sin(angle)",
            ]  # fmt: skip
        for k in range(2 * kind.dimension):
            if kind.correlated:
                lines += [f"e{k} = correlation * load(errors[{k}], base) + new * e{k}"]
                lines += [f"store(errors[{k}], base, select(hold, load(errors[{k}], base), e{k}))"]
    for part, letter in enumerate("qp"):
        squares = []
        for k in axes:
            name = f"{letter}{k}"
            lines += [f"t_{name} = double_of({name})", f"m_{name} = t_{name}"]
            if kind.noise:
                lines += [f"m_{name} = m_{name} + sizes[{part}] * e{part * kind.dimension + k}"]
            if kind.rounded[part]:
                lines += [f"m_{name} = nearest_of(m_{name} / sizes[{2 + part}]) * sizes[{2 + part}]"]
            squares.append(f"(m_{name} - t_{name}) * (m_{name} - t_{name})")
        if kind.noise or kind.rounded[part]:
            lines += [f"square = {' + '.join(squares)}"]
            lines += [f"off[tile, {part}] = highest(select(hold, square * 0.0, square))"]
    found = ", ".join(f"select(hold, was_{x}, narrow(m_{x}, np.{kind.precision}(0.0)))" for x in own)
    lines += [f"store_agents(target, base, ({found}))"]
    arguments = "first_tile, last_tile, due, X, target, ids, numbers, errors, memory, sizes, key, key2, off"
    text = f"@native\ndef measure({arguments}):\n" + indented(["for tile in range(first_tile, last_tile):"], 1)
    text += indented(lines, 2)
    header = "import numpy as np\n\n"
    header += "from flocking.engine.tiles.simd.counter_random import open_unit, philox_words\n"
    header += "from flocking.engine.tiles.simd.row_transposition import LOADERS, STORERS\n"
    header += "from flocking.engine.tiles.simd.reductions import highest\n"
    header += "from flocking.engine.tiles.simd.vectors import (\n    double_of, float_bits, float_of, float_of_bits, "
    header += "floor_of, integer_of, load, narrow, nearest_of, root, select, spread, store, widen,\n)\n"
    header += "from flocking.formula.native.functions import native\n\nT = np.float64\n"
    columns = 2 * kind.dimension
    header += f"load_agents = LOADERS[{columns}]\nstore_agents = STORERS[{columns}]\n\n\n"
    names = {"fast_log", "fast_cos", "fast_sin"} if kind.noise else set()
    return header + vector_math.source(names, double=True) + text
