"""Exported laws on a Cortex-M4F: compiled by Zig's C compiler, run by an emulator of the processor."""

from __future__ import annotations

import ctypes
import struct
import subprocess
import sys

import numpy as np

from flocking.engine.c_export.export import c_files
from tests.engine.c_export.building import form_of, structures

FLAGS = [
    "-std=c99", "-target", "thumb-freestanding-eabihf", "-mcpu=cortex_m4+vfp4d16sp", "-O2", "-ffreestanding",
    "-nostdlib", "-ffp-contract=off", "-fno-sanitize=all", "-Wall", "-Wextra", "-Werror",
]  # fmt: skip
LAYOUT = """
ENTRY(law_begin)
SECTIONS
{
    . = 0x10000;
    .text : { KEEP(*(.text*)) }
    .rodata : { KEEP(*(.rodata*)) }
    .data : { *(.data*) *(.bss*) }
}
"""
DATA, STACK, STOP = 0x20000000, 0x20080000, 0x08000000
PLACES = {"message": DATA + 0x60000, "q": DATA + 0x61000, "p": DATA + 0x61100, "u": DATA + 0x61200}


class Emulated:
    """An exported law of single precision in an emulator.

    Attributes
    ----------
    instructions
        Instructions of the last call.
    """

    def __init__(self, folder, scenario, *, neighbours=None, limit=None):
        import unicorn
        from unicorn import arm_const

        files = c_files(scenario, float32=True, neighbours=neighbours, limit=limit)
        for name, text in files.items():
            (folder / name).write_text(text)
        image = folder / "law.elf"
        (folder / "layout.ld").write_text(LAYOUT)
        place = f"-Wl,-T,{folder / 'layout.ld'}"
        command = [sys.executable, "-m", "ziglang", "cc", *FLAGS, place, "-o", str(image), str(folder / "law.c")]
        subprocess.run(command, check=True, cwd=folder)
        self.arm, self.emulator = (
            arm_const,
            unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS),
        )
        self.emulator.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        self.m, n = scenario.start.dimension, scenario.start.n
        self.slots = max(n - 1, 1) if neighbours is None else neighbours
        self.Message, self.Memory = structures(n, self.m, self.slots, len(scenario.law.graphs), ctypes.c_float,
                                                 form_of(scenario))  # fmt: skip
        self._load(image.read_bytes())
        for base, size in ((DATA, 0x100000), (STOP, 0x1000), (0xE0000000, 0x100000)):
            self.emulator.mem_map(base, size)
        # The processor's switch of its unit for floating point.
        self.emulator.mem_write(0xE000ED88, struct.pack("<I", 0xF << 20))
        self.emulator.hook_add(unicorn.UC_HOOK_CODE, self._count)
        self.instructions = 0

    def _count(self, *_):
        self.instructions += 1

    def _load(self, image):
        """Map the segments of an ELF file of 32 bits, and read its symbols."""
        program, sections = struct.unpack_from("<II", image, 28)
        per_program, programs, per_section, count = struct.unpack_from("<HHHH", image, 42)
        pages = set()
        for k in range(programs):
            kind, offset, place, _, size, memory = struct.unpack_from("<6I", image, program + k * per_program)
            if kind != 1 or not memory:
                continue
            for page in range(place & ~0xFFF, place + memory, 0x1000):
                if page not in pages:
                    self.emulator.mem_map(page, 0x1000)
                    pages.add(page)
            self.emulator.mem_write(place, image[offset : offset + size])
        headers = [struct.unpack_from("<10I", image, sections + k * per_section) for k in range(count)]
        self.symbols = {}
        for header in headers:
            if header[1] == 2:
                names = headers[header[6]]
                for k in range(header[5] // 16):
                    name, value = struct.unpack_from("<II", image, header[4] + 16 * k)
                    begin = names[4] + name
                    self.symbols[image[begin : image.index(b"\0", begin)].decode()] = value

    def call(self, name, *arguments):
        """Call a function with whole numbers of 32 bits: the first four in registers, the others on the stack."""
        arm, registers, stack = self.arm, arguments[:4], arguments[4:]
        top = STACK - 8 * ((4 * len(stack) + 7) // 8)
        self.emulator.mem_write(top, struct.pack(f"<{len(stack)}I", *stack))
        for k, value in enumerate(registers):
            self.emulator.reg_write(getattr(arm, f"UC_ARM_REG_R{k}"), value)
        self.emulator.reg_write(arm.UC_ARM_REG_SP, top)
        self.emulator.reg_write(arm.UC_ARM_REG_LR, STOP | 1)
        self.instructions = 0
        self.emulator.emu_start(self.symbols[name] | 1, STOP, count=10**7)
        assert self.emulator.reg_read(arm.UC_ARM_REG_PC) & ~1 == STOP
        return self.emulator.reg_read(arm.UC_ARM_REG_R0)

    # The interface of `CompiledLaw`; the memory lies in the emulator.

    def begin(self, agent):
        assert self.call("law_begin", DATA, agent) == 0
        return None

    def receive(self, memory, sender, q, p, *, number=0, stamp=0, now=None):
        vector = ctypes.c_float * self.m
        message = bytes(self.Message(stamp, number, sender, vector(*q), vector(*p)))
        self.emulator.mem_write(PLACES["message"], message)
        now = stamp if now is None else now
        # A number of 64 bits goes into an even register and the next.
        return self.call("law_receive", DATA, 0, now & 0xFFFFFFFF, now >> 32, PLACES["message"])

    def control(self, memory, q, p, now=0):
        for name, values in (("q", q), ("p", p)):
            self.emulator.mem_write(PLACES[name], np.asarray(values, np.float32).tobytes())
        places = [PLACES[name] for name in ("q", "p", "u")]
        code = self.call("law_control", DATA, 0, now & 0xFFFFFFFF, now >> 32, *places)
        return code, np.frombuffer(bytes(self.emulator.mem_read(PLACES["u"], 4 * self.m)), np.float32)

    def links(self, memory, graph=0):
        found = self.Memory.from_buffer_copy(bytes(self.emulator.mem_read(DATA, ctypes.sizeof(self.Memory))))
        slots = found.order[: found.count]
        return [found.known[s].sender for s in slots if found.links[graph][s // 32] >> (s % 32) & 1]
