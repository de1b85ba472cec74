"""Machine code of native functions: made by LLVM for this processor, kept in the cache folder, loaded and called."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path

import llvmlite
from llvmlite import binding

from flocking.errors import CacheError
from flocking.formula.cache import MACHINE, cache_folder, read_sealed, sealing
from flocking.formula.native.entries import HEAD, SUFFIX

_engines: list[object] = []
"""What holds the loaded code, which functions of it need as long as the process lives."""


@cache
def processor() -> tuple[str, str]:
    """Name and features of the processor that code is made for.

    ``FLOCKING_CPU_NAME`` and ``FLOCKING_CPU_FEATURES`` choose another, as do ``NUMBA_CPU_NAME`` and ``_FEATURES``, by
    which clusters of unlike processors are told apart for Numba.
    """
    name, features = (
        os.environ.get(f"FLOCKING_CPU_{what}") or os.environ.get(f"NUMBA_CPU_{what}") for what in ("NAME", "FEATURES")
    )
    if name is None:
        found = binding.get_host_cpu_features()
        return binding.get_host_cpu_name(), features if features is not None else found.flatten()
    return name, features or ""


def _machine() -> binding.TargetMachine:
    """A new target machine of LLVM for this processor."""
    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    name, features = processor()
    return binding.Target.from_default_triple().create_target_machine(
        cpu=name, features=features, opt=3, reloc="pic", codemodel="jitdefault", jit=True
    )


def has_feature(name: str) -> bool:
    """Whether the processor has a feature, such as ``"avx512f"``."""
    return f"+{name}" in processor()[1].split(",")


def object_code(text: str) -> bytes:
    """Machine code of an LLVM module."""
    target = _machine()
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
    """Addresses of a compiled function and of its entry, and kinds of its results.

    They are from the cache folder where they are there and whole.

    Parameters
    ----------
    key
        What fixes its code, beside the processor and the version of LLVM.
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
    kept = read_sealed(path)
    if kept is None:
        text, results, called = make()
        kept = "\n".join((" ".join(results), "|".join(called), "")).encode() + object_code(text)
        with sealing(path) as file:
            file.write(kept)
    head, called_ones, code = kept.split(b"\n", 2)
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
