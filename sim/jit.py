"""Compiled loops: functions that numba compiles on their first call, with machine code kept on disk.

numba takes a second to import, so a loop imports it when it is called. What Python calls is a kernel: numba's
cache keeps it on disk. What a compiled loop calls becomes part of it. numba's cache asks only whether the kernel's
own file has changed. So the folder's name has a digest of all files that loops are made of; the last versions are
kept. Machine code runs with the user's rights: a folder must belong to the user, and nobody else may write it.
"""

from __future__ import annotations

import errno
import gc
import os
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from shutil import rmtree
from stat import S_ISDIR
from threading import RLock
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])
SOURCES = ("jit.py", "lane*.py", "model/body.py", "linear/*.py", "mechanics/*.py", "solve/*.py")
_HERE = Path(__file__).parent
_KEPT = 3  # folders of other versions
_LEVEL = 1  # of optimisation: as fast as level 3, compiled in less than half the time
_SELDOM = (100_000, 50, 100)  # new objects, and collections, before the next collection
_COUNTED = {"_nrt": True}  # references to arrays, by which numba frees them
_OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, **_COUNTED}
_FAST = {"contract", "reassoc", "nsz", "arcp"}  # what fast sums and products may do; NaN keeps its meaning
beforehand = False  # loops are compiled by a command that says so
_lock = RLock()  # over numba's settings
_functions: set[Callable[..., Any]] = set()  # of loops


def digest(files: Iterable[Path]) -> str:
    """Return twelve characters that name the contents of some files."""
    return sha256(b"".join(sha256(file.read_bytes()).digest() for file in sorted(files))).hexdigest()[:12]


def _is_private(folder: Path) -> bool:
    """Whether a folder belongs to this user, and nobody else can write it."""
    found = folder.lstat()
    own = S_ISDIR(found.st_mode) and found.st_uid == os.geteuid() and not found.st_mode & 0o022
    return own and os.access(folder, os.W_OK)


def cache_folder(beside: Path = _HERE / "__pycache__") -> Path:
    """Return where this version's loops are kept: `beside` the code, or in the user's cache folder.

    Raises:
        PermissionError: there is no folder that this user alone can write.
    """
    name = f"compiled-{digest(path for pattern in SOURCES for path in _HERE.glob(pattern))}"
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "softflagella")
    for parent in filter(Path.is_absolute, (beside, home)):  # "~" stays where the user is unknown
        with suppress(OSError):
            folder = parent / name
            if not folder.exists():
                versions = sorted(parent.glob("compiled-*"), key=lambda path: path.stat().st_mtime)
                for old in versions[:-_KEPT]:
                    rmtree(old, ignore_errors=True)
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_private(folder):
                return folder
    remedy = "no folder for compiled loops that this user alone can write; set XDG_CACHE_HOME to the path of one"
    raise PermissionError(errno.EACCES, remedy, str(home))


CACHE = cache_folder()


class Loop:
    """A compiled function. numba is imported, and the function compiled or read from disk, on the first call."""

    __name__: str

    def __init__(self, function: Callable[..., Any], **options: Any):
        update_wrapper(self, function)
        self.py_func, self.targetoptions = function, _OPTIONS | options  # as numba's inliner calls them
        _functions.add(function)

    @cached_property
    def kernel(self) -> Any:
        """What Python calls, kept on disk; outside `sim`, a change in any file of its folder compiles it again."""
        numba, file = _numba(), Path(self.py_func.__code__.co_filename)
        own = "sim" if file.is_relative_to(_HERE) else digest(file.parent.glob("*.py"))
        with _lock:
            before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(CACHE / own)
            try:
                return numba.njit(cache=True, **self.targetoptions | _COUNTED)(self.py_func)
            finally:
                numba.config.CACHE_DIR = before

    @cached_property
    def part(self) -> Any:
        """What compiled loops call."""
        return _numba().njit(no_cpython_wrapper=True, **self.targetoptions)(self.py_func)

    def __call__(self, *arguments: Any) -> Any:
        return self.kernel(*arguments)

    def __reduce__(self) -> str:
        return self.__name__


class _Formula(Loop):
    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return self.py_func(*arguments, **named)


def compiled(function: F) -> F:
    """Compile a function of numbers and arrays on its first call, without holding the interpreter's lock."""
    return cast(F, Loop(function))


def compiled_fast(function: F) -> F:
    """Compile as `compiled` does, with sums reordered and products fused: long sums become vector instructions."""
    return cast(F, Loop(function, fastmath=_FAST))


def borrowing(function: F) -> F:
    """Compile as `compiled` does what neither allocates nor returns an array, nor calls what returns one.

    It counts no references to the arrays that it is given, which would take as long as its formulas.
    """
    return cast(F, Loop(function, _nrt=False))


def inlined(function: F) -> F:
    """Write a function out in the compiled loops that call it: nothing to link, and no arguments to pass.

    numba optimises a function together with all that it calls, and again in each caller.
    """
    return cast(F, Loop(function, inline="always"))


def formula(function: F) -> F:
    """Mark a formula: part of compiled loops, elsewhere plain Python, for numbers, arrays and tensors."""
    return cast(F, _Formula(function, _nrt=False))


@cache
def _numba() -> Any:
    """Import numba, and teach it loops and lanes."""
    import numba
    from numba.core import event
    from numba.extending import typeof_impl

    config: Any = numba.config
    if config.DISABLE_JIT:
        raise OSError(errno.ENOTSUP, "loops need numba's compiler; unset it", "NUMBA_DISABLE_JIT")

    class Listener(event.Listener):
        """Sets the level of optimisation while loops are compiled, and says once that they are.

        Meanwhile Python seeks cycles among its objects less often, since numba makes millions that stay.
        """

        def __init__(self) -> None:
            self.before: list[Any] = []

        def on_start(self, event: Any) -> None:
            if event.data["dispatcher"].py_func in _functions:
                if not beforehand:
                    _say_first_use(event.data["dispatcher"].py_func.__module__.partition(".")[0])
                self.before.append((config.OPT, gc.get_threshold()))
                config.OPT = type(config.OPT)(_LEVEL)
                gc.set_threshold(*_SELDOM)

        def on_end(self, event: Any) -> None:
            if event.data["dispatcher"].py_func in _functions:
                config.OPT, thresholds = self.before.pop()
                gc.set_threshold(*thresholds)

    event.register("numba:compile", Listener())  # type: ignore[no-untyped-call]
    typeof_impl.register(Loop)(lambda loop, _: numba.types.Dispatcher(loop.part))
    import_module("sim.lane_code")
    return numba


@cache
def _say_first_use(package: str) -> None:
    by = {"surrogate": "planner", "planner": "planner", "calibration": "calibration"}.get(package, "sim")
    words = f"compiling loops for first use; softflagella {by} compile does so beforehand"
    print(words, file=sys.stderr, flush=True)
