"""The core's files can be joined into one script; each names what it mirrors and has a test; advice fits."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

import planner.page.bundle
from planner.page.bundle import joined, read_module
from tests.planner.page.page_core import FOLDER, answer, answers, node
from tests.processes import LIMIT

ROOT, TESTS = Path(__file__).parents[3], Path(__file__).parent
FILES = {file.stem: file for file in sorted(FOLDER.glob("*.js"))}
IMPORT = re.compile(r'import \{ (\w+(?:, \w+)*) \} from "\./(\w+)\.js";')
IN_PAGE = {"service", "worker"}  # in a browser
OWN = {"arrays", "format"}  # they stand for NumPy and for Python itself
PAGE = {*IN_PAGE, "open_file", "compared_track", "compared_runs", "page_shapes", "advice"}  # of the page alone
TESTED_IN = {
    "test_core": "advice",
    "test_numbers": "arrays close_match draws format lab_units si_units units",
    "test_paths": "distance nearest_feasible page_shapes path pose_equations tractrix",
    "test_lookup": "cubic_spline curve_errors dense dwell_choice ensemble from_table groups heads intervals "
                   "lookup planar refusals response response_table support table_data tails tracked_point vehicle "
                   "wrench_balance wrench_table",
    "test_plans": "declared_path error_growth errors feasible feedback_error fillets line_of_sight plan progress "
                  "remedy request rollout schedule stated_error zigzag",
    "test_plan_files": "compared_track plan_files planned sha256 tracker_header tracking_error",
    "test_robot_files": "input_error robot robot_toml toml",
    "test_drawings": "style_sheet svg_drawing svg_names svg_segments svg_shapes svg_tree xml",
    "test_tables": "file_kinds number_words open_file path_files quantities seals text_tables times",
    "test_runs": "compared_runs copied_rows measured_table",
}  # fmt: skip


def imports_of(name: str) -> set[str]:
    return {other for _, other in IMPORT.findall(FILES[name].read_text())}


@pytest.mark.parametrize("name", FILES)
def test_a_file_can_be_joined_and_names_what_it_mirrors(name: str) -> None:
    text = FILES[name].read_text()
    read_module(FILES[name])
    assert text.startswith("/* ")
    sources = re.findall(r"\b(?:planner|sim|surrogate|calibration)/[\w/]+\.py\b", text.split("*/")[0])
    assert sources or name in OWN | PAGE
    assert all((ROOT / source).exists() for source in sources)


def test_each_file_is_tested() -> None:
    """A test calls the file, or one that imports it."""
    assert sorted(" ".join(TESTED_IN.values()).split()) == sorted(set(FILES) - IN_PAGE)
    for test, names in TESTED_IN.items():
        text = (TESTS / f"{test}.py").read_text()
        reached = {name for name in FILES if f'"{name}.js"' in text or f'("{name}", "' in text}
        while more := set().union(*map(imports_of, reached)) - reached:
            reached |= more
        assert set(names.split()) <= reached, test


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
    told = answers([("advice.js", "inPage", said, SHORT) for said in ADVICE])
    assert told == list(ADVICE.values())
    html = (FOLDER / "view" / "page.html").read_text().replace("\n", " ")
    controls = re.findall(r'"([^"]+)"', " ".join(told))
    assert [name for name in controls if f"{name}<" not in html and f"{name} <" not in html] == []


def test_no_message_of_the_planner_names_an_option_of_the_command() -> None:
    """Whoever adds a message with such advice adds the page's words for it."""
    files = [file for name, file in FILES.items() if name not in ("advice", "robot_toml")]
    texts = [re.sub(r'["`]\s*\+\s*["`]', "", file.read_text()) for file in files]
    option = r'"[^"\n]*--[a-z][^"\n]*"|`[^`\n]*--[a-z][^`\n]*`'
    literals = [literal for text in texts for literal in re.findall(option, text)]
    assert literals
    told = [answer("advice.js", "inPage", literal, SHORT) for literal in literals]
    assert [words for words in told if re.search(r"--[a-z]", words)] == []
