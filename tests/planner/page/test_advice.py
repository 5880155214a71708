"""What the planner advises is said in the words of the page's controls."""

from __future__ import annotations

import re

import pytest

from tests.planner.page.page_core import FOLDER, answer, answers

ROBOT = {"tailLength": 0.11}
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


@pytest.mark.parametrize("said", ADVICE)
def test_advice_names_controls_of_the_page(said: str) -> None:
    told = answer("advice.js", "inPage", said, ROBOT)
    assert told == ADVICE[said]
    controls = re.findall(r'"([^"]+)"', told)
    html = (FOLDER / "view" / "page.html").read_text().replace("\n", " ")
    assert [name for name in controls if f"{name}<" not in html and f"{name} <" not in html] == []


def test_no_message_of_the_planner_names_an_option_of_the_command() -> None:
    """Whoever adds a message with such advice adds the page's words for it."""
    files = [file for file in FOLDER.glob("*.js") if file.name not in ("advice.js", "robot_toml.js")]
    joined = [re.sub(r'["`]\s*\+\s*["`]', "", file.read_text()) for file in files]
    option = r'"[^"\n]*--[a-z][^"\n]*"|`[^`\n]*--[a-z][^`\n]*`'
    literals = [literal for text in joined for literal in re.findall(option, text)]
    assert literals
    told = answers([("advice.js", "inPage", literal, ROBOT) for literal in literals])
    assert [words for words in told if re.search(r"--[a-z]", words)] == []
