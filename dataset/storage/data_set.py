"""Read a data set on disk or behind a URL.

    DIR/sweep.json         what determines a row: seed, inputs, code; written before the first row
    DIR/pending/           shards that workers have written, until the build is complete
    DIR/rows/*.parquet     the rows; pandas, polars and duckdb read this folder
    DIR/manifest.json      what is in rows/: files, digests, counts; written when all rows are there
    DIR/card.md            what a reader should know

`read` and `batches` check everything that they read: files, digests, checksums of pages. Where something is
missing, duplicate or changed they refuse. `softflagella dataset verify DIR --mend` repairs, if this version of the
code made the rows.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from dataset.rows.schema import schema
from dataset.rows.version import rows_version
from dataset.storage.shards import BadShardError, Contents, OtherColumnsError, Shard, shard_name, tables
from dataset.storage.storage import Storage, open_storage
from sim.effects import catalogue
from sim.io.errors import InputError
from sim.io.provenance import fingerprint, provenance

if TYPE_CHECKING:
    import pandas as pd

MANIFEST, SWEEP, CARD, ROWS, PENDING = "manifest.json", "sweep.json", "card.md", "rows", "pending"
FORMAT = 2  # of the folder


def check_version(storage: Storage, theirs: str, ours: str | None = None) -> None:
    """Reject a data set whose rows were made by another version of the code.

    Args:
        theirs: the version that made the rows.
        ours: this version; default `rows_version`.
    """
    if theirs != (ours or rows_version()):
        raise InputError(_other_version(storage, theirs, ours))


def _other_version(storage: Storage, theirs: str, ours: str | None = None) -> str:
    return (
        f"{storage.address} holds rows of another version: {theirs} there, {ours or rows_version()} here; use "
        "that version, or build the data set anew in another folder"
    )


def stored_json(storage: Storage, name: str) -> Any:
    """Parse a file of the folder.

    Raises:
        ValueError: it is no JSON, or its content is nested too deeply.
    """
    try:
        return json.loads(bytes(storage.read(name)))
    except RecursionError:
        raise ValueError("its content is nested too deeply") from None


def _damage(storage: Storage, what: str) -> InputError:
    """Name a damage, and how to repair it: by this version if it made the rows, which sweep.json says."""
    try:
        theirs = stored_json(storage, SWEEP)["code"]
    except (ValueError, TypeError, KeyError, InputError, OSError):
        theirs = rows_version()
    if theirs != rows_version():
        return InputError(f"{what}; {_other_version(storage, theirs)}")
    return InputError(f"{what}; repair it with softflagella dataset verify {quote(storage.address)} --mend")


def write_manifest(storage: Storage, content: dict[str, Any]) -> dict[str, Any]:
    """Write the manifest, sealed with its own digest; return it."""
    sealed = {**content, "digest": fingerprint(content)}
    storage.write(MANIFEST, json.dumps(sealed, indent=1) + "\n")
    return sealed


def manifest_content(
    config: dict[str, Any], key: str, code: str, effects: list[str], parts: Sequence[Contents]
) -> dict[str, Any]:
    """Compile the manifest of these shards."""
    reasons: dict[str, int] = {}
    for part in parts:
        for reason, count in part.reasons.items():
            reasons[reason] = reasons.get(reason, 0) + count
    totals = {name: sum(getattr(p, name) for p in parts) for name in ("converged", "failed", "touching")}
    return {
        **provenance(config),
        "format": FORMAT,
        "config_hash": key,
        "code_version": code,
        "effects": effects,
        "rows": parts[-1].stop if parts else 0,
        **totals,
        "reasons": dict(sorted(reasons.items())),
        "cost_s": sum(p.cost_s for p in parts),
        "parts": [p._asdict() for p in parts],
    }


def read_manifest(folder: Storage | str | Path) -> dict[str, Any]:
    """Read the manifest of a finished data set.

    Raises:
        InputError: there is none, or it has been changed since it was written.
    """
    storage = open_storage(folder)
    path = storage.path(MANIFEST)
    if storage.size(MANIFEST) is None:
        raise InputError(
            f"{storage.address} is no finished data set (no {MANIFEST}); make it with softflagella sweep"
        )
    try:
        content = stored_json(storage, MANIFEST)
        digest = content.pop("digest", None)
        known = "config_hash" in content and "effects" in content and "parts" in content
    except (ValueError, AttributeError, TypeError) as broken:
        raise _damage(storage, f"{path} is damaged: {broken}") from None
    if not known or content.get("format") != FORMAT:
        raise InputError(f"{path} is not the manifest of a data set of this version; build the data set anew")
    if digest != fingerprint(content):
        raise _damage(storage, f"{path} has been edited: it does not fit its own digest")
    if not _has_form(content):
        raise InputError(f"{path} has entries that no build writes; build the data set anew")
    return {**content, "digest": digest}


def _has_form(content: dict[str, Any]) -> bool:
    """Whether the entries of a manifest are there, and of the types that readers expect."""
    kinds = {"config_hash": str, "code_version": str, "config": dict, "effects": list, "parts": list, "rows": int,
             "converged": int, "failed": int, "touching": int, "cost_s": int | float, "reasons": dict}  # fmt: skip
    if not all(isinstance(content.get(name), kind) for name, kind in kinds.items()):
        return False
    of_parts = {name: kinds.get(name, int) for name in Contents._fields} | {"sha256": str}
    return all(
        isinstance(part, dict)
        and set(part) == set(of_parts)
        and all(isinstance(part[name], kind) for name, kind in of_parts.items())
        for part in content["parts"]
    ) and all(isinstance(name, str) and name in catalogue() for name in content["effects"])


def manifest_parts(manifest: dict[str, Any]) -> list[Contents]:
    """List the shards of a manifest."""
    return [Contents(**part) for part in manifest["parts"]]


def batches(
    folder: Storage | str | Path, columns: Sequence[str] | None = None, *, rows: int = 2**16
) -> Iterator[pa.RecordBatch]:
    """Yield the rows of a finished data set in order, `rows` at a time: no more of them than that is in memory.

    Args:
        folder: a folder or URL.
        columns: names; default all.
        rows: most rows of a batch.

    Raises:
        InputError: no finished data set there, or a file is missing, duplicate, changed or damaged.

    Example:
        >>> from dataset.storage.data_set import batches
        >>> sum(batch.num_rows for batch in batches("data/sweep", ["omega_yr_bar"]))  # doctest: +SKIP
        8192
    """
    storage = open_storage(folder)
    manifest = read_manifest(storage)
    form = schema(manifest["effects"], manifest["config"].get("sensitivities", False))
    unknown = sorted(set(columns or ()) - set(form.names))
    if unknown:
        raise InputError(f"no column {unknown[0]!r} in a data set; there are {', '.join(form.names)}")
    _check_files(storage, manifest)
    for part in manifest_parts(manifest):
        shard = Shard(shard_name(ROWS, part.start, part.stop), part.start, part.stop)
        try:
            data = storage.read(shard.name)
            if hashlib.sha256(data).hexdigest() != part.sha256:
                raise BadShardError("it does not have the digest that the manifest states")
            for table in tables(data, shard, form, manifest["config_hash"], columns):
                yield from table.combine_chunks().to_batches(max_chunksize=rows)
        except OtherColumnsError as bad:
            if manifest["code_version"] != rows_version():
                raise InputError(f"{_other_version(storage, manifest['code_version'])}: {bad}") from None
            raise _damage(storage, f"{storage.path(shard.name)}: {bad}") from None
        except BadShardError as bad:
            raise _damage(storage, f"{storage.path(shard.name)}: {bad}") from None


def _check_files(storage: Storage, manifest: dict[str, Any]) -> None:
    """Reject missing files and files that the manifest does not know."""
    stored = {f"{ROWS}/{name}" for name in storage.names(ROWS)}
    listed = {shard_name(ROWS, part.start, part.stop): part.bytes for part in manifest_parts(manifest)}
    for name in sorted(set(listed) - stored):
        raise _damage(storage, f"{storage.path(name)} is missing")
    for name in sorted(stored - set(listed)):
        raise _damage(storage, f"{storage.path(name)} is not in the manifest: a copy, or an interrupted build")
    for name, size in listed.items():
        if storage.size(name) != size:
            raise _damage(storage, f"{storage.path(name)} is cut short or longer")


def read(folder: str | Path, columns: Sequence[str] | None = None) -> pd.DataFrame:
    """Read all rows of a finished data set, in the order of the design.

    Args:
        folder: a folder or URL.
        columns: names; default all.

    Raises:
        InputError: as for `batches`.
    """
    parts = list(batches(folder, columns, rows=2**20))
    return pa.Table.from_batches(parts).replace_schema_metadata(None).to_pandas()


def usable(rows: pd.DataFrame) -> pd.DataFrame:
    """Select rows to learn from: converged, not failed, all outputs finite (touching tails included)."""
    good = rows["converged"] & ~rows["failed"]
    numbers = rows.select_dtypes("number").drop(columns="tail_gap").to_numpy(dtype=float)
    return rows[good.to_numpy(dtype=bool) & np.isfinite(numbers).all(axis=1)]
