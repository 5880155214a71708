"""A data set on disk: a folder of Parquet parts and a manifest.

    DIR/part-00000.parquet …   one part a chunk of the design, written when the chunk is done
    DIR/manifest.json          configuration and its hash, code and library versions, counts

Each part carries the schema with units and the configuration's hash. A sweep that was interrupted goes on
where it stopped; a folder made by another configuration or another version of the simulator is refused.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from dataset.schema import schema
from sim.io.errors import InputError
from sim.io.files import whole_file, write_text

MANIFEST = "manifest.json"


def part_path(folder: Path, index: int) -> Path:
    return folder / f"part-{index:05d}.parquet"


def write_part(folder: Path, index: int, columns: dict[str, Any], effects: list[str], config_hash: str) -> None:
    """Write one chunk; `columns` must fill the schema."""
    form = schema(effects).with_metadata({"config_hash": config_hash})
    table = pa.table([pa.array(columns[f.name], type=f.type, from_pandas=False) for f in form], schema=form)
    with whole_file(part_path(folder, index)) as part:
        pq.write_table(table, part, compression="zstd")


def part_hash(path: Path) -> str | None:
    """Configuration hash of a part; None when the file is no part."""
    try:
        return (pq.read_schema(path).metadata or {}).get(b"config_hash", b"").decode()
    except (pa.ArrowInvalid, OSError):
        return None


def write_manifest(folder: Path, content: dict[str, Any]) -> None:
    write_text(folder / MANIFEST, json.dumps(content, indent=1) + "\n")


def read_manifest(folder: str | Path) -> dict[str, Any]:
    """The manifest of a finished data set."""
    path = Path(folder) / MANIFEST
    if not path.is_file():
        raise InputError(f"{folder} is no finished data set (no {MANIFEST}); make it with python -m dataset build")
    try:
        content = json.loads(path.read_text())
    except json.JSONDecodeError as broken:
        raise InputError(f"{path} is damaged: {broken}; build the data set anew") from None
    if not isinstance(content, dict) or "config_hash" not in content or "effects" not in content:
        raise InputError(f"{path} is not the manifest of a data set; build the data set anew")
    return content


def read(folder: str | Path) -> pd.DataFrame:
    """All rows of a finished data set, in the order of the design."""
    manifest = read_manifest(folder)
    form = schema(manifest["effects"])
    parts = sorted(Path(folder).glob("part-*.parquet"))
    try:
        tables = [pq.read_table(path) for path in parts]
    except (pa.ArrowInvalid, OSError) as broken:
        raise InputError(f"a part of {folder} is damaged: {broken}; run the build again") from None
    if not tables or any(not t.schema.remove_metadata().equals(form.remove_metadata()) for t in tables):
        raise InputError(f"the parts of {folder} do not have this version's columns; build it anew")
    return pa.concat_tables(tables).to_pandas().sort_values("row", ignore_index=True)


def usable(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows to learn from: converged, not failed, all outputs finite (touching tails included)."""
    good = rows["converged"] & ~rows["failed"]
    numbers = rows.select_dtypes("number").drop(columns="tail_gap").to_numpy(dtype=float)
    return rows[good.to_numpy(dtype=bool) & np.isfinite(numbers).all(axis=1)]
