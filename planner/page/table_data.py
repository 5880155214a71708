"""The numbers of a look-up table as text for the page: lossless, and as small as they get.

    {"identity": hash, "content": the content of a model file, "numbers": text}

Arrays are replaced by {"tensor": shape, "at": place of the first number}. All numbers stand one behind the other
in double precision: first the lowest bytes of all, then the next ones, since only the highest bytes are alike.
They are deflated and written in base 85, with letters that mean nothing in HTML and JSON. `table_data.js` reads
this. The shipped table takes 1.3 MB; in base 64 it would be 90 kB more.
"""

from __future__ import annotations

import json
import zlib
from base64 import b85encode
from collections.abc import Mapping
from typing import Any

import numpy as np

from sim.arrays import Floats
from surrogate.table import NeuralTable, table_content

_LETTERS = str.maketrans("<>&`", ",.:/")  # of RFC 1924, which HTML or a template of JavaScript would read


def table_data(lookup: NeuralTable) -> str:
    """Return the numbers of a table as JSON."""
    content = {name: part for name, part in table_content(lookup).items() if name != "provenance"}
    return packed_data({"identity": lookup.identity, "content": content})


def packed_data(content: Mapping[str, Any]) -> str:
    """Return nested dictionaries and lists of arrays and plain values as JSON."""
    arrays: list[Floats] = []
    plain = _without_arrays(content, arrays)
    numbers = np.concatenate([array.ravel() for array in arrays]) if arrays else np.empty(0)
    by_place = numbers.astype("<f8").view(np.uint8).reshape(-1, 8).T.tobytes()
    return json.dumps({**plain, "numbers": packed_bytes(by_place)}, separators=(",", ":"), allow_nan=False)


def packed_bytes(content: bytes) -> str:
    """Return bytes deflated, in base 85."""
    return b85encode(zlib.compress(content, 9)).decode().translate(_LETTERS)


def _without_arrays(part: Any, arrays: list[Floats]) -> Any:
    """Return `part` as JSON can hold it; its arrays are appended to `arrays`."""
    if isinstance(part, np.ndarray):
        at = sum(array.size for array in arrays)
        arrays.append(np.asarray(part, dtype=float))
        return {"tensor": list(part.shape), "at": at}
    if isinstance(part, Mapping):
        return {name: _without_arrays(value, arrays) for name, value in part.items()}
    if isinstance(part, list | tuple):
        return [_without_arrays(value, arrays) for value in part]
    return part
