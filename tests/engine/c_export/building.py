"""Exported laws, compiled and called on this machine."""

from __future__ import annotations

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

from flocking.engine.c_export.export import c_files
from flocking.engine.c_export.header import STATUS, words

COMPILER = shutil.which("gcc") or shutil.which("cc")
FLAGS = [
    "-std=c99", "-O1", "-ffp-contract=off", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wshadow", "-Wconversion",
    "-Wdouble-promotion", "-shared", "-fPIC",
]  # fmt: skip
CODES = {name: k for k, (name, _) in enumerate(STATUS)}

needs_compiler = pytest.mark.compiler


def shared_object(folder, sources):
    """A shared object of C sources, with every warning an error."""
    for name, text in sources.items():
        (folder / name).write_text(text)
    c = [str(folder / name) for name in sources if name.endswith(".c") and name != "main.c"]
    subprocess.run([COMPILER, *FLAGS, "-o", str(folder / "law.so"), *c], check=True, cwd=folder)
    return ctypes.CDLL(str(folder / "law.so"))


def structures(n, m, slots, graphs, real, form=None, *, along=()):
    """The structures of the header, with those of a form of the safety filter, and of views along what turns."""
    normals = [("normals", (real * m) * slots)] if form == "sampled" else []
    said = [("filtered", ctypes.c_uint8), ("relaxed", ctypes.c_uint8)] if form else []

    class Message(ctypes.Structure):
        _fields_ = [("stamp", ctypes.c_int64), ("number", ctypes.c_int32), ("sender", ctypes.c_uint16),
                    ("q", real * m), ("p", real * m)]  # fmt: skip

    class Memory(ctypes.Structure):
        _fields_ = [("known", Message * slots), *normals, ("time", ctypes.c_int64),
                    ("links", (ctypes.c_uint32 * words(slots)) * graphs), ("used", ctypes.c_uint32 * words(slots)),
                    ("lost", ctypes.c_uint32), ("q", real * m), *[(name, real * m) for name in along],
                    ("order", ctypes.c_uint16 * slots),
                    ("count", ctypes.c_uint16), ("agent", ctypes.c_uint16), ("begun", ctypes.c_uint8),
                    ("saturated", ctypes.c_uint8), *said]  # fmt: skip

    return Message, Memory


def form_of(scenario):
    """Form of the safety filter; None where there is none."""
    return getattr(scenario.control, "form", None)


class CompiledLaw:
    """An exported law on this machine; `change` says which texts of its source are replaced by which."""

    def __init__(self, folder, scenario, *, float32=False, neighbours=None, limit=None, change=(), along=()):
        self.files = c_files(scenario, float32=float32, neighbours=neighbours, limit=limit)
        for old, new in change:
            assert old in self.files["law.c"]
            self.files["law.c"] = self.files["law.c"].replace(old, new)
        self.library = shared_object(folder, self.files)
        self.n, self.m = scenario.start.n, scenario.start.dimension
        self.real = ctypes.c_float if float32 else ctypes.c_double
        self.kind = np.float32 if float32 else np.float64
        self.slots = max(self.n - 1, 1) if neighbours is None else neighbours
        self.Message, self.Memory = structures(self.n, self.m, self.slots, len(scenario.law.graphs), self.real,
                                                 form_of(scenario), along=along)  # fmt: skip
        self.vector = self.real * self.m

    def begin(self, agent):
        memory = self.Memory()
        assert self.library.law_begin(ctypes.byref(memory), ctypes.c_uint16(agent)) == CODES["OK"]
        return memory

    def receive(self, memory, sender, q, p, *, number=0, stamp=0, now=None):
        message = self.Message(stamp, number, sender, self.vector(*q), self.vector(*p))
        now = ctypes.c_int64(stamp if now is None else now)
        return self.library.law_receive(ctypes.byref(memory), now, ctypes.byref(message))

    def start(self, memory, q, now=0, p=None, heading=None):
        along = [self.vector(*x) for x in (p, heading) if x is not None]
        return self.library.law_start(ctypes.byref(memory), ctypes.c_int64(now), self.vector(*q), *along)

    def control(self, memory, q, p, now=0, heading=None):
        u, own = self.vector(), [self.vector(*x) for x in (q, p, heading) if x is not None]
        code = self.library.law_control(ctypes.byref(memory), ctypes.c_int64(now), *own, u)
        return code, np.array(u[:], dtype=self.kind)

    def velocity(self, agent, p, u):
        """Code and velocity that is set."""
        v = self.vector()
        code = self.library.law_velocity(ctypes.byref(self.begin(agent)), self.vector(*p), self.vector(*u), v)
        return code, np.array(v[:], dtype=self.kind)

    def links(self, memory, graph=0):
        """Agents that are linked."""
        slots = memory.order[: memory.count]
        return [memory.known[s].sender for s in slots if memory.links[graph][s // 32] >> (s % 32) & 1]

    def force(self, agent, q, p, others, now=0, heading=None):
        """Force at a start, from what is known of others."""
        memory = self.begin(agent)
        for j, (x, v) in others.items():
            assert self.receive(memory, j, x, v, stamp=now) == CODES["OK"]
        code, u = self.control(memory, q, p, now, heading)
        return code, u, memory
