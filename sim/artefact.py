"""Files that the pipeline makes: written whole or not at all, and carrying what made them.

A file is written beside its place under another name and moved there when complete, so that an error or an
interruption leaves either the old file or the new one. Provenance is a plain dictionary of code version,
library versions, configuration and its hash; each artefact stores it in its own way (Parquet metadata,
JSON entry, report footer).
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import metadata
from pathlib import Path

from sim.errors import InputError

_LIBRARIES = ("numpy", "scipy", "torch", "pandas", "pyarrow")


@contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path; move it to `path` when the block succeeds, remove it otherwise."""
    target = Path(path)
    if target.is_dir():
        raise InputError(f"{target} is a folder; give the name of a file")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError, PermissionError) as blocked:
        raise InputError(f"cannot make the folder {target.parent}: {blocked.strerror}") from None
    part = target.with_name(f".{target.name}.part{os.getpid()}")
    try:
        yield part
        os.replace(part, target)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file whole or not at all."""
    with whole_file(path) as part:
        part.write_text(text)


def fingerprint(content: object) -> str:
    """A short hash of JSON-like content, independent of key order."""
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


@cache
def code_version() -> str:
    """Version of the package and a hash of the simulator's source, e.g. "0.1.0+1a2b3c4d"."""
    digest = hashlib.sha256()
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(file.read_bytes())
    try:
        version = metadata.version("softflagella")
    except metadata.PackageNotFoundError:
        version = "0"
    return f"{version}+{digest.hexdigest()[:8]}"


def provenance(config: object) -> dict[str, object]:
    """What made an artefact: code, libraries, configuration and its hash."""
    return {
        "code_version": code_version(),
        "config": config,
        "config_hash": fingerprint(config),
        "python": platform.python_version(),
        "libraries": {name: metadata.version(name) for name in _LIBRARIES},
    }
