"""Compiled functions that run without numba: their machine code is kept as object files.

numba takes a second to import, and 20 µs to take in the arrays of a call. So a function of addresses and counts is
compiled by numba once, linked with all that it calls, and its machine code written to a file. Later processes load
the file with LLVM alone (`llvmlite`), which takes milliseconds, and call it through ctypes. Where the file is
missing, is damaged, or belongs to another kind of processor, the function is compiled again.

Such a function must not allocate and must not raise: the only symbols that it may need from outside are those of
the C library's mathematics (ALLOWED). Others are refused when it is compiled. So its callers bring the memory that
it works in. Its own sums, and those of the formulas that it calls, are not reordered; those of the compiled
functions that it calls are. Large loops of the simulator, which are called by a symbol, must be `copied` for that.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from ctypes import CFUNCTYPE, c_int64, c_void_p
from functools import cache, cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from sim.compiling import folder_of_package, package_root

ALLOWED = {
    *("asin", "acos", "atan", "atan2", "asinh", "acosh", "atanh", "cbrt", "ceil", "copysign", "cos", "cosh"),
    *("erf", "exp", "exp2", "expm1", "fabs", "floor", "fma", "fmax", "fmin", "fmod", "hypot", "ldexp"),
    *("log", "log10", "log1p", "log2", "memcpy", "memmove", "memset", "pow", "rint", "round", "sin", "sinh"),
    *("sqrt", "tan", "tanh", "trunc"),
}
_LEVEL = 3  # of LLVM's optimisation of the linked code: these functions are small
_DIGEST = 32  # bytes at the start of a file
_engines: list[Any] = []  # hold the machine code of this process

FLOATS, INTEGERS, COUNT = "floats", "integers", "count"  # kinds of arguments: two addresses, and a number


class Kept:
    """A compiled function whose machine code is kept; arguments are arrays, addresses or counts."""

    def __init__(self, function: Callable[..., None], kinds: tuple[str, ...]):
        self.py_func, self.kinds = function, kinds
        self.__doc__ = function.__doc__

    def __call__(self, *arguments: Any) -> None:
        """Call it with arrays (C order, of float64 or int64) and counts."""
        self.call(*[_address(a, kind) if isinstance(a, np.ndarray) else a
                    for a, kind in zip(arguments, self.kinds, strict=True)])  # fmt: skip

    @property
    def name(self) -> str:
        """Module and name."""
        return f"{self.py_func.__module__}.{self.py_func.__name__}"

    @cached_property
    def path(self) -> Path:
        """The file of the machine code, for the processor of this process."""
        folder = folder_of_package(package_root(Path(self.py_func.__code__.co_filename)))
        return folder / f"{self.name}-{_machine()}.o"

    @cached_property
    def call(self) -> Callable[..., None]:
        """What ctypes calls with addresses and counts, without holding the interpreter's lock."""
        code = _read(self.path)
        if code is None:
            code = object_code(self)
            _write(self.path, code)
        arguments = [c_int64 if kind == COUNT else c_void_p for kind in self.kinds]
        return CFUNCTYPE(None, *arguments)(_loaded(code, self.name))


def kept(*kinds: str) -> Callable[[Callable[..., None]], Kept]:
    """Decorate a function of addresses and counts, of these kinds, that returns nothing."""
    return lambda function: Kept(function, kinds)


def array_at(address: Any, shape: Any) -> Any:
    """Return the array of a shape at an address; for the code of a kept function."""
    raise TypeError("array_at is for kept functions alone")


@cache
def _teach_array_at() -> None:
    from numba.extending import overload
    from numba.np.numpy_support import carray

    overload(array_at)(lambda address, shape: lambda address, shape: carray(address, shape))


def object_code(function: Kept) -> bytes:
    """Compile a function with numba, and return the machine code of it and of all that it calls.

    Raises:
        TypeError: it needs symbols that are not ALLOWED.
    """
    import llvmlite.binding as llvm
    from numba import cfunc, types

    from sim.machine_code import compiler_settings

    _teach_array_at()
    pointer: Any = types.CPointer
    kinds = {FLOATS: pointer(types.float64), INTEGERS: pointer(types.int64), COUNT: types.int64}
    signature = types.void(*[kinds[kind] for kind in function.kinds])
    with compiler_settings():
        compiler: Any = cfunc
        called = compiler(signature, nopython=True, error_model="numpy")(function.py_func)
    module = called._library._final_module.clone()
    for part in [*module.functions, *module.global_variables]:
        if part.name == called._wrapper_name:
            part.name = function.name
        elif not part.is_declaration:
            part.linkage = "internal"
    target = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(),
        opt=_LEVEL, reloc="pic", codemodel="jitdefault", jit=True,
    )  # fmt: skip
    tuning = llvm.create_pipeline_tuning_options(speed_level=_LEVEL)
    tuning.loop_vectorization = tuning.slp_vectorization = True
    passes = llvm.create_pass_builder(target, tuning)
    passes.getModulePassManager().run(module, passes)
    needed = {part.name for part in [*module.functions, *module.global_variables] if part.is_declaration}
    needed = {name for name in needed if not name.startswith("llvm.")}
    if needed - ALLOWED:
        others = ", ".join(sorted(needed - ALLOWED))
        raise TypeError(f"{function.name} needs {others}; a kept function may neither allocate nor raise")
    return bytes(target.emit_object(module))


@cache
def _machine() -> str:
    """Return twelve characters for the kind of processor and the version of LLVM."""
    import llvmlite
    import llvmlite.binding as llvm

    words = llvmlite.__version__, llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    return sha256(repr(words).encode()).hexdigest()[:12]


def _address(array: Any, kind: str) -> int:
    """Return where the numbers of an array begin."""
    wanted = np.float64 if kind == FLOATS else np.int64
    if array.dtype != wanted or not array.flags.c_contiguous:
        raise TypeError(f"an array of {array.dtype}, or not in C order, where {kind} are needed")
    return int(array.ctypes.data)


def _read(path: Path) -> bytes | None:
    """Return the machine code in a file; None if there is none, or if it is damaged."""
    try:
        data = path.read_bytes()
    except OSError:
        return None
    code = data[_DIGEST:]
    return code if sha256(code).digest() == data[:_DIGEST] else None


def _write(path: Path, code: bytes) -> None:
    """Write machine code to a file, completely or not at all. Without a place to write, each process compiles."""
    part = path.with_suffix(f".part-{os.getpid()}")
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_bytes(sha256(code).digest() + code)
        part.replace(path)
    with suppress(OSError):
        part.unlink(missing_ok=True)


def _loaded(code: bytes, name: str) -> int:
    """Load machine code; return the address of a function."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    target = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(jit=True)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _engines.append(engine)
    return int(engine.get_function_address(name))
