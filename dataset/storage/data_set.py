"""A data set on disk or behind a URL.

    DIR/sweep.json         what determines a row: seed, inputs, code; written before the first row
    DIR/pending/           pieces that workers have written, until the build is complete
    DIR/rows/*.parquet     the rows; pandas, polars and duckdb read this folder
    DIR/manifest.json      what is in rows/: files, digests, counts; written when all rows are there
    DIR/card.md            what a reader should know

`read` and `batches` check everything that they read: files, digests, checksums of pages. Where something is
missing, doubled or changed they refuse. `python -m dataset verify DIR --mend` repairs.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from dataset.rows.schema import schema, table_of
from dataset.storage.shards import BadPieceError, Contents, Piece, piece_name, tables, write_piece
from dataset.storage.storage import Place, place
from sim.io.errors import InputError
from sim.io.provenance import fingerprint, provenance

if TYPE_CHECKING:
    import pandas as pd

MANIFEST, SWEEP, CARD, ROWS, PENDING = "manifest.json", "sweep.json", "card.md", "rows", "pending"
FORMAT = 2  # of the folder
_MEND = "; repair it with python -m dataset verify {} --mend"


def write_manifest(folder: Place | str | Path, content: dict[str, Any]) -> dict[str, Any]:
    """Write the manifest, sealed with its own digest; returns it."""
    sealed = {**content, "digest": fingerprint(content)}
    place(folder).write(MANIFEST, json.dumps(sealed, indent=1) + "\n")
    return sealed


def manifest_of(
    config: dict[str, Any], key: str, code: str, effects: list[str], parts: Sequence[Contents]
) -> dict[str, Any]:
    """What the manifest of these parts says."""
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


def read_manifest(folder: Place | str | Path) -> dict[str, Any]:
    """The manifest of a finished data set.

    Raises:
        InputError: there is none, or it has been changed since it was written.
    """
    there = place(folder)
    if there.size(MANIFEST) is None:
        raise InputError(
            f"{there.address} is no finished data set (no {MANIFEST}); make it with python -m dataset build"
        )
    try:
        content = json.loads(bytes(there.read(MANIFEST)))
        digest = content.pop("digest", None)
        known = "config_hash" in content and "effects" in content and "parts" in content
    except (ValueError, AttributeError, TypeError) as broken:
        raise InputError(f"{there.path(MANIFEST)} is damaged: {broken}" + _MEND.format(there.address)) from None
    if not known or content.get("format") != FORMAT:
        raise InputError(
            f"{there.path(MANIFEST)} is not the manifest of a data set of this version; build the data set anew"
        )
    if digest != fingerprint(content):
        raise InputError(
            f"{there.path(MANIFEST)} has been edited: it does not fit its own digest" + _MEND.format(there.address)
        )
    return {**content, "digest": digest}


def parts_of(manifest: dict[str, Any]) -> list[Contents]:
    """The files of a manifest."""
    return [Contents(**part) for part in manifest["parts"]]


def write_rows(
    folder: str | Path, config: dict[str, Any], columns: dict[str, Any], *, code: str
) -> dict[str, Any]:
    """Store rows that were made elsewhere as a finished data set.

    Args:
        folder: a new or empty folder.
        config: as `Design.config` gives it.
        columns: by column name, the whole schema, each (M,) or (M, K).
        code: what made the rows.

    Returns:
        The manifest.
    """
    from sim.effects import catalogue

    effects = sorted(set(config["inputs"]) & set(catalogue()))
    there, key = place(folder), fingerprint({**config, "code": code})
    if there.names():
        raise InputError(f"{there.address} is not empty; give a new folder")
    table = table_of({**columns, "row": np.arange(len(columns["row"]))}, schema(effects, config["sensitivities"]))
    part = write_piece(there, piece_name(ROWS, 0, len(table)), table, key)
    return write_manifest(there, manifest_of(config, key, code, effects, [part]))


def batches(
    folder: Place | str | Path, columns: Sequence[str] | None = None, *, rows: int = 2**16
) -> Iterator[pa.RecordBatch]:
    """The rows of a finished data set in order, `rows` at a time: no more of them than that is in memory.

    Args:
        folder: a folder or URL.
        columns: names; default all.
        rows: most rows of a batch.

    Raises:
        InputError: no finished data set there, or a file is missing, doubled, changed or damaged.

    Example:
        >>> from dataset.storage.data_set import batches
        >>> sum(batch.num_rows for batch in batches("data/sweep", ["omega_yr_bar"]))  # doctest: +SKIP
        8192
    """
    there = place(folder)
    manifest = read_manifest(there)
    form = schema(manifest["effects"], manifest["config"].get("sensitivities", False))
    unknown = sorted(set(columns or ()) - set(form.names))
    if unknown:
        raise InputError(f"no column {unknown[0]!r} in a data set; there are {', '.join(form.names)}")
    _check_files(there, manifest)
    for part in parts_of(manifest):
        piece = Piece(piece_name(ROWS, part.start, part.stop), part.start, part.stop)
        try:
            data = there.read(piece.name)
            if hashlib.sha256(data).hexdigest() != part.sha256:
                raise BadPieceError("it does not have the digest that the manifest states")
            for table in tables(data, piece, form, manifest["config_hash"], columns):
                yield from table.combine_chunks().to_batches(max_chunksize=rows)
        except BadPieceError as bad:
            raise InputError(f"{there.path(piece.name)}: {bad}" + _MEND.format(there.address)) from None


def _check_files(there: Place, manifest: dict[str, Any]) -> None:
    """Refuse missing files and files that the manifest does not know."""
    found = {f"{ROWS}/{name}" for name in there.names(ROWS)}
    listed = {piece_name(ROWS, part.start, part.stop): part.bytes for part in parts_of(manifest)}
    for name in sorted(set(listed) - found):
        raise InputError(f"{there.path(name)} is missing" + _MEND.format(there.address))
    for name in sorted(found - set(listed)):
        raise InputError(
            f"{there.path(name)} is not in the manifest: a copy, or an interrupted build"
            + _MEND.format(there.address)
        )
    for name, size in listed.items():
        if there.size(name) != size:
            raise InputError(f"{there.path(name)} is cut short or longer" + _MEND.format(there.address))


def read(folder: str | Path, columns: Sequence[str] | None = None) -> pd.DataFrame:
    """All rows of a finished data set, in the order of the design.

    Args:
        folder: a folder or URL.
        columns: names; default all.

    Raises:
        InputError: as for `batches`.
    """
    found = list(batches(folder, columns, rows=2**20))
    return pa.Table.from_batches(found).replace_schema_metadata(None).to_pandas()


def usable(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows to learn from: converged, not failed, all outputs finite (touching tails included)."""
    good = rows["converged"] & ~rows["failed"]
    numbers = rows.select_dtypes("number").drop(columns="tail_gap").to_numpy(dtype=float)
    return rows[good.to_numpy(dtype=bool) & np.isfinite(numbers).all(axis=1)]
