"""The page's file is the same each time, without connections; its script is the core's files joined; advice."""

from __future__ import annotations

import json
import re
import subprocess
import zlib
from base64 import b85decode
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planner.page.bundle
import softflagella as sf
from common.errors import InputError, run_command
from planner.page.bundle import joined, read_module
from planner.page.constants import constants
from planner.vehicle.from_table import both_directions
from softflagella.__main__ import main
from tests.planner.page.cases import shipped
from tests.planner.page.page_core import FOLDER, answer, answers, node
from tests.planner.plans import BIASED, own_table
from tests.processes import LIMIT


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
        "tolerance": pytest.approx(5.5), "timeWeight": 0.0, "keepOut": "", "walls": "",
            "start": "", "goal": "", "smooth": None}}  # fmt: skip
    shape = data["shapes"][0]
    assert (shape["name"], shape["closed"]) == ("mine", True)
    assert np.hypot(*np.array(shape["points"]).T) == pytest.approx(22.0)
    assert "<title>&lt;Tank &amp; 1&gt;</title>" in page.read_text()


@pytest.mark.rest
def test_a_robot_with_an_effect_is_locked_and_small(tmp_path: Path) -> None:
    page = sf.write_page(tmp_path / "page.html", BIASED, lookup=own_table())
    data = data_of(page)
    assert "left_right_bias" in data["locked"]["why"]
    assert page.stat().st_size < 0.52e6


def test_of_a_table_without_errors_of_the_response_the_vehicle_is_written(tmp_path: Path) -> None:
    robot, lookup = sf.load_robot("paper-control"), replace(shipped(), curve_errors=None)
    page = sf.write_page(tmp_path / "page.html", robot, lookup=lookup)
    data = data_of(page)
    assert "one error for all robots" in data["locked"]["why"]
    assert [entry["name"] for entry in data["robots"]] == ["paper-control"]
    errors = lookup.error_modes(both_directions(robot.group_values())).twist
    assert len(data["planner"]["table"]["vehicle"]["errors"]) == len(errors)
    assert page.stat().st_size < 0.52e6


BUGGY = sf.Vehicle(
    speed=(0.25, 0.005), turn_left=(0.7, 0.02), turn_right=(0.6, 0.02), lag=0.2, name="buggy & <co>"
)


