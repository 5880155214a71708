"""The file of the page: the same each time, without connections; robots that it cannot change are locked."""

from __future__ import annotations

import json
import re
import zlib
from base64 import b85decode
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softflagella as sf
from planner.vehicle.from_table import both_directions
from sim.io.errors import run_command
from softflagella.__main__ import main
from tests.planner.page.cases import shipped
from tests.planner.plans import BIASED, own_table


def data_of(page: Path) -> dict:
    """Read the data of a page, its first plan unpacked."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page.read_text(), re.DOTALL)
    assert found is not None
    data = dict(json.loads(found[1]))
    packed = b85decode(data["first"]["plan"].translate(str.maketrans(",.:/", "<>&`")))
    data["first"]["plan"] = json.loads(zlib.decompress(packed))
    return data


def test_the_same_input_gives_the_same_bytes_and_a_policy_without_connections(tmp_path: Path) -> None:
    first, again = (sf.write_page(tmp_path / name).read_bytes() for name in ("a.html", "b.html"))
    assert first == again
    text = first.decode()
    policy = re.search(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert policy is not None
    assert policy[1].startswith("default-src 'none'; script-src 'sha256-")
    assert "unsafe" not in policy[1]
    assert not re.search(r"""(?:src|href)=["']?(?:https?:)?//""", text)


def test_paths_and_options_are_what_the_page_begins_with(tmp_path: Path) -> None:
    options: dict[str, Any] = {"objective": "flips", "tolerance": 0.5, "title": "<Tank & 1>"}
    page = sf.write_page(tmp_path / "page.html", paths={"mine": sf.circle(2.0)}, **options)
    data = data_of(page)
    first = data["first"].pop("plan")
    wanted = sf.plan(sf.circle(2.0), sf.load_robot("paper-control"), objective="flips", tolerance=0.5)
    assert first["stated"] == pytest.approx(11 * wanted.stated_error)
    assert np.array(first["motion"]) == pytest.approx(wanted.poses * [11, 11, 1], abs=1e-3)
    assert data["first"] == {"robot": "paper-control", "shape": "mine", "options": {
        "objective": "flips", "corner": "nearest", "point": "head_centre", "minimumSeconds": None,
        "tolerance": pytest.approx(5.5), "timeWeight": 0.0, "smooth": None}}  # fmt: skip
    shape = data["shapes"][0]
    assert (shape["name"], shape["closed"]) == ("mine", True)
    assert np.hypot(*np.array(shape["points"]).T) == pytest.approx(22.0)
    assert "<title>&lt;Tank &amp; 1&gt;</title>" in page.read_text()


@pytest.mark.rest
def test_a_robot_with_an_effect_is_locked_and_small(tmp_path: Path) -> None:
    page = sf.write_page(tmp_path / "page.html", BIASED, lookup=own_table())
    data = data_of(page)
    assert "left_right_bias" in data["locked"]["why"]
    assert page.stat().st_size < 0.5e6


def test_of_a_table_without_errors_of_the_response_the_vehicle_is_written(tmp_path: Path) -> None:
    robot, lookup = sf.load_robot("paper-control"), replace(shipped(), curve_errors=None)
    page = sf.write_page(tmp_path / "page.html", robot, lookup=lookup)
    data = data_of(page)
    assert "one error for all robots" in data["locked"]["why"]
    assert [entry["name"] for entry in data["robots"]] == ["paper-control"]
    errors = lookup.error_modes(both_directions(robot.group_values())).twist
    assert len(data["planner"]["table"]["vehicle"]["errors"]) == len(errors)
    assert page.stat().st_size < 0.5e6


def test_bad_input_ends_in_one_line_and_leaves_no_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for words in ("--robot nobody", "--path squre:3l", "--tolerance -1cm", "--minimum-seconds nan"):
        assert run_command(main, ["page", *words.split(), "--out", str(tmp_path / "page.html")]) == 2
        assert len(capsys.readouterr().err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_paths_have_the_names_of_their_shapes_and_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my path.csv").write_text("x,y\n0,0\n3,0\n3,2\n")
    words = ["page", "--path", "circle:1.5l", "--path", "my path.csv", "--unit", "l", "--out", "p.html"]
    assert run_command(main, words) == 0
    shapes = data_of(Path("p.html"))["shapes"]
    assert [shape["name"] for shape in shapes[:3]] == ["circle:1.5l", "my path", "circle"]
