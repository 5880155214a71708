"""Read tables: CSV files with a header, or Parquet."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from pyarrow import ArrowException

from sim.io.errors import InputError


def read_table(path: str | Path, *, comment: str | None = None) -> pd.DataFrame:
    """Read a table: Parquet if the name ends so, otherwise CSV with a header.

    Raises:
        InputError: the file is empty, or it is not a table.
    """
    parquet = Path(path).suffix.lower() in (".parquet", ".pq")
    try:
        table = pd.read_parquet(path) if parquet else pd.read_csv(path, comment=comment)
    except (pd.errors.EmptyDataError, pd.errors.ParserError, UnicodeDecodeError, ArrowException) as broken:
        reason = str(broken).splitlines()[0]
        kind = "Parquet" if parquet else "CSV"
        raise InputError(f"{path} is no {kind} table ({reason}); give a header and one row per line") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; give a CSV or Parquet file") from None
    if table.empty:
        raise InputError(f"{path} has no rows; give at least one below the header")
    return table
