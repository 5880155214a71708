"""Compiled loops: machine code by numba, kept on disk between runs.

numba's own cache looks at the file of the loop alone, and would go on using old machine code after a formula in
another file has changed. So the cache lies in a folder named by a digest of everything in this package: changed
physics is always compiled anew. The folders of the last few versions stay.

Sums may be reordered and multiplications fused (last digits can differ between machines); NaN and infinity keep
their meaning.
"""

from __future__ import annotations

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from shutil import rmtree
from typing import Any, TypeVar, cast

from numba import config, njit

F = TypeVar("F", bound=Callable[..., Any])

_HERE = Path(__file__).parent
_DIGEST = sha256(b"".join(path.read_bytes() for path in sorted(_HERE.glob("*.py")))).hexdigest()[:12]
CACHE = _HERE / "__pycache__" / f"compiled-{_DIGEST}"
_KEPT = 3  # folders of other versions


def prune(folder: Path, kept: int) -> None:
    """Remove the compiled loops of all versions in `folder` but the newest `kept`."""
    versions = sorted(folder.glob("compiled-*"), key=lambda path: path.stat().st_mtime)
    for old in versions[: max(len(versions) - kept, 0)]:
        rmtree(old, ignore_errors=True)


if not CACHE.exists():
    prune(CACHE.parent, _KEPT)


def compiled(function: F) -> F:
    """Compile a function of numbers and arrays on its first call, without holding the interpreter's lock."""
    before = config.CACHE_DIR  # type: ignore[attr-defined]
    config.CACHE_DIR = str(CACHE)  # type: ignore[attr-defined]
    try:
        loop = njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz", "arcp"})(
            function
        )
    finally:
        config.CACHE_DIR = before  # type: ignore[attr-defined]
    return cast(F, loop)
