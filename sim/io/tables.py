"""Read tables of any usual kind: text (`sim.io.text_tables`), spreadsheets (.xlsx) and Parquet."""

from __future__ import annotations

import csv
import io
import warnings
import zipfile
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq

from sim.io.errors import InputError
from sim.io.reading import read_bytes
from sim.io.text_tables import check_names, parse_lines, parse_table

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
        names: the columns must have names; otherwise they may be 0, 1, …

    Raises:
        InputError: the file is empty, too large, or it is not a table.
    """
    kind = Path(path).suffix.lower()
    if kind in _PARQUET:
        table = _parquet(Path(path))
    elif kind in _SHEET:
        table = _spreadsheet(path, names)
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
        table = pd.read_parquet(path)
    except (InputError, FileNotFoundError):
        raise
    except Exception as broken:  # a damaged file can raise any error from within the parsers
        raise InputError(f"{path} is no Parquet table ({_reason(broken)})") from None
    check_names(list(map(str, table)), str(path))
    return table


def _spreadsheet(path: str | Path, names: bool) -> pd.DataFrame:
    data = read_bytes(path, MOST_SHEET)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked > MOST_SHEET:
            raise InputError(f"{path} unpacks to more than {MOST_SHEET / 2**20:.0f} MiB; export the table as CSV")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # openpyxl's, of styles and extensions that it leaves out
            formulas, values = (_cells(data, data_only=values) for values in (False, True))
            lines = _lines(formulas, values, path)
    except InputError:
        raise
    except Exception as broken:  # a damaged archive can raise any error from within the parsers
        raise InputError(f"{path} is no spreadsheet in the form .xlsx ({_reason(broken)})") from None
    return parse_lines(lines, str(path), names=names, separator="\t")


def _cells(data: bytes, *, data_only: bool) -> list[tuple[Any, ...]]:
    """Read the cells of the first sheet, with formulas or with the values that were calculated last."""
    import openpyxl  # it takes longer to load than a text to read

    sheet = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=data_only).worksheets[0]
    sheet.reset_dimensions()
    return list(sheet.iter_rows())


def _lines(formulas: list[tuple[Any, ...]], values: list[tuple[Any, ...]], path: str | Path) -> list[str]:
    """Write the cells of a sheet as lines of text, with tabs between them.

    Raises:
        InputError: a formula was never calculated.
    """
    text = io.StringIO()
    writer = csv.writer(text, delimiter="\t", lineterminator="\n")
    for written, row in zip(formulas, values, strict=True):
        for title, formula, cell in zip(values[0], written, row, strict=False):
            if formula.data_type == "f" and cell.value is None:
                raise InputError(
                    f"{path}: column {title.value} has no values: its formulas were never calculated (cell "
                    f"{formula.coordinate}); open the file in a spreadsheet program and save it"
                )
        writer.writerow([_word(cell) for cell in row])
    return text.getvalue().split("\n")


def _word(cell: Any) -> str:
    """Write a cell as text; per cent as such, so that 5 % is not read as 0.05 of another unit."""
    value = cell.value
    if value is None:
        return ""
    if isinstance(value, int | float) and "%" in (cell.number_format or ""):
        return f"{100 * value:.12g}%"
    return " ".join(str(value).splitlines())


def _reason(broken: Exception) -> str:
    """Return the first line of an error."""
    return (str(broken).splitlines() or [type(broken).__name__])[0]
