"""Read tables: CSV files with a header, or Parquet."""

from __future__ import annotations

import io
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
from pyarrow import ArrowException

from sim.io.errors import InputError
from sim.io.reading import read_bytes

MOST_CSV = 512 * 2**20  # bytes
MOST_VALUES = 10**8  # of a Parquet table, which a small file may hold


def read_table(path: str | Path, *, comment: str | None = None) -> pd.DataFrame:
    """Read a table: Parquet if the name ends so, otherwise CSV with a header.

    Raises:
        InputError: the file is empty, too large, or it is not a table.
    """
    parquet = Path(path).suffix.lower() in (".parquet", ".pq")
    try:
        table = (
            _parquet(Path(path))
            if parquet
            else pd.read_csv(io.BytesIO(read_bytes(path, MOST_CSV)), comment=comment)
        )
    except (pd.errors.EmptyDataError, pd.errors.ParserError, UnicodeDecodeError, ArrowException) as broken:
        reason = str(broken).splitlines()[0]
        kind = "Parquet" if parquet else "CSV"
        raise InputError(f"{path} is no {kind} table ({reason}); give a header and one row per line") from None
    if table.empty:
        raise InputError(f"{path} has no rows; give at least one below the header")
    return table


def _csv(path: str | Path, comment: str | None) -> pd.DataFrame:
    return pd.read_csv(io.BytesIO(read_bytes(path, MOST_CSV)), comment=comment)


def _parquet(path: Path) -> pd.DataFrame:
    if path.is_dir():
        raise InputError(f"{path} is a folder; give a CSV or Parquet file")
    shape = pq.read_metadata(path)
    if shape.num_rows * shape.num_columns > MOST_VALUES:
        raise InputError(f"{path} has {shape.num_rows} rows and {shape.num_columns} columns; give a smaller table")
    return pd.read_parquet(path)
