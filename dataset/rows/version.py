"""The version of the code that makes a row: the package, the simulator's source, and three files here."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from sim.io.provenance import code_version

_ROW_CODE = ("design.py", "schema.py", "simulate.py")  # beside sim/, what a row depends on


@cache
def rows_version() -> str:
    """Return the version of all code that a row depends on, e.g. "0.1.0+1a2b3c4d.5e6f7a8b"."""
    digest = hashlib.sha256(b"".join(Path(__file__).with_name(name).read_bytes() for name in _ROW_CODE))
    return f"{code_version()}.{digest.hexdigest()[:8]}"
