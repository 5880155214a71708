"""Read tables of any usual kind: text (`sim.io.text_tables`), spreadsheets (.xlsx) and Parquet."""

from __future__ import annotations

import io
import warnings
import zipfile
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq

from sim.io.errors import InputError
from sim.io.reading import read_bytes
from sim.io.text_tables import are_units, parse_table, with_unit

MOST_TEXT = 128 * 2**20  # bytes
MOST_SHEET = 32 * 2**20  # bytes of a spreadsheet, unpacked
MOST_VALUES = 10**8  # of a Parquet table, which a small file may hold
_PARQUET, _SHEET = (".parquet", ".pq"), (".xlsx", ".xlsm")


def read_table(path: str | Path, *, names: bool = True) -> pd.DataFrame:
    """Read a table: Parquet or a spreadsheet if the name ends so, otherwise text.

    The first sheet of a spreadsheet is read. `sim.io.quantities` converts columns to the units that a program
    needs.

    Args:
        path: the file.
        names: the columns must have names; otherwise they may be 0, 1, … (text only).

    Raises:
        InputError: the file is empty, too large, or it is not a table.
    """
    kind = Path(path).suffix.lower()
    if kind in _PARQUET:
        table = _parquet(Path(path))
    elif kind in _SHEET:
        table = _spreadsheet(path)
    else:
        table = parse_table(read_bytes(path, MOST_TEXT), str(path), names=names)
    table = table.rename(columns=lambda name: name.strip() if isinstance(name, str) else name)
    if table.empty:
        raise InputError(f"{path} has no rows; give at least one below the header")
    return table


def _parquet(path: Path) -> pd.DataFrame:
    if path.is_dir():
        raise InputError(f"{path} is a folder; give a file")
    try:
        shape = pq.read_metadata(path)
        if shape.num_rows * shape.num_columns > MOST_VALUES:
            raise InputError(
                f"{path} has {shape.num_rows} rows and {shape.num_columns} columns; give a smaller table"
            )
        return pd.read_parquet(path)
    except (InputError, FileNotFoundError):
        raise
    except Exception as broken:  # a damaged file can raise any error from within the parsers
        raise InputError(f"{path} is no Parquet table ({_reason(broken)})") from None


def _spreadsheet(path: str | Path) -> pd.DataFrame:
    data = read_bytes(path, MOST_SHEET)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > MOST_SHEET:
            raise InputError(f"{path} unpacks to more than {MOST_SHEET / 2**20:.0f} MiB; export the table as CSV")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # openpyxl's, of styles and extensions that it leaves out
            sheet = pd.read_excel(io.BytesIO(data), engine="openpyxl")
        return _without_units_row(sheet.dropna(axis=1, how="all").dropna(how="all"))
    except InputError:
        raise
    except Exception as broken:  # a damaged archive can raise any error from within the parsers
        raise InputError(f"{path} is no spreadsheet in the form .xlsx ({_reason(broken)})") from None


def _reason(broken: Exception) -> str:
    """Return the first line of an error."""
    return (str(broken).splitlines() or [type(broken).__name__])[0]


def _without_units_row(table: pd.DataFrame) -> pd.DataFrame:
    """Move a first row of nothing but units into the names."""
    words = ["" if pd.isna(value) else str(value) for value in table.iloc[0]] if len(table) else []
    if not are_units(words):
        return table
    names = {name: with_unit(str(name), word) for name, word in zip(table.columns, words, strict=True)}
    rows = table.iloc[1:].reset_index(drop=True).rename(columns=names)
    return rows.infer_objects()
