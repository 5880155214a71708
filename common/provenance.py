"""Record where a result comes from: version of the code, libraries, configuration and its hash.

Provenance is a plain dictionary. Each kind of file stores it in its own way: as Parquet metadata, as a JSON entry,
or at the foot of a page.
"""

from __future__ import annotations

import hashlib
import json
import platform
from functools import cache
from importlib import metadata
from pathlib import Path

_LIBRARIES = ("numpy", "scipy", "torch", "pandas", "pyarrow")


def fingerprint(content: object) -> str:
    """Return a short hash of JSON-like content, independent of key order."""
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _version() -> str:
    """Return the version of the installed package; "0" where it is not installed."""
    try:
        return metadata.version("softflagella")
    except metadata.PackageNotFoundError:
        return "0"


__version__ = _version()


@cache
def code_version() -> str:
    """Return the version of the package and a hash of the simulator's source, e.g. "0.1.0+1a2b3c4d"."""
    digest = hashlib.sha256()
    for folder in ("common", "sim"):
        for file in sorted(Path(__file__).parents[1].joinpath(folder).rglob("*.py")):
            digest.update(file.read_bytes())
    return f"{__version__}+{digest.hexdigest()[:8]}"


def provenance(config: object) -> dict[str, object]:
    """Return version of the code, libraries, configuration and its hash."""
    return {
        "code_version": code_version(),
        "config": config,
        "config_hash": fingerprint(config),
        "python": platform.python_version(),
        "libraries": {name: metadata.version(name) for name in _LIBRARIES},
    }
