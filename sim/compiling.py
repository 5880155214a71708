"""Compiled loops: machine code by numba, kept on disk between runs.

numba's own cache depends on the time stamp of the loop's file. If a formula in another file changes, it would use
old machine code; if a comment changes, it would compile again. So the cache is a folder whose name has a digest of
the code of all files that compiled loops are made of, without comments and docstrings. The folders of the last few
versions are kept. They are beside this file, or in the user's cache folder if this one cannot be written. Loops of
other packages have folders of their own in it, named by a digest of all files of their package. Machine code does
not depend on the folder that the sources are in.

Sums may be reordered and multiplications fused, so last digits can differ between machines. NaN and infinity keep
their meaning.

The first use of a loop compiles it, with a progress bar on stderr. `softflagella sim compile` compiles all loops.

A loop that this process compiles can give other last digits than the same loop read from disk: of a loop that
several others call, the first copy in the process is used by all of them, and the copies were not optimised with
the same neighbours. So where results must be the same in each process, loops are compiled in another one
(`compile_apart`), and only read here.
"""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from shutil import rmtree
from types import CodeType
from typing import Any, Self, TypeVar, cast

from llvmlite.binding import get_host_cpu_name
from numba import config, njit
from numba.core import event
from numba.core.caching import _CacheLocator
from tqdm import tqdm

F = TypeVar("F", bound=Callable[..., Any])

_HERE = Path(__file__).parent
_SOURCES = ("arrays.py", "compiling.py", "linear/*.py", "mechanics/*.py", "model/body.py", "solve/*.py")
_KEPT = 3  # folders of other versions
_LEVEL = 1  # of optimisation: loops run as fast as at level 3 and compile in less than half the time


def code_digest(root: Path, patterns: Iterable[str] = _SOURCES) -> str:
    """Return twelve characters that name the code of the files under `root`, not their comments."""
    digest = sha256()
    for path in sorted(path for pattern in patterns for path in root.glob(pattern)):
        digest.update(str(path.relative_to(root)).encode() + _code_of_source(path.read_bytes()))
    return digest.hexdigest()[:12]


@cache
def _code_of_source(source: bytes) -> bytes:
    """Return the digest of the code of one file."""
    digest, tree = sha256(), ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node, clean=False):
            node.body = node.body[1:] or [ast.Pass(lineno=1, col_offset=0)]
    _add_code(digest, compile(tree, "", "exec", dont_inherit=True))
    return digest.digest()


def _add_code(digest: Any, code: CodeType) -> None:
    """Add what a block of code does to a digest; line numbers are left out."""
    digest.update(repr((code.co_name, code.co_names, code.co_varnames, code.co_freevars)).encode() + code.co_code)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            _add_code(digest, constant)
        else:
            members = sorted(constant, key=repr) if isinstance(constant, frozenset) else constant
            digest.update(repr(members).encode())


def prune(folder: Path, kept: int) -> None:
    """Remove the compiled loops of all versions in `folder` but the newest `kept`."""
    versions = sorted(folder.glob("compiled-*"), key=lambda path: path.stat().st_mtime)
    for old in versions[: max(len(versions) - kept, 0)]:
        rmtree(old, ignore_errors=True)


def folder_for_code(parent: Path, name: str, root: Path, patterns: Iterable[str] = _SOURCES) -> Path:
    """Return the folder in `parent` for the loops of the files under `root`: `name` and the digest of their code.

    To parse all files takes a quarter of a second. So a folder that exists gets an empty file for each text of the
    sources that has led to it.
    """
    sources = sorted(path for pattern in patterns for path in root.glob(pattern))
    text = sha256(sys.version.encode())
    for path in sources:
        text.update(str(path.relative_to(root)).encode() + sha256(path.read_bytes()).digest())
    mark = f"sources-{text.hexdigest()[:12]}"
    for known in parent.glob(f"{name}-*/{mark}"):
        return known.parent
    folder = parent / f"{name}-{code_digest(root, patterns)}"
    if folder.exists():
        with suppress(OSError):
            (folder / mark).touch()
    return folder


def _cache_folder() -> Path:
    """Return where this version's loops are kept."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    parent = _HERE / "__pycache__" if os.access(_HERE, os.W_OK) else home / "softflagella"
    return folder_for_code(parent, "compiled", _HERE)


CACHE = _cache_folder()
_ALL = f"all-for-{get_host_cpu_name()}"  # machine code belongs to one kind of processor
_APART = "SOFTFLAGELLA_COMPILES"  # environment of a process that compiles for others
if not CACHE.exists():
    prune(CACHE.parent, _KEPT)


def all_compiled(folder: Path = CACHE) -> bool:
    """Whether every loop of a folder has been compiled for this processor; true where they are being compiled."""
    return (folder / _ALL).exists() or _APART in os.environ


def mark_all_compiled(folder: Path = CACHE) -> None:
    """Remember that every loop of a folder has been compiled for this processor."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _ALL).touch()


def compile_apart(module: str) -> bool:
    """Call `compile_all` of a module in a process of its own; whether it came to its end."""
    code = f"import sys; sys.path[:] = {sys.path!r}; from {module} import compile_all; compile_all()"
    process = subprocess.Popen([sys.executable, "-c", code], env={**os.environ, _APART: "1"})
    try:
        return process.wait() == 0
    finally:
        process.kill()


_modules: set[str] = set()  # with compiled loops


@cache
def folder_of_package(root: Path) -> Path:
    """Return where the loops of another package are kept: all its files, in all its folders, name the folder."""
    return folder_for_code(CACHE, root.name, root, ("**/*.py",))


def _package_root(file: Path) -> Path:
    """Return the outermost folder with an __init__.py around a file, or the file's own folder."""
    root = file.parent
    while (root.parent / "__init__.py").exists():
        root = root.parent
    return root


class Locator(_CacheLocator):
    """Tells numba in which of our folders a loop is kept. The folder's name says which code it belongs to."""

    def __init__(self, module: str, file: Path):
        self._module = module
        self._folder = CACHE if file.is_relative_to(_HERE) else folder_of_package(_package_root(file))

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


def compiled(function: F) -> F:
    """Compile a function of numbers and arrays on its first call, without holding the interpreter's lock."""
    _modules.add(function.__module__)
    with _setting("CACHE_LOCATOR_CLASSES", f"{__name__}.{Locator.__name__}"):
        loop: Any = njit(
            cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz", "arcp"}
        )(function)
    compile_loop, level = loop.compile, type(config.OPT)(_LEVEL)  # type: ignore[attr-defined]

    def compile_quickly(signature: Any) -> Any:
        with _setting("OPT", level):
            return compile_loop(signature)

    loop.compile = compile_quickly
    return cast(F, loop)


@contextmanager
def _setting(name: str, value: object) -> Iterator[None]:
    """A setting of numba for as long as the block lasts."""
    before = getattr(config, name)
    setattr(config, name, value)
    try:
        yield
    finally:
        setattr(config, name, before)
