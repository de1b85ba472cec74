"""Machine code of native functions: compiled by LLVM for this processor, stored in the cache folder, loaded."""

from __future__ import annotations

import hashlib
import os
import platform
from collections.abc import Callable
from functools import cache
from pathlib import Path

import llvmlite
from llvmlite import binding

from flocking.errors import CacheError
from flocking.formula.cache import MACHINE, cache_folder, read_code, write_code
from flocking.formula.native.entries import HEAD, SUFFIX
from flocking.formula.native.one_compiler import one_compiler

_engines: list[object] = []
"""LLVM engines of the loaded code; they must last as long as the process."""


GATHERING = "llvm.masked.gather"
"""What the text of a module with gathering loads of its own contains."""

LOADS_APART = ",+prefer-no-gather" if platform.machine() in ("x86_64", "AMD64") else ""
"""Feature of LLVM with which vectors are filled by single loads."""


@cache
def processor() -> tuple[str, str]:
    """Name and features of the processor that code is compiled for.

    ``FLOCKING_CPU_NAME`` and ``FLOCKING_CPU_FEATURES`` choose another, as do ``NUMBA_CPU_NAME`` and
    ``NUMBA_CPU_FEATURES``, which clusters with several kinds of processors set for Numba.
    """
    name, features = (
        os.environ.get(f"FLOCKING_CPU_{what}") or os.environ.get(f"NUMBA_CPU_{what}") for what in ("NAME", "FEATURES")
    )
    if name is None:
        found = binding.get_host_cpu_features()
        return binding.get_host_cpu_name(), features if features is not None else found.flatten()
    return name, features or ""


def _machine(preferred: str = "") -> binding.TargetMachine:
    """A new target machine of LLVM for this processor; ``preferred`` are more features, each with a comma before it."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    name, features = processor()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=name, features=features + preferred, opt=3, reloc="pic", codemodel="jitdefault", jit=True
    )


def has_feature(name: str) -> bool:
    """Whether the processor has the feature that LLVM calls ``name``, such as ``"avx512f"``."""
    return f"+{name}" in processor()[1].split(",")


def object_code(text: str) -> bytes:
    """Machine code of a module in LLVM's assembly language."""
    # Where LLVM makes vectors by itself, several loads are faster than one gathering load on all but few processors.
    target = _machine("" if GATHERING in text else LOADS_APART)
    module = binding.parse_assembly(text)
    module.triple = binding.get_default_triple()
    module.data_layout = str(target.target_data)
    module.verify()
    tuning = binding.create_pipeline_tuning_options(speed_level=3)
    tuning.loop_vectorization = True
    builder = binding.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
    return bytes(target.emit_object(module))


def addresses_of(
    name: str,
    key: str,
    make: Callable[[], tuple[str, tuple[str, ...], tuple[str, ...]]],
    provide: Callable[[str], tuple[str, int]],
) -> tuple[int, int, tuple[str, ...]]:
    """Addresses of a compiled function and of its entry, and kinds of its results; from the cache folder if possible.

    Parameters
    ----------
    key
        What determines its code, beside the processor and the version of LLVM.
    make
        Gives the text of its module, the kinds of its results, and the references of the functions it calls.
    provide
        Gives the symbol and the address of a function by its reference.

    Raises
    ------
    CacheError
        When the cache folder cannot be used, or the code cannot be loaded.
    """
    path = _path(name, key)
    stored = read_code(path)
    if stored is None:
        with one_compiler(path):
            stored = read_code(path)
            if stored is None:
                text, results, called = make()
                stored = "\n".join((" ".join(results), "|".join(called), "")).encode() + object_code(text)
                write_code(path, stored)
    head, called_ones, code = stored.split(b"\n", 2)
    for reference in filter(None, called_ones.decode().split("|")):
        binding.add_symbol(*provide(reference))
    return *_loaded(name, code), tuple(head.decode().split())


def _path(name: str, key: str) -> Path:
    versions = ".".join(map(str, binding.llvm_version_info))
    stated = "\0".join((key, name, _translator(), str(HEAD), *processor(), versions, llvmlite.__version__))
    return cache_folder() / MACHINE / "native" / f"{hashlib.sha256(stated.encode()).hexdigest()[:32]}.o"


@cache
def _translator() -> str:
    """Digest of the modules that translate."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _loaded(name: str, code: bytes) -> tuple[int, int]:
    # An engine owns its target machine, so that each is given one of its own.
    engine = binding.create_mcjit_compiler(binding.parse_assembly(""), _machine())
    engine.add_object_file(binding.ObjectFileRef.from_data(code))
    engine.finalize_object()
    address, entry = (int(engine.get_function_address(known)) for known in (name, name + SUFFIX))
    if not address or not entry:
        raise CacheError(f"Compiled code of {name} cannot be loaded. Clear the cache folder (flocking cache --clear).")
    _engines.append(engine)
    return address, entry
