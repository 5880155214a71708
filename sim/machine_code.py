"""What `sim.compiling` needs numba for: the cache of a compiled function, its progress bar, and its options.

This module is imported on the first call of a compiled function. A compiled function that calls another one sees
the other's dispatcher. The functions that are inlined (`sim.compiling.formula`) are made known to numba before
a function is compiled.
"""

from __future__ import annotations

import errno
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

from numba import config, njit
from numba.core import event, types
from numba.core.caching import _CacheLocator
from numba.extending import register_jitable, typeof_impl
from tqdm import tqdm

from sim import compiling, lane_code  # noqa: F401  (it teaches numba)
from sim.called_code import LoopCache, LoopCompiler
from sim.compiling import Loop, folder_of_package, package_root, take_formulas

if config.DISABLE_JIT:  # type: ignore[attr-defined]
    raise OSError(errno.ENOTSUP, "it is set, and the loops need numba's compiler; unset it", "NUMBA_DISABLE_JIT")

_HERE = Path(__file__).parent
_LEVEL = 1  # of optimisation: loops run as fast as at level 3 and compile in less than half the time
MATHEMATICS = {"contract", "reassoc", "nsz", "arcp"}  # what may be done to sums and products
_modules: set[str] = set()  # with compiled loops


class Locator(_CacheLocator):
    """Tells numba in which of our folders a loop is kept. The folder's name says which code it belongs to."""

    def __init__(self, module: str, file: Path):
        self._module = module
        self._folder = compiling.CACHE if file.is_relative_to(_HERE) else folder_of_package(package_root(file))

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> Self:
        """Return the locator of a function."""
        return cls(py_func.__module__, Path(py_file))

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return the same stamp always: other code has another folder."""
        return ""

    def get_disambiguator(self) -> str:
        """Return the module's name, since two modules may have functions of one name."""
        return self._module


class _Progress(event.Listener):
    """A line on stderr while numba compiles loops of this package; it appears after a second."""

    def __init__(self) -> None:
        self._depth = 0
        self._bar: tqdm[Any] | None = None

    def on_start(self, event: Any) -> None:
        """A loop, or one that it calls, begins to compile."""
        if _is_ours(event):
            self._depth += 1
            if self._bar is None:
                self._bar = tqdm(
                    desc="compiling loops for first use",
                    bar_format="{desc}: {n_fmt} done in {elapsed} min",
                    delay=1.0,
                    leave=False,
                )

    def on_end(self, event: Any) -> None:
        """A loop has been compiled."""
        if _is_ours(event) and self._bar is not None:
            self._depth -= 1
            self._bar.update()
            if self._depth == 0:
                self._bar.close()
                self._bar = None


def _is_ours(event: Any) -> bool:
    return event.data["dispatcher"].py_func.__module__ in _modules


event.register("numba:compile", _Progress())  # type: ignore[no-untyped-call]


@typeof_impl.register(Loop)
def _type_of_loop(loop: Loop, context: Any) -> Any:
    return types.Dispatcher(loop.dispatcher)


def dispatcher(function: Callable[..., Any], exact: bool) -> Any:
    """Return what numba compiles on its first call with arguments of some types.

    Args:
        function: in Python.
        exact: whether sums and products must stay as they are written.
    """
    _modules.add(function.__module__)
    mathematics = False if exact else MATHEMATICS
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    loop: Any = njit(**options, fastmath=mathematics, pipeline_class=LoopCompiler)(function)
    with _setting("CACHE_LOCATOR_CLASSES", f"{__name__}.{Locator.__name__}"):
        loop._cache = LoopCache(function)  # type: ignore[no-untyped-call]
    compile_loop = loop.compile

    def compile_quickly(signature: Any) -> Any:
        loop.targetoptions["no_cpython_wrapper"] = "Lanes(" in str(signature)  # Python has no such vectors
        with compiler_settings():
            return compile_loop(signature)

    loop.compile = compile_quickly
    return loop


@contextmanager
def compiler_settings() -> Iterator[None]:
    """Compile at our level of optimisation, with all formulas known, for as long as the block lasts."""
    for formula in take_formulas():
        register_jitable(formula)
    with _setting("OPT", type(config.OPT)(_LEVEL)):  # type: ignore[attr-defined]
        yield


@contextmanager
def _setting(name: str, value: object) -> Iterator[None]:
    """A setting of numba for as long as the block lasts."""
    before = getattr(config, name)
    setattr(config, name, value)
    try:
        yield
    finally:
        setattr(config, name, before)
