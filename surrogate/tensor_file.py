"""Nested content in one safetensors file: arrays as tensors, and a manifest in JSON for everything else.

A safetensors file is a header in JSON and then plain numbers; reading it runs no code. The header's metadata have
one text, `manifest`, in JSON:

    format   version of the content
    content  what was written, with {"tensor": NAME} in place of each tensor
    hash     SHA-256 over the content, numbers of the tensors included

So a changed file is refused, whatever was changed in it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy
from safetensors import SafetensorError

from common.errors import InputError
from common.files import whole_file

_REFERENCE = "tensor"
_PICKLED = (b"PK\x03\x04", b"\x80\x02")  # how torch's own files begin


def write(path: str | Path, content: Mapping[str, Any], version: int) -> None:
    """Write nested dictionaries and lists of arrays and plain values, completely or not at all."""
    data = packed(content, version)
    with whole_file(path) as part:
        part.write_bytes(data)


def packed(content: Mapping[str, Any], version: int) -> bytes:
    """Return the bytes of a file."""
    tensors: dict[str, Any] = {}
    plain = _without_tensors(content, "", tensors)
    manifest = {"format": version, "hash": digest(content), "content": plain}
    return safetensors.numpy.save(tensors, {"manifest": _text(manifest)})


def read(path: str | Path, version: int, remedy: str) -> dict[str, Any]:
    """Read the content of a file.

    Raises:
        InputError: the file is of another kind or version, or was changed after it was written.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as blocked:
        raise InputError(f"{path} cannot be read ({blocked.strerror}); {remedy}") from None
    if data.startswith(_PICKLED):
        raise InputError(f"{path} is a model of an older version; {remedy}")
    try:
        tensors = safetensors.numpy.load(data)
        metadata = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])["__metadata__"]
        manifest = json.loads(metadata["manifest"])
        found_version, written, plain = manifest["format"], manifest["hash"], manifest["content"]
    except (SafetensorError, KeyError, TypeError, ValueError, RecursionError, OverflowError, AttributeError):
        raise InputError(f"{path} is not a model file, or is damaged; {remedy}") from None
    # The version comes before the hash: a file of another version was not changed.
    if found_version != version:
        raise InputError(f"{path} has format {str(found_version)[:20]}, this version reads {version}; {remedy}")
    try:
        names: set[str] = set()
        content = _with_tensors(plain, tensors, names)
        # The hash alone is not enough: tensors or entries that it does not cover may have been added.
        unchanged = (
            isinstance(content, dict)
            and names == set(tensors)
            and metadata == {"manifest": _text(manifest)}
            and len(manifest) == 3
            and digest(content) == written
        )
    except (KeyError, TypeError, ValueError, RecursionError):
        unchanged = False
    if not unchanged:
        raise InputError(f"{path} was changed after it was written; {remedy}")
    return content


def digest(content: Any) -> str:
    """Return the hash of nested dictionaries and lists of arrays and plain values."""
    total = hashlib.sha256()

    def take(part: Any) -> None:
        if isinstance(part, np.ndarray):
            total.update(f"(torch.{part.dtype}, {part.shape})".encode())  # the words of the first files
            total.update(part.tobytes())
        elif isinstance(part, Mapping):
            for key in sorted(part):
                total.update(json.dumps(key).encode())
                take(part[key])
        elif isinstance(part, list | tuple):
            total.update(f"[{len(part)}".encode())
            for item in part:
                take(item)
        else:
            total.update(json.dumps(part).encode())

    take(content)
    return total.hexdigest()


def _text(manifest: Any) -> str:
    return json.dumps(manifest, sort_keys=True)


def _without_tensors(part: Any, name: str, tensors: dict[str, Any]) -> Any:
    """Return `part` as JSON; its arrays are put into `tensors` under their places."""
    if isinstance(part, np.ndarray):
        tensors[name] = np.ascontiguousarray(part)
        return {_REFERENCE: name}
    if isinstance(part, Mapping):
        return {key: _without_tensors(value, f"{name}.{key}".lstrip("."), tensors) for key, value in part.items()}
    if isinstance(part, list | tuple):
        return [_without_tensors(value, f"{name}.{i}".lstrip("."), tensors) for i, value in enumerate(part)]
    return part


def _with_tensors(part: Any, tensors: Mapping[str, Any], names: set[str]) -> Any:
    """Rebuild the content; the names of its tensors are put into `names`."""
    if isinstance(part, dict) and set(part) == {_REFERENCE}:
        names.add(part[_REFERENCE])
        return tensors[part[_REFERENCE]].copy()  # one that can be written to, as compiled loops need them
    if isinstance(part, dict):
        return {key: _with_tensors(value, tensors, names) for key, value in part.items()}
    if isinstance(part, list):
        return [_with_tensors(value, tensors, names) for value in part]
    return part
