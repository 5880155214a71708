"""Tables that people bring: CSV files with a header."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from sim.errors import InputError


def read_table(path: str | Path) -> pd.DataFrame:
    """A CSV table with a header.

    Raises:
        InputError: the file is empty or no table.
    """
    try:
        table = pd.read_csv(path)
    except (pd.errors.EmptyDataError, pd.errors.ParserError, UnicodeDecodeError) as broken:
        reason = str(broken).splitlines()[0]
        raise InputError(f"{path} is no CSV table ({reason}); give a header and one row a line") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder; give a CSV file") from None
    if table.empty:
        raise InputError(f"{path} has no rows; give at least one below the header")
    return table
