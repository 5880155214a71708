"""Numbers as text are Python's, letter by letter."""

from __future__ import annotations

import struct

import numpy as np

from tests.planner.page.page_core import answers

RNG = np.random.default_rng(0)
SMALL = [0.0, -0.0, 1.0, -2.0, 1e-5, 1e-4, 123456.0, 1234567.0, 1e15, 1e16, 1e21, -1e22, 1e-7, 5e-324, 1.7e308]
TIES = [0.5, 1.5, 2.5, -0.5, 0.125, 0.375, 2.675, 1.005, 1234565.0, 1234575.0, 0.000244140625, 9.5, 99.5, -12.5,
        999999.5, 1000000.5, 0.03125, 9.999995, 6.25e-06, 12345678.5]  # fmt: skip
RANDOM = [
    *(RNG.normal(size=300) * 10.0 ** RNG.integers(-8, 18, 300)).tolist(),
    *(RNG.integers(-(10**6), 10**6, 200) / 2.0 ** RNG.integers(0, 12, 200)).tolist(),
    *[value for (value,) in struct.iter_unpack("d", RNG.bytes(800)) if abs(value) < 1e300],
]
NUMBERS = [*SMALL, *TIES, *RANDOM]


def test_repr() -> None:
    assert answers([("format.js", "repr", value) for value in NUMBERS]) == list(map(repr, NUMBERS))


def test_significant_digits() -> None:
    cases = [(value, digits) for value in NUMBERS for digits in (1, 2, 3, 4, 6, 8)]
    found = answers([("format.js", "general", *case) for case in cases])
    assert found == [f"{value:.{digits}g}" for value, digits in cases]


def test_decimals() -> None:
    cases = [(value, places) for value in NUMBERS for places in (0, 1, 2, 3, 5, 6)]
    found = answers([("format.js", "fixed", *case) for case in cases])
    assert found == [f"{value:.{places}f}" for value, places in cases]


def test_whole_numbers() -> None:
    values = [value for value in NUMBERS if abs(value) < 1e15]
    assert answers([("format.js", "roundHalfEven", value) for value in values]) == [round(v) for v in values]


def test_numbers_are_read_as_python_reads_them() -> None:
    words = ["1", " -2.5 ", "+.5", "3.", "1e5", "1E-3", "1_000", "inf", "-Infinity", "1,5", "", "0x10", "1__0",
             "e5", ".", "1e", "_1", "12 3", "½", "1e400"]  # fmt: skip
    wanted: list[float | None] = []
    for word in words:
        try:
            wanted.append(float(word))
        except ValueError:
            wanted.append(None)
    assert answers([("format.js", "pythonNumber", word) for word in words]) == wanted


def test_texts_in_quotes() -> None:
    texts = [
        "plain",
        "it's",
        '"both" it\'s',
        "a\\b\n\t\r",
        "\x00\x1f\x7f\xa0",
        "ümlaut ∞",
        "1\u202f2\u2009\ufeff",
        "",
    ]
    assert answers([("format.js", "pythonText", text) for text in texts]) == list(map(repr, texts))