def test_the_page_of_a_measured_vehicle_has_its_numbers_and_no_look_up_table(tmp_path: Path) -> None:
    page = sf.write_page(tmp_path / "page.html", BUGGY, paths=["circle:90cm"])
    data, wanted = data_of(page), sf.plan("circle:90cm", BUGGY)
    (robot,) = data["robots"]
    assert dict(robot["fields"]["measured"]) == BUGGY.to_dict()
    assert data["planner"]["table"] is None
    assert (data["limits"], data["locked"]["name"]) == ({}, BUGGY.name)
    assert data["first"]["plan"]["stated"] == pytest.approx(100 * BUGGY.length_scale * wanted.stated_error)
    assert "Vehicle buggy &amp; &lt;co&gt;." in page.read_text()
    assert page.stat().st_size < 0.25e6


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("speed_cm_s = fast", "Invalid value (at line 2"),
        ("speed_cm_s = 0", "speed = 0 ± 0; give a number above 0"),
        ("speed_cm = 3", "speed_cm is no line of a vehicle"),
        ("", "turn_left_deg_s is in no table"),
    ],
)
def test_a_damaged_vehicle_is_refused_in_one_line(
    line: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(main, ["robot", "vehicle", "--out", "vehicle.toml"]) == 0
    lines = Path("vehicle.toml").read_text().splitlines()
    damaged = [line if each.startswith("speed") else each for each in lines]
    Path("vehicle.toml").write_text("\n".join(damaged))
    capsys.readouterr()
    assert run_command(main, ["page", "--robot", "vehicle.toml", "--out", "page.html"]) == 2
    (refusal,) = capsys.readouterr().err.splitlines()
    assert words in refusal
    assert not Path("page.html").exists()


def test_a_vehicle_has_no_options_of_a_look_up_table(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="is a measured vehicle; it needs no look-up table"):
        sf.write_page(tmp_path / "page.html", BUGGY, own_table=True)


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


FILES = {file.stem: file for file in sorted(FOLDER.glob("*.js"))}


def test_each_constant_of_python_is_used_and_each_that_is_used_is_pythons() -> None:
    text = "\n".join(file.read_text() for file in FILES.values())
    taken = {(group, word.split(":")[0].strip())
             for names, group in re.findall(r"\{ ([^{}]*) \} = CONSTANTS\.(\w+)", text)
             for word in names.split(",")}  # fmt: skip
    assert taken == {(group, name) for group, names in constants().items() for name in names}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(planner.page.bundle, "FOLDER", tmp_path)
    (tmp_path / "low").mkdir()
    one = "/* 1 */\nconst own = 1, uno = 1;\nexport { own };\nexport { uno };\n"
    (tmp_path / "low" / "one.js").write_text(one)
    (tmp_path / "two.js").write_text(
        'import { own, uno } from "./low/one.js";\nconst both = own + uno;\nexport { both };\n'
    )
    return tmp_path


def test_a_joined_script_does_what_its_modules_do(folder: Path) -> None:
    (folder / "main.js").write_text(
        'import { both } from "./two.js";\nimport { uno } from "./low/one.js";\n'
        "const own = 5;\nconsole.log(JSON.stringify([uno, both, own]));\n"
    )
    script = joined("main.js")
    assert script.count("const own = 1, uno") == 1
    assert "/* 1 */" not in script
    (folder / "script.cjs").write_text(script)
    process = subprocess.run([node(), str(folder / "script.cjs")], capture_output=True, text=True, timeout=LIMIT)
    assert process.stderr == ""
    assert json.loads(process.stdout) == [1, 2, 5]


def test_other_forms_and_circles_are_refused(folder: Path) -> None:
    for line in ("export function own() {}", 'import own from "./low/one.js";', "export default 1;",
                 'import "./two.js";', "export { own as first };"):  # fmt: skip
        (folder / "other.js").write_text(f"{line}\n")
        with pytest.raises(ValueError, match="cannot be joined"):
            read_module(folder / "other.js")
    (folder / "a.js").write_text('import { b } from "./b.js";\nconst a = b;\nexport { a };\n')
    (folder / "b.js").write_text('import { a } from "./a.js";\nconst b = a;\nexport { b };\n')
    with pytest.raises(ValueError, match=r"a\.js → b\.js"):
        joined("a.js")


SHORT = {"tailLength": 0.11}
NUMBERS = 'under "Corners as numbers; move, scale, turn"'
OUTSIDE = "robot 'a' is outside the look-up table: motor speed 9 rpm; "
ADVICE = {
    "by 1 mm: give --smooth 0.03l": 'by 1 mm: set "Smooth over" to 0.33 cm and press "Smooth this path"',
    "too tight; scale the path by 1.5": f"too tight; scale it by 1.5 {NUMBERS}",
    "at most 12000 l can be planned; scale it": f"at most 12000 l can be planned; scale it {NUMBERS}",
    f"{OUTSIDE}change the robot, or simulate it (softflagella steady, softflagella surrogate robot)":
        f'{OUTSIDE}change it under "Robot"',
    "allow more, or make a table of this robot with softflagella surrogate robot":
        'allow more under "Largest stated error"',
    "round it, or allow corner = nearest": 'round it, or choose another answer to "Corners that are too tight"',
    "viscosity = -1; it must be above 0": "viscosity = -1; it must be above 0",
}  # fmt: skip


def test_advice_names_controls_of_the_page() -> None:
    told = answers([("words.js", "inPage", said, SHORT) for said in ADVICE])
    assert told == list(ADVICE.values())
    html = (FOLDER / "view" / "page.html").read_text().replace("\n", " ")
    controls = re.findall(r'"([^"]+)"', " ".join(told))
    assert [name for name in controls if f"{name}<" not in html and f"{name} <" not in html] == []


def test_no_message_of_the_planner_names_an_option_of_the_command() -> None:
    """Whoever adds a message with such advice adds the page's words for it."""
    files = [file for name, file in FILES.items() if name not in ("words", "robot")]
    texts = [re.sub(r'["`]\s*\+\s*["`]', "", file.read_text()) for file in files]
    option = r'"[^"\n]*--[a-z][^"\n]*"|`[^`\n]*--[a-z][^`\n]*`'
    literals = [literal for text in texts for literal in re.findall(option, text)]
    assert literals
    told = [answer("words.js", "inPage", literal, SHORT) for literal in literals]
    assert [words for words in told if re.search(r"--[a-z]", words)] == []
