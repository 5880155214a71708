"""Compiled loops: machine code by numba, kept on disk between runs.

numba takes a second to import. So a loop imports it, with `sim.machine_code`, on its first call.

numba's own cache depends on the time stamp of the loop's file. If a formula in another file changes, it would use
old machine code; if a comment changes, it would compile again. So the cache is a folder whose name has a digest of
the code of all files that compiled loops are made of, without comments and docstrings. The folders of the last few
versions are kept. They are beside this file, or in the user's cache folder. Machine code runs with the user's
rights, so a folder is used only if it belongs to the user and nobody else can write it. Loops of other packages
have folders of their own in it, named by a digest of all files of their package. Machine code does not depend on
the folder that the sources are in.

Sums may be reordered and multiplications fused, so last digits can differ between machines. Loops that are
`compiled_exactly` keep the order of the source: those of `sim.lanes`. NaN and infinity keep their meaning.

The first use of a loop compiles it, with a progress bar on stderr. `softflagella sim compile` compiles all loops.

Large loops that are `compiled_exactly` are called by others (`sim.called_code`). Other loops are copied into those
that call them. Where sums may be reordered, such a loop that this process compiles can give other last digits than
the same loop read from disk: of a loop that several others call, the first copy in the process is used by all of
them, and the copies were not optimised with the same neighbours. So where results must be the same in each
process, loops are compiled in another one (`compile_apart`), and only read here.
"""

from __future__ import annotations

import ast
import errno
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from shutil import rmtree
from stat import S_ISDIR
from types import CodeType
from typing import Any, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])

_HERE = Path(__file__).parent
_SOURCES = (
    "arrays.py", "called_code.py", "compiling.py", "lane*.py", "machine_code.py",
    "model/body.py", "linear/*.py", "mechanics/*.py", "solve/*.py",
)  # fmt: skip
_KEPT = 3  # folders of other versions
_NUMBA = "sim.machine_code"  # by name: this module imports us, and numba


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


def digest_of_code(code: CodeType) -> str:
    """Return twelve characters that name what a function does."""
    digest = sha256()
    _add_code(digest, code)
    return digest.hexdigest()[:12]


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
    home = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"), "softflagella")
    for parent in filter(Path.is_absolute, (beside, home)):  # "~" stays where the user is unknown
        with suppress(OSError):
            folder = folder_for_code(parent, "compiled", _HERE)
            if not folder.exists():
                prune(parent, _KEPT)
                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_private(folder):
                return folder
    remedy = "no folder for compiled loops that this user alone can write; set XDG_CACHE_HOME to the path of one"
    raise PermissionError(errno.EACCES, remedy, str(home))


CACHE = cache_folder()
_APART = "SOFTFLAGELLA_COMPILES"  # environment of a process that compiles for others


@cache
def processor() -> str:
    """Return the name of this kind of processor, to which machine code belongs."""
    from llvmlite.binding import get_host_cpu_name

    return str(get_host_cpu_name())


def processor_has(feature: str) -> bool:
    """Tell whether this processor has a feature, by LLVM's name of it; false where it cannot be told."""
    from llvmlite.binding import get_host_cpu_features

    if os.environ.get("NUMBA_CPU_FEATURES") is not None:
        return f"+{feature}" in os.environ["NUMBA_CPU_FEATURES"].split(",")
    return bool(get_host_cpu_features().get(feature, False))


def _all_compiled_mark() -> str:
    return f"all-for-{processor()}"


def all_compiled(folder: Path = CACHE) -> bool:
    """Whether every loop of a folder has been compiled for this processor; true where they are being compiled."""
    return _APART in os.environ or (folder / _all_compiled_mark()).exists()


def mark_all_compiled(folder: Path = CACHE) -> None:
    """Remember that every loop of a folder has been compiled for this processor."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / _all_compiled_mark()).touch()


def compile_apart(module: str) -> bool:
    """Call `compile_all` of a module in a process of its own; whether it came to its end."""
    code = f"import sys; sys.path[:] = {sys.path!r}; from {module} import compile_all; compile_all()"
    environment = {**os.environ, _APART: "1", "NUMBA_DISABLE_JIT": "0"}
    process = subprocess.Popen([sys.executable, "-c", code], env=environment)
    try:
        return process.wait() == 0
    finally:
        process.kill()


@cache
def folder_of_package(root: Path) -> Path:
    """Return where the loops of another package are kept: all its files, in all its folders, name the folder."""
    return folder_for_code(CACHE, root.name, root, ("**/*.py",))


def package_root(file: Path) -> Path:
    """Return the outermost folder with an __init__.py around a file, or the file's own folder."""
    root = file.parent
    while (root.parent / "__init__.py").exists():
        root = root.parent
    return root


class Loop:
    """A compiled function. numba is imported, and the function compiled or read from disk, on the first call."""

    __name__: str

    def __init__(self, function: Callable[..., Any], exact: bool = False):
        update_wrapper(self, function)
        self.py_func, self.exact = function, exact

    @cached_property
    def dispatcher(self) -> Any:
        """What numba calls, and calls from other compiled functions."""
        return import_module(_NUMBA).dispatcher(self.py_func, self.exact)

    def __call__(self, *arguments: Any) -> Any:
        return self.dispatcher(*arguments)

    def __reduce__(self) -> str:
        return self.__name__


def compiled(function: F) -> F:
    """Compile a function of numbers and arrays on its first call, without holding the interpreter's lock."""
    return cast(F, Loop(function))


def compiled_exactly(function: F) -> F:
    """Compile a function as `compiled` does, but never reorder its sums nor fuse its products."""
    return cast(F, Loop(function, exact=True))


_formulas: list[Callable[..., Any]] = []  # that numba has not been told of


def formula(function: F) -> F:
    """Mark a formula: inlined in compiled functions, elsewhere plain Python, for numbers and tensors."""
    _formulas.append(function)
    return function


def take_formulas() -> list[Callable[..., Any]]:
    """Return the functions marked since the last call."""
    taken = _formulas.copy()
    _formulas.clear()
    return taken
