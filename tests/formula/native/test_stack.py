"""Vectors that have no register lie on the stack, which begins with a line of memory wherever a function is called."""

from __future__ import annotations

import platform

from flocking.engine.tiles.simd.vectors import load, store
from flocking.formula.native import objects
from flocking.formula.native.functions import native
from flocking.formula.native.kinds import LINE, arguments_of

ROUND_DOWN = b"\x48\x83\xe4\xc0"
"""Machine code of x86-64 that rounds the stack down to 64 bytes: ``and rsp, -64``."""


@native
def many_at_once(x, y):  # type: ignore[no-untyped-def]
    """More vectors than there are registers, all of which are needed at the end."""
    a, b, c, d = load(x, 0), load(x, 16), load(x, 32), load(x, 48)
    e, f, g, h = load(x, 64), load(x, 80), load(x, 96), load(x, 112)
    for k in range(8):
        a, b, c, d = a * b + e, b * c + f, c * d + g, d * a + h
        e, f, g, h = e * f + a, f * g + b, g * h + c, h * e + d
        store(y, 16 * k, a * b + c * d + e * f + g * h)
    store(y, 128, a + b)


def test_functions_ask_for_a_stack_that_begins_with_a_line():
    text, _, _ = many_at_once._text("many_at_once", arguments_of("f8[:], f8[:]"))
    assert f"alignstack({LINE})" in text


def test_the_machine_code_rounds_the_stack_down(monkeypatch):
    # Any processor of the family compiles for one that has vectors of 64 bytes; the code is not run.
    if platform.machine() in ("x86_64", "AMD64"):
        monkeypatch.setattr(objects, "processor", lambda: ("skylake-avx512", "+avx512f,-prefer-256-bit"))
        text, _, _ = many_at_once._text("many_at_once", arguments_of("f8[:], f8[:]"))
        assert ROUND_DOWN in objects.object_code(text)
        assert ROUND_DOWN not in objects.object_code(text.replace(f"alignstack({LINE})", ""))
