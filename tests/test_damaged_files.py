"""Every reader, given anything: it ends with a result, or with one line that names the file.

The formats and the mutations are those of `tests.oracles`.
"""

from __future__ import annotations

import copy
import json
import re
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.oracles.file_formats import FORMATS, judged

pytestmark = pytest.mark.slow

CASES, FEW = 40, 5  # mutations of a format; of one whose reader takes more than 10 ms
COSTLY = (
    "camera tracks", "runs of camera tracks", "replayed track", "plan to track", "table of one robot, sealed",
    "model, sealed", "measured runs", "sweep", "plan",
)  # fmt: skip
FILES = {name: form for name, form in FORMATS.items() if form.seal is None}
TEXTS = {name: form for name, form in FILES.items() if form.tokens and name not in {"model", "plan to track"}}

few = settings(
    max_examples=15, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
numbers = st.one_of(st.floats(), st.integers(), st.sampled_from([0, -1, 1e-320, 1e200, 10**400]))
scalars = st.one_of(numbers, st.text(max_size=5), st.booleans(), st.none())
values = st.recursive(
    scalars,
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=4), inner, max_size=3)),
    max_leaves=8,
)


@pytest.mark.parametrize("name", FORMATS)
def test_examples_are_read_and_mutated_files_are_read_or_refused(name: str, tmp_path: Path) -> None:
    form = FORMATS[name]
    path = form.install(tmp_path)
    assert judged(form, path)
    for case in range(FEW if name in COSTLY else CASES):
        data = form.mutated(Random(f"{name} {case}"))
        path.write_bytes(data)
        try:
            judged(form, path)
        except BaseException as error:
            error.add_note(f"case {case} of {name!r}")
            raise
    assert data == form.mutated(Random(f"{name} {case}"))  # the same seed, the same file


@pytest.mark.parametrize("name", TEXTS)
@few
@given(data=st.data())
def test_any_word_in_place_of_a_value(name: str, data: st.DataObject, tmp_path: Path) -> None:
    """A number or a quoted word of a text becomes any other value, as JSON, TOML or a table would write it."""
    form = FORMATS[name]
    path = form.install(tmp_path)
    text = next(iter(form.example().values())).decode()
    places = list(re.finditer(r'"[^"\n]*"|-?\d[\d.e+-]*|\b(?:true|false|null)\b', text[:20_000]))
    place = places[data.draw(st.integers(0, len(places) - 1))]
    written = data.draw(st.one_of(values.map(json.dumps), numbers.map(str), st.text(max_size=8)))
    changed = text[: place.start()] + written + text[place.end() :]
    path.write_bytes(changed.encode("utf-8", errors="surrogatepass"))
    judged(form, path)


@few
@given(data=st.binary(max_size=200))
@pytest.mark.parametrize("name", FILES)
def test_any_bytes(name: str, data: bytes, tmp_path: Path) -> None:
    path = FILES[name].install(tmp_path)
    path.write_bytes(data)
    judged(FILES[name], path)


