"""The law of Olfati-Saber (34) with JAX-MD's dense neighbour list in float32, rebuilds included, its skin tuned."""

import json
import math
import sys
import time

import jax
import jax.numpy as jnp
import numpy as np
from jax_md import partition, space

SKINS = (0.7, 1.4, 2.8)


def stepper(displacement, shift, box, radius, skin, h):
    """A step under one skin, and the list builder."""
    a, b, d = 1.0, 5.0, 7.0
    c = abs(a - b) / np.sqrt(4 * a * b)
    build = partition.neighbor_list(displacement, box, radius, dr_threshold=skin, format=partition.Dense)

    def force(q, p, neighbours):
        there = neighbours.idx < q.shape[0]
        index = jnp.minimum(neighbours.idx, q.shape[0] - 1)
        apart = jax.vmap(jax.vmap(displacement, (0, None)), (0, 0))(q[index], q)
        square = (apart**2).sum(-1)
        linked = there & (square < radius**2)
        r = jnp.sqrt(jnp.where(linked, square, 1.0))
        z = r - d + c
        slope = (a + b) / 2 * z / jnp.sqrt(1 + z * z) + (a - b) / 2
        pull = jnp.where(linked, slope / r, 0.0)[..., None] * apart
        return (pull + linked[..., None] * (p[index] - p[:, None])).sum(1)

    @jax.jit
    def step(q, p, neighbours):
        neighbours = neighbours.update(q)
        p = p + h * force(q, p, neighbours)
        return shift(q, h * p), p, neighbours

    return build, step


def timed(build, step, q, p, steps):
    """Seconds per step, and whether a list overflowed (its result would then be wrong)."""
    neighbours = build.allocate(q, extra_capacity=2)
    q, p, neighbours = step(q, p, neighbours)
    q.block_until_ready()
    begin = time.perf_counter()
    for _ in range(steps):
        q, p, neighbours = step(q, p, neighbours)
    q.block_until_ready()
    return (time.perf_counter() - begin) / steps, bool(neighbours.did_buffer_overflow)


def main():
    payload, state = json.loads(sys.argv[1]), np.load(sys.argv[2])
    radius, h = 8.4, payload["step"]
    q = state["q"] - state["q"].min(axis=0) + 2 * radius
    # A periodic box with a gap around the flock stands for the open plane, which its cell list does not know.
    box = q.max(axis=0) + 2 * radius
    displacement, shift = space.periodic(box)
    q, p = jnp.array(q, jnp.float32), jnp.array(state["p"], jnp.float32)
    best = (math.inf, None, None)
    for skin in SKINS:
        build, step = stepper(displacement, shift, box, radius, skin, h)
        seconds, overflow = timed(build, step, q, p, 20)
        if not overflow and seconds < best[0]:
            best = (seconds, skin, (build, step))
    seconds, overflow = timed(*best[2], q, p, payload["steps"])
    answer = {"M/s": len(q) / seconds / 1e6, "skin": best[1], "steps": payload["steps"], "overflow": overflow}
    print(json.dumps(answer | {"version": jax.__version__}))


main()
