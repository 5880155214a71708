"""Tables as text: comma, semicolon, tab or blanks between columns; decimal point or comma; comment lines.

The text of a camera, a spreadsheet or an oscilloscope does not say how it is written. Its first lines show it:

- Encoding: UTF-8, UTF-16 with a byte order mark, otherwise Windows-1252, which contains the letters of Latin-1.
- Lines that begin with # or % are comments. If the columns have no names, and the last comment above them has as
  many words as there are columns, these are the names (as `numpy.savetxt` writes them).
- The separator is that of semicolon, tab and comma which the first line has most often; without any of them,
  blanks.
- Numbers have decimal commas if columns are not separated by commas and a number has one.
- A second line of nothing but units belongs to the names: x above mm is the column "x [mm]".

A text that can be read in two ways is refused.
"""

from __future__ import annotations

import io
import re
import warnings
from collections import Counter
from collections.abc import Sequence

import pandas as pd

from sim.io.errors import InputError
from sim.io.reading import decode
from sim.io.units import find_unit

_COMMENT = re.compile(r"^[ \t]*[#%].*(?:\n|\Z)", re.MULTILINE)
_EMPTY_LINES = re.compile(r"\A(?:[ \t]*\n)+")
_SEPARATORS = (";", "\t", ",")
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+(?:[eE][+-]?\d+)?")
_DECIMAL_POINT = re.compile(r"[+-]?\d*\.\d+(?:[eE][+-]?\d+)?")
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+,\d+|[+-]?\d{1,3}(?:,\d{3})+\.\d+")
_MOST_COLUMNS = 10_000
_SAMPLE = 2**18  # characters from which the form of the text is found out


def parse_table(data: bytes, where: str, *, names: bool = True) -> pd.DataFrame:
    """Parse a table of any of these forms.

    Args:
        data: content of the file.
        where: its name, for messages.
        names: the columns must have names; without, a table of numbers alone has the columns 0, 1, …

    Raises:
        InputError: the text is no table, or can be read in two ways.
    """
    text = _decoded(data, where).replace("\r\n", "\n").replace("\r", "\n")
    comments = _COMMENT.findall(text[:_SAMPLE])
    if comments:
        text = _COMMENT.sub("", text)
    text = _EMPTY_LINES.sub("", text)
    lines = text[:_SAMPLE].split("\n", 2)
    if not lines[0].strip():
        raise InputError(f"{where} is empty; give a table with one row per line")
    separator = max(_SEPARATORS, key=lines[0].count) if any(mark in lines[0] for mark in _SEPARATORS) else None
    words = _words(lines[0], separator)
    if len(words) > _MOST_COLUMNS:
        raise InputError(f"{where} has more than {_MOST_COLUMNS} columns; give a table with one row per line")
    header = not all(is_number(word) for word in words if word)
    columns = words if header else _commented_names(comments, len(words), separator)
    if columns is None and names:
        raise InputError(f"{where} has no names of columns; write them into its first line")
    _check_names(columns or (), where)
    skipped = 1 if header else 0
    units = _words(lines[1], separator) if header and len(lines) > 1 else []
    if columns and len(units) == len(columns) and are_units(units):
        columns = [with_unit(name, unit) for name, unit in zip(columns, units, strict=True)]
        skipped = 2
    decimal = _decimal(text[:_SAMPLE], where, separator)
    return _parsed(text, where, separator, decimal, columns or list(range(len(words))), skipped)


def _parsed(
    text: str, where: str, separator: str | None, decimal: str, columns: Sequence[str | int], skipped: int
) -> pd.DataFrame:
    unnamed = [name or f"column {i + 1}" if isinstance(name, str) else name for i, name in enumerate(columns)]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            return pd.read_csv(
                io.BytesIO(text.encode()),
                sep=separator or r"\s+",
                decimal=decimal,
                header=None,
                names=unnamed,
                skiprows=skipped,
                index_col=False,
                skipinitialspace=True,
                low_memory=False,
            )
    except pd.errors.EmptyDataError:
        raise InputError(f"{where} has no rows; give at least one below the header") from None
    except pd.errors.ParserWarning:
        raise InputError(
            f"{where} has a row with more values than columns; if numbers have decimal commas, separate columns "
            "by semicolons"
        ) from None
    except (pd.errors.ParserError, ValueError) as broken:
        reason = (str(broken).splitlines() or ["unreadable"])[0]
        raise InputError(f"{where} is no CSV table ({reason}); give a header and one row per line") from None


def are_units(words: Sequence[str]) -> bool:
    """Say whether words are units, apart from empty ones."""
    given = [word for word in words if word]
    return bool(given) and all(find_unit(word) is not None and not is_number(word) for word in given)


def with_unit(name: str, unit: str) -> str:
    """Write the unit of a column behind its name."""
    return f"{name} [{unit.strip('[]()')}]" if unit else name


def is_number(word: str) -> bool:
    """Say whether a word is a number, with a decimal point or comma."""
    try:
        float(word.replace(",", "."))
    except ValueError:
        return False
    return True


def _decoded(data: bytes, where: str) -> str:
    try:
        text = decode(data)
    except UnicodeDecodeError:
        try:
            text = data.decode("cp1252")
        except UnicodeDecodeError:
            raise InputError(f"{where} is no text in UTF-8, UTF-16 or Latin-1") from None
    if "\0" in text:
        raise InputError(f"{where} is no text; give a table as text, .xlsx or .parquet")
    return text


def _words(line: str, separator: str | None) -> list[str]:
    return [word.strip().strip('"').strip() for word in line.split(separator)]


def _commented_names(comments: Sequence[str], count: int, separator: str | None) -> list[str] | None:
    """Take names from the last comment, if it has one for each column and no number."""
    if not comments:
        return None
    line = comments[-1].strip().lstrip("#%").strip()
    for mark in (separator, *_SEPARATORS, None):
        words = _words(line, mark)
        if len(words) == count and not any(map(is_number, words)):
            return words
    return None


def _decimal(text: str, where: str, separator: str | None) -> str:
    """Find the decimal mark.

    Raises:
        InputError: there are numbers of both kinds, or with separators of thousands.
    """
    if separator == "," or "," not in text:
        return "."
    words = [word for line in text.split("\n") for word in _words(line, separator) if word]
    thousands = next(filter(_THOUSANDS.fullmatch, words), None)
    if thousands:
        raise InputError(f"{where} has the number {thousands!r}; write numbers without separators of thousands")
    comma = next(filter(_DECIMAL_COMMA.fullmatch, words), None)
    point = next(filter(_DECIMAL_POINT.fullmatch, words), None)
    if comma and point:
        raise InputError(
            f"{where} has numbers with a decimal comma ({comma}) and with a decimal point ({point}); "
            "use one of them"
        )
    return "," if comma else "."


def _check_names(names: Sequence[str], where: str) -> None:
    """Refuse a name that stands above two columns."""
    for name, times in Counter(filter(None, names)).items():
        if times > 1:
            raise InputError(f"{where} has two columns {name!r}; rename or drop one")