ONCE = [  # format, pattern, what replaced it: each was another error than an InputError, or did not name the file
    ("robot", r"viscosity_Pa_s = \S+", "viscosity_Pa_s = 1e-320"),
    ("robot", r"radius_mm = \S+", "radius_mm = 1e-320"),
    ("robot", r"count = 2", "count = 2147483648"),
    ("robot", r"count = 2", "count = " + "9" * 400),
    ("corrected robot", r"end_over_end_drag = \S+", "end_over_end_drag = " + "9" * 400),
    ("corrected robot", r"covariance = \[\n\s*\[\S+", "covariance = [[1e308,"),
    ("corrected robot", r"covariance = \[\n\s*\[\S+", f"covariance = [[{'9' * 400},"),
    ("sweep", r"rows = \d+", "rows = 0"),
    ("sweep", r"range = \[[^]]*\]", 'range = "12"'),
    ("sweep", r"range = \[[^,]*", "range = [" + "9" * 400),
    ("path", r"1\.5", "1e308"),
    ("camera tracks", r"time_s", "time"),
    ("camera tracks", r"(?m)^\d,[^,]*,", "1,5,"),
    ("runs of camera tracks", r"\n2,", "\n1,"),
    ("runs of camera tracks", r"run,", "name,"),
    ("measured runs", r"(?s)\n.*", "\n"),
    ("measured runs", r"omega_h_rpm", "omega_hh_rpm"),
    ("region", r",1\n", ",0\n"),
    ("region", r"x,y", "x,\u2028z"),
    ("region", r"x,y", "x,\x0bz"),
    ("drawing", r"C 120", f"C {'1' * 5000}"),
    ("drawing", r"90 30 100", f"90 3{'1' * 5000} 100"),
    ("replayed track", r"\n\d+,[^,]*", "\n1,word"),
    ("replayed track", r"(?s)\n.*", "\n1,0,0,0\n"),
    ("replayed track", r"(?m)^\d+,[^,]*", "1,1e308"),
    ("verdict", r'"covariance": \[\[[^]]*\], ', '"covariance": ['),
    ("verdict", r'"C_t": 3.0', '"C_t": NaN'),
]


@pytest.mark.parametrize(("name", "pattern", "text"), ONCE, ids=range(len(ONCE)))
def test_what_once_ended_otherwise(name: str, pattern: str, text: str, tmp_path: Path) -> None:
    path = FORMATS[name].install(tmp_path)
    changed, times = re.subn(pattern, lambda _: text, path.read_text())
    assert times
    path.write_bytes(changed.encode("utf-8", errors="surrogatepass"))
    assert not judged(FORMATS[name], path)


def _set(name: str, value: Any) -> Callable[[Any], None]:
    """Set the entry of a path of names and numbers, with dots between them."""

    def change(content: Any) -> None:
        *above, last = (int(part) if part.isdigit() else part for part in name.split("."))
        for part in above:
            content = content[part]
        content[last] = value

    return change


FORGED = [
    ("sweep.json, sealed", _set("config.inputs.C_t.range", 3.0)),
    ("sweep.json, sealed", _set("config.inputs.C_t", None)),
    ("sweep.json, sealed", _set("config.history_every", 10**30)),
    ("sweep.json, sealed", _set("config", [])),
    ("sweep.json, sealed", _set("rows_by", 3)),
    ("manifest, sealed", _set("parts.0.start", 0.5)),
    ("manifest, sealed", _set("parts.0.x", 1)),
    ("manifest, sealed", _set("effects", ["no such effect"])),
    ("manifest, sealed", _set("effects", 3)),
    ("table of one robot, sealed", _set("steady.omega_yr_bar", 3.0)),
    ("table of one robot, sealed", _set("steady.other", 3.0)),
    ("table of one robot, sealed", _set("lag.0.0.0", 1e308)),
    ("model, sealed", _set("support.2.factor", True)),
    ("model, sealed", _set("support.2.shift", np.zeros(3))),
    ("model, sealed", _set("intervals.middle", np.zeros(1))),
    ("model, sealed", _set("errors.v_x.rms", "x")),
    ("model, sealed", _set("ranges.N", [float("nan"), float("nan")])),
]


@pytest.mark.parametrize(("name", "change"), FORGED, ids=range(len(FORGED)))
def test_forged_content_that_once_ended_otherwise(
    name: str, change: Callable[[Any], None], tmp_path: Path
) -> None:
    """The hash is right, the content is not; compiled loops read behind the ends of arrays of another shape."""
    form = FORMATS[name]
    assert form.seal is not None
    assert form.content is not None
    path, content = form.install(tmp_path), copy.deepcopy(form.content())
    change(content)
    path.write_bytes(form.seal(content))
    assert not judged(form, path)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_truncated_parquet_file_is_refused(share: float, tmp_path: Path) -> None:
    form = FORMATS["table of robots, Parquet"]
    path = form.install(tmp_path)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))] + data[-8:])
    assert not judged(form, path)
