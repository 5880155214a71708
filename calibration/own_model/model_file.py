"""A model in a file of Python: it defines MODEL, and may define read(path), which makes the table of a file."""

from __future__ import annotations

import runpy
import sys
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd

from calibration.own_model.declared import Model
from common.errors import InputError, naming
from common.files import write_text
from common.reading import read_bytes

EXAMPLE, EXAMPLE_OF_TRACES = (Path(__file__).with_name(f"{name}.txt") for name in ("falls", "cups"))


def write_example(file: str | Path | None = None, *, traces: bool = False) -> tuple[str, str]:
    """Write a model to start from, of rows or of traces, to a new file; return its name and how to calibrate it.

    Args:
        file: default: falls.py, or cups.py of traces.

    Raises:
        InputError: the file is there already, or cannot be written.
    """
    example = EXAMPLE_OF_TRACES if traces else EXAMPLE
    name = f"{example.stem}.py" if file is None else str(file)
    if Path(name).exists():
        raise InputError(f"{name} is there already; give another name")
    text = example.read_text().replace(f"{example.stem}.py", name)
    write_text(name, text)
    return name, next(line.strip() for line in text.splitlines() if "softflagella calibrate" in line)


def load_model(file: str | Path, table: str | Path) -> tuple[Model, str | Path | pd.DataFrame]:
    """Load the model of a file, and the table: what its `read` makes of it, or as it is.

    Raises:
        InputError: the file cannot be read or run, defines no MODEL, or its `read` makes no table.
    """
    read_bytes(file)
    sys.path.insert(0, str(Path(file).resolve().parent))  # for what it imports
    with _errors_named(file):
        defined = runpy.run_path(str(file))
    model, read = defined.get("MODEL"), defined.get("read")
    if not isinstance(model, Model):
        raise InputError(f"{file} defines no MODEL; write MODEL = sf.Model(…), as `softflagella model` shows")
    return model, table if read is None else _read(read, file, table)


def _read(read: Callable[[str], object], file: str | Path, table: str | Path) -> pd.DataFrame:
    read_bytes(table, first=1)
    with naming(table), _errors_named(file):
        made = read(str(table))
    if not isinstance(made, pd.DataFrame):
        raise InputError(
            f"{file}: read({str(table)!r}) returns {type(made).__name__}; return a DataFrame of pandas"
        )
    made.attrs["name"] = Path(table).name
    return made


@contextmanager
def _errors_named(file: str | Path) -> Iterator[None]:
    """Turn an error in a file into one line with the file and the line."""
    try:
        yield
    except InputError:
        raise
    except SyntaxError as error:
        raise InputError(f"{error.filename}, line {error.lineno}: {error.msg}") from None
    except (Exception, SystemExit) as error:
        frames = traceback.extract_tb(error.__traceback__)
        within = [frame.lineno for frame in frames if Path(frame.filename) == Path(file)]
        line = f", line {within[-1]}" if within else ""
        raise InputError(f"{file}{line}: {type(error).__name__}: {error}") from error
