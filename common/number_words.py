"""Numbers and missing values as people write them: the one rule for the cells of texts, spreadsheets and the page.

- A number has a decimal point or a decimal comma, one of them in the whole table, and no separators of thousands.
- A missing value is an empty cell, dashes, NaN, NA, n/a, null, none, or the error of a formula: #N/A, #DIV/0!,
  #WERT!, Err:502, a row of #.
- Anything else is a word. Words do not change how the other cells of their column are read.
- 1,200 may be 1.2 or 1200. It is 1.2 if a number of its column (0,5) shows that commas are decimal; a number of
  another column shows it where the column has no whole numbers. Otherwise it is refused. So is 1.200 among whole
  numbers in a table with semicolons.
- A text that a spreadsheet would take for a formula (=, +, - or @ first) is written behind an apostrophe, and the
  apostrophe is left out when it is read.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from common.errors import InputError

_EXPONENT = "(?:[eE][+-]?[0-9]+)?"
_NUMBER = re.compile(f"[+-]?(?:[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+){_EXPONENT}|[+-]?(?:inf|infinity)", re.I)
_MISSING = re.compile(
    r"[-–—]*|[+-]?nan(?:\(ind\))?|<?n/?a>?|null|none|[+-]?1\.#[a-z]+|#n/?[avd](?: n/a)?|#\S*[!?]|#{4,}|err:[0-9]+",
    re.I,
)
_PLAIN = re.compile(r"[-+.0-9eE\n]*")
_COMMA = re.compile(f"^[+-]?[0-9]*,[0-9]+{_EXPONENT}$", re.M)
_POINT = re.compile(rf"^[+-]?[0-9]*\.[0-9]+{_EXPONENT}$", re.M)
_THOUSANDS = re.compile(
    r"^[+-]?[0-9]{1,3}(?:(?:\.[0-9]{3})+,[0-9]+|(?:,[0-9]{3})+\.[0-9]+|(?:\.[0-9]{3}){2,}|(?:,[0-9]{3}){2,}"
    r"|(?:[ '’\u00a0\u2009\u202f][0-9]{3})+(?:[.,][0-9]*)?)$",
    re.M,
)
_WHOLE_LINE = re.compile("^[+-]?[0-9]+$", re.M)
_THREE = {mark: re.compile(rf"^[+-]?[1-9][0-9]{{0,2}}[{mark}][0-9]{{3}}$", re.M) for mark in ",."}
_OTHER = {  # what shows that the mark is decimal
    mark: re.compile(rf"^(?![+-]?[1-9][0-9]{{0,2}}[{mark}][0-9]{{3}}$)[+-]?[0-9]*[{mark}][0-9]+{_EXPONENT}$", re.M)
    for mark in ",."
}
_FORMULA = re.compile(r"^'*[=+\-@\t\r]")


def is_number(word: str) -> bool:
    """Say whether a word is a number, with a decimal point or comma."""
    return _NUMBER.fullmatch(word) is not None


def is_missing(word: str) -> bool:
    """Say whether a word stands for a missing value."""
    return _MISSING.fullmatch(word) is not None


def check_marks(columns: Sequence[Sequence[str]], where: str, separator: str) -> None:
    """Refuse numbers that can be read in two ways.

    Args:
        columns: cells, as words.
        where: the table's name, for messages.
        separator: what separates the columns.

    Raises:
        InputError: there are numbers with both decimal marks, or with separators of thousands, or perhaps so.
    """
    texts = ["\n".join(column) for column in columns]
    found = {kind: _first(kind, texts) for kind in (_THOUSANDS, _COMMA, _POINT, _OTHER[","])}
    if found[_THOUSANDS]:
        raise InputError(
            f"{where} has the number {found[_THOUSANDS]!r}; write numbers without separators of thousands"
        )
    if found[_COMMA] and found[_POINT]:
        raise InputError(
            f"{where} has numbers with a decimal comma ({found[_COMMA]}) and with a decimal point "
            f"({found[_POINT]}); use one of them"
        )
    for mark in ",." if separator == ";" else ",":
        for text in texts:
            three = _THREE[mark].search(text)
            alone = mark == "," and not found[_OTHER[","]]
            if three and not _OTHER[mark].search(text) and (alone or _WHOLE_LINE.search(text)):
                word = three[0]
                raise InputError(
                    f"{where} has the number {word!r}, which may be {word.replace(mark, '')} or "
                    f"{word.replace(mark, '.').rstrip('0')}; write it without separators of thousands, or with "
                    "another number of decimals"
                )


def _first(kind: re.Pattern[str], texts: Sequence[str]) -> str | None:
    return next((match[0] for match in map(kind.search, texts) if match), None)


def values_of(words: Sequence[str]) -> np.ndarray:
    """Convert the cells of a column: integers or floats if all are numbers or missing, otherwise words and NaN."""
    plain = "\n".join(words)
    if _PLAIN.fullmatch(plain) and all(words):  # at once; the longest whole numbers are floats
        try:
            values = np.array(words, dtype=float)
        except ValueError:
            pass
        else:
            whole = not set(plain) & set(".eE") and np.abs(values).max() < 2.0**53
            return values.astype(np.int64) if whole else values
    if all(is_number(word) or is_missing(word) for word in words):
        return np.array([np.nan if is_missing(word) else _float(word) for word in words])
    return np.array([_value(word) for word in words], dtype=object)


def plain_numbers(lines: Sequence[str], separator: str, width: int) -> list[np.ndarray] | None:
    """Read lines of plain numbers at once, as `check_marks` and `values_of` would; None where one is different."""
    text = "\n".join(lines).rstrip("\n")
    if separator not in (",", "\t") or text.encode().translate(None, f"0123456789+-.eE\n{separator}".encode()):
        return None
    rows = text.split("\n")
    try:
        values = np.loadtxt(rows, delimiter=separator, comments=None, ndmin=2)
    except ValueError:
        return None
    if values.shape != (len(rows), width):
        return None
    whole = ((np.abs(values) < 2.0**53) & (values == np.trunc(values))).all(0)
    written = np.frombuffer(text.encode(), np.uint8)
    ends, marks = (np.flatnonzero(np.isin(written, [*signs])) for signs in (f"{separator}\n".encode(), b".eE"))
    whole[np.searchsorted(ends, marks) % width] = False  # 2.0 is no integer
    return [column.astype(np.int64) if whole[k] else column for k, column in enumerate(values.T)]


def _float(word: str) -> float:
    return float(word.replace(",", "."))


def _value(word: str) -> Any:
    if is_missing(word):
        return np.nan
    if is_number(word):
        return word.replace(",", ".")
    return plain_text(word)


def plain_text(word: str) -> str:
    """Leave out the apostrophe that `safe_text` wrote."""
    return word[1:] if word.startswith("'") and _FORMULA.match(word) else word


def safe_text(value: Any) -> Any:
    """Write an apostrophe before a text that a spreadsheet would take for a formula; other values stay."""
    risky = isinstance(value, str) and _FORMULA.match(value) and not is_number(value)
    return f"'{value}" if risky else value
