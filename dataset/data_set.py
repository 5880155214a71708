"""Read a data set on disk or behind a URL.

    DIR/sweep.json         what determines a row: seed, inputs, code; written before the first row
    DIR/rows/*.parquet     the rows; pandas, polars and duckdb read this folder
    DIR/manifest.json      what is in rows/: files, digests, counts; written when all rows are there
    DIR/card.md            what a reader should know

`read` and `batches` check everything that they read: files, digests, checksums of pages. Where something is
missing, duplicate or changed they refuse. Files of rows beyond the manifest's belong to an unfinished build and
are not read. `softflagella dataset verify DIR --mend` repairs, if this version of the code made the rows.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from common.errors import InputError
from common.keywords import checks_keywords
from common.provenance import fingerprint, provenance
from dataset.design import MOST_ROWS, SweepDesign, checked_design
from dataset.folder import Folder
from dataset.schema import rows_version, schema
from dataset.shards import ROWS, BadFileError, Part, record_batches, rows_named
from sim.effects import is_effect

if TYPE_CHECKING:
    import pandas as pd

MANIFEST, SWEEP, CARD = "manifest.json", "sweep.json", "card.md"
FORMAT = 2  # of the folder
_COUNTS = ("converged", "failed", "touching")
_KINDS = {"config_hash": str, "code_version": str, "config": dict, "effects": list, "parts": list, "rows": int,
          **dict.fromkeys(_COUNTS, int), "cost_s": int | float, "reasons": dict}  # fmt: skip
_PART_KINDS = {name: _KINDS.get(name, int) for name in Part._fields} | {"sha256": str}


def sweep_key(config: dict[str, Any], code: str, source: str) -> str:
    """Return the key of the rows of a sweep: a hash of its inputs and of all that makes rows of them."""
    return fingerprint({"config": config, "code": code, "rows_by": source})


def check_version(folder: Folder, theirs: str, what: str = "") -> None:
    """Reject a data set whose rows were made by another version of the code; `what` else is wrong comes first."""
    if theirs != rows_version():
        raise InputError(
            f"{what}{folder.address} holds rows of another version: {theirs} there, {rows_version()} here; use "
            "that version, or build the data set anew in another folder"
        )


def _json(folder: Folder, name: str) -> Any:
    """Parse a file of the folder; ValueError: it is no JSON, or its content is nested too deeply."""
    try:
        return json.loads(folder.read(name))
    except RecursionError:
        raise ValueError("its content is nested too deeply") from None


def _damage(folder: Folder, what: str) -> InputError:
    """Name a damage, and how to repair it: by this version if it made the rows, which sweep.json says."""
    try:
        theirs = _json(folder, SWEEP)["code"]
    except (ValueError, TypeError, KeyError):
        theirs = rows_version()
    check_version(folder, theirs, f"{what}; ")
    return InputError(f"{what}; repair it with softflagella dataset verify {quote(folder.address)} --mend")


def read_design(folder: Folder) -> tuple[dict[str, Any], SweepDesign]:
    """Read the sweep.json of a folder, and make its design, of one row.

    Raises:
        InputError: there is none, or it has been edited.
    """
    if SWEEP not in folder.names():
        raise InputError(f"{folder.address} is no data set (no {SWEEP}); make it with softflagella sweep")
    path = folder.path(SWEEP)
    try:
        sweep = _json(folder, SWEEP)
        size, rows = sweep.get("grid", [1, 1])  # of the last build: rows of a chunk, and of the data set
        known = _has(sweep, {"code": str, "rows_by": str, "config": dict}) and type(size) is type(rows) is int
        whole = known and sweep["key"] == sweep_key(sweep["config"], sweep["code"], sweep["rows_by"])
    except (ValueError, KeyError, TypeError, AttributeError):
        whole = False
    if not whole or not 0 < rows <= MOST_ROWS:
        raise InputError(f"{path} has been edited or is damaged; give another folder or remove this one")
    checked_design({**sweep["config"], "rows": 1}, path)  # anybody may have written it
    return sweep, SweepDesign.from_config(sweep["config"], 1)  # to the letter, as the key has it


def write_manifest(
    folder: Folder, design: SweepDesign, key: str, code: str, parts: Sequence[Part]
) -> dict[str, Any]:
    """Write the manifest of files of rows, sealed with its own digest; return it."""
    reasons = sum((Counter(part.reasons) for part in parts), Counter[str]())
    content = {
        **provenance(design.config()), "format": FORMAT, "config_hash": key, "code_version": code,
        "effects": design.effects, "rows": parts[-1].stop,
        **{name: sum(getattr(part, name) for part in parts) for name in (*_COUNTS, "cost_s")},
        "reasons": dict(sorted(reasons.items())), "parts": [part._asdict() for part in parts],
    }  # fmt: skip
    sealed = {**content, "digest": fingerprint(content)}
    folder.write(MANIFEST, (json.dumps(sealed, indent=1) + "\n").encode())
    return sealed


def read_manifest(address: str | Path) -> dict[str, Any]:
    """Read the manifest of a finished data set in a folder or behind a URL.

    Raises:
        InputError: there is none, or it has been changed since it was written.
    """
    folder = Folder(address)
    path = folder.path(MANIFEST)
    if MANIFEST not in folder.names():
        raise InputError(
            f"{folder.address} is no finished data set (no {MANIFEST}); make it with softflagella sweep"
        )
    try:
        content = _json(folder, MANIFEST)
        digest = content.pop("digest", None)
    except (ValueError, AttributeError, TypeError) as broken:
        raise _damage(folder, f"{path} is damaged: {broken}") from None
    if content.get("format") != FORMAT:
        raise InputError(f"{path} is not the manifest of a data set of this version; build the data set anew")
    if digest != fingerprint(content):
        raise _damage(folder, f"{path} has been edited: it does not fit its own digest")
    if not (
        _has(content, _KINDS)
        and all(_has(part, _PART_KINDS) and set(part) == set(_PART_KINDS) for part in content["parts"])
        and all(isinstance(name, str) and is_effect(name) for name in content["effects"])
    ):
        raise InputError(f"{path} has entries that no build writes; build the data set anew")
    return {**content, "digest": digest}


def _has(content: Any, kinds: dict[str, Any]) -> bool:
    return isinstance(content, dict) and all(isinstance(content.get(name), kind) for name, kind in kinds.items())


def batches(
    address: str | Path, columns: Sequence[str] | None = None, *, rows: int = 2**16
) -> Iterator[pa.RecordBatch]:
    """Yield the rows of a finished data set in order, at most `rows` at a time: one file is in memory, not all.

    Args:
        address: a folder or URL.
        columns: names; default all.
        rows: most rows of a batch.

    Raises:
        InputError: no finished data set there, or a file is missing, duplicate, changed or damaged.

    Example:
        >>> from dataset.data_set import batches
        >>> sum(batch.num_rows for batch in batches("data/sweep", ["omega_yr_bar"]))  # doctest: +SKIP
        8192
    """
    folder, manifest = Folder(address), read_manifest(address)
    form = schema(manifest["effects"], manifest["config"].get("sensitivities", False))
    unknown = sorted(set(columns or ()) - set(form.names))
    if unknown:
        raise InputError(f"no column {unknown[0]!r} in a data set; there are {', '.join(form.names)}")
    parts = [Part(**part) for part in manifest["parts"]]
    stored, listed = {f"{ROWS}/{name}" for name in folder.names(ROWS)}, {part.name for part in parts}
    for name in sorted(listed - stored):
        raise _damage(folder, f"{folder.path(name)} is missing")
    for name in sorted(stored - listed):
        if (rows_named(name) or (0,))[0] < manifest["rows"]:
            raise _damage(folder, f"{folder.path(name)} is not in the manifest: a copy, or an interrupted build")
    for part in parts:
        try:
            data = folder.read(part.name)
            if hashlib.sha256(data).hexdigest() != part.sha256:
                raise BadFileError("it does not have the digest that the manifest states")
            yield from record_batches(
                data, part.stop - part.start, form, manifest["config_hash"], columns, rows=rows
            )
        except BadFileError as bad:
            raise _damage(folder, f"{folder.path(part.name)}: {bad}") from None


@checks_keywords
def read(folder: str | Path, columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Read all rows of a finished data set, in the order of its design; units are in the Parquet schema.

    Args:
        folder: or URL, written by `softflagella.sweep`.
        columns: names; default all.

    Raises:
        InputError: there is no finished data set, or its files are damaged.

    Example:
        >>> import softflagella as sf
        >>> table = sf.read_sweep("data/sweep")  # doctest: +SKIP
    """
    return pa.Table.from_batches(batches(folder, columns, rows=2**20)).replace_schema_metadata(None).to_pandas()


def usable(rows: pd.DataFrame) -> pd.DataFrame:
    """Select rows to learn from: converged, not failed, all outputs finite (touching tails included)."""
    good = rows["converged"] & ~rows["failed"]
    numbers = rows.select_dtypes("number").drop(columns="tail_gap").to_numpy(dtype=float)
    return rows[good.to_numpy(dtype=bool) & np.isfinite(numbers).all(axis=1)]
