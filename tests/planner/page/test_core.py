"""The core's files can be joined into one script, with Python's constants; advice fits the page."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path

import pytest

import planner.page.bundle
from planner.page.bundle import joined, read_module
from planner.page.constants import constants
from tests.planner.page.page_core import FOLDER, answer, answers, node
from tests.processes import LIMIT

FILES = {file.stem: file for file in sorted(FOLDER.glob("*.js"))}


@pytest.mark.parametrize("name", FILES)
def test_a_file_can_be_joined_and_says_what_it_is(name: str) -> None:
    read_module(FILES[name])
    assert FILES[name].read_text().startswith("/* ")


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
