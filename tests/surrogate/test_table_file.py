"""Files of look-up tables: they come back as they were, and whatever is wrong with one is refused in one line."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from surrogate import tensor_file
from surrogate.error_modes import CURVE_ERRORS
from surrogate.table import FORMAT, table_content
from surrogate.table_file import SHIPPED, load
from tests.surrogate.small import refusal, rows, table


def test_a_model_comes_back_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    table().save(path)
    again = load(path)
    assert again.identity == table().identity
    assert (again.domain, again.errors) == (table().domain, table().errors)
    robots = rows(256, 13, wide=False).robots
    answer, wanted = (t.query(robots, intervals=True, flag=True) for t in (again, table()))
    assert list(answer) == list(wanted)
    for name, values in wanted.items():
        assert answer[name] == pytest.approx(values, rel=1e-10, nan_ok=True), name


def test_the_same_table_makes_the_same_bytes() -> None:
    content = table_content(load())
    assert tensor_file.packed(content, FORMAT) == tensor_file.packed(content, FORMAT) == SHIPPED.read_bytes()


def test_flipped_bits_are_refused_wherever_they_are(tmp_path: Path) -> None:
    whole, path = SHIPPED.read_bytes(), tmp_path / "changed.safetensors"
    random = np.random.default_rng(5)
    header = 8 + int.from_bytes(whole[:8], "little")
    places = [*range(8), *random.integers(8, header, 60), *random.integers(header, len(whole), 30)]
    for place in places:
        broken = bytearray(whole)
        broken[place] ^= 1 << int(random.integers(8))
        path.write_bytes(broken)
        refusal(path)
    for size in [0, 1, 7, 8, 9, header, len(whole) - 1, *random.integers(len(whole), size=12)]:
        path.write_bytes(whole[:size])
        refusal(path)
    path.write_bytes(whole + b"\0")
    refusal(path)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"C_t,C_r\n1,2\n", "is not a model file"),
        (b"\xff\xfe\x00\x01" * 9, "is not a model file"),
        (b"", "is not a model file"),
        (b"[" * 200_000, "is not a model file"),
        (b"\x02\0\0\0\0\0\0\0{}", "is not a model file"),
        (b"PK\x03\x04" + bytes(200), "older version; train it again"),
    ],
)
def test_what_is_no_model_is_refused(content: bytes, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "m.safetensors"
    path.write_bytes(content)
    assert expected in refusal(path)
    tensor_file.write(path, table_content(load()), FORMAT - 1)
    assert f"has format {FORMAT - 1}, this version reads {FORMAT}; train it again" in refusal(path)


def edited(change: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
    content = copy.deepcopy(table_content(load()))
    change(content)
    return content


EDITS: list[tuple[Callable[[dict[str, Any]], Any], str]] = [
    (lambda c: c["wrench"][1]["state"]["weights.0"].fill(np.nan), "wrench.1.state.weights.0 is not"),
    (lambda c: c["intervals"]["weights"]["v_z"].fill(np.inf), "intervals.weights.v_z is not 78 finite numbers"),
    (lambda c: c["intervals"]["factor"]["v_z"].fill(np.nan), "intervals.factor.v_z is wrong"),
    (lambda c: c["intervals"]["factor"].update(v_z=np.ones(10)), "intervals.factor.v_z is wrong"),
    (lambda c: c.update(wrench=[None] * 3, support=[None] * 3), "it has no networks"),
    (lambda c: c.update(support=[None] * 3), "no complete look-up table; train"),
    (lambda c: c["curves"].pop(), "no complete look-up table; train"),
    (lambda c: c["bases"].pop("lag"), "it has no 'lag'"),
    (lambda c: c["ranges"].pop("omega_bar"), "it has no 'omega_bar'"),
    (lambda c: c["ranges"].update(C_t=[float("nan"), 1.0]), "ranges.C_t is wrong"),
    (lambda c: c.update(errors={}), "it has no 'v_z'"),
    (lambda c: c["wrench"][0]["shape"].update(width=10**12), "wrench.0.shape.width is wrong"),
    (lambda c: c["wrench"][0]["state"].pop("biases.1"), "it has no 'biases.1'"),
    (lambda c: c["support"][2].pop("limit"), "it has no 'limit'"),
    (lambda c: c.update(intervals="wide"), "no complete look-up table; train"),
]


@pytest.mark.parametrize(("change", "expected"), EDITS)
def test_a_content_that_cannot_answer_is_refused_though_its_hash_is_right(
    change: Callable[[dict[str, Any]], Any], expected: str, tmp_path: Path
) -> None:
    path = tmp_path / "m.safetensors"
    tensor_file.write(path, edited(change), FORMAT)
    assert expected in refusal(path)


def test_a_missing_key_is_named(tmp_path: Path) -> None:
    path = tmp_path / "m.safetensors"
    for key in sorted({*table_content(load())} - {CURVE_ERRORS}):
        tensor_file.write(path, edited(lambda content, key=key: content.pop(key)), FORMAT)  # type: ignore[misc]
        assert f"it has no {key!r}" in refusal(path)
