"""The core's files can be joined into one classic script, and each names the Python file that it mirrors."""

from __future__ import annotations

import re
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

from tests.planner.page.page_core import FOLDER

ROOT = Path(__file__).parents[3]
FILES = sorted(FOLDER.glob("*.js"))
NAMES = re.compile(r"\{ (\w+(?:, \w+)*) \}")
IMPORT = re.compile(r'import \{ \w+(?:, \w+)* \} from "\./(\w+\.js)";')
EXPORT = re.compile(r"export \{ \w+(?:, \w+)* \};")
OWN = {"arrays.js", "format.js"}  # they stand for NumPy and for Python itself
PAGE = {
    "service.js",
    "worker.js",
    "open_file.js",
    "compared_track.js",
    "compared_runs.js",
    "page_shapes.js",
    "advice.js",
}  # of the page alone
IN_JOURNEYS = {"service.js", "worker.js"}  # they are tested in a browser
TESTED_WITH = {  # the file that uses them
    "number_words.js": "text_tables",
    "times.js": "text_tables",
    "feedback_error.js": "plan",
    "seals.js": "open_file",
    "style_sheet.js": "svg_drawing",
    "svg_names.js": "svg_drawing",
    "svg_tree.js": "svg_drawing",
}


def names_of(line: str) -> set[str]:
    match = NAMES.search(line)
    assert match is not None
    return set(match[1].split(", "))


def exports_of(file: Path) -> set[str]:
    return {name for line in file.read_text().splitlines() if line.startswith("export") for name in names_of(line)}


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_imports_and_exports_stand_on_lines_of_their_own(file: Path) -> None:
    lines = file.read_text().splitlines()
    assert len(lines) <= 400
    assert not [line for line in lines if len(line) > 115]
    imports = [line for line in lines if re.search(r"\bimport\b(?!ant|s)", line.split("/*")[0].split(" * ")[0])]
    for line in imports:
        match = IMPORT.fullmatch(line)
        assert match is not None, line
        assert names_of(line) <= exports_of(FOLDER / match[1]), line
    exports = [line for line in lines if re.match(r"\s*export\b", line)]
    assert exports or file.name == "worker.js"
    assert all(map(EXPORT.fullmatch, exports))
    for name in exports_of(file):
        assert re.search(rf"^(?:async )?(?:function\*?|const|class) {name}\b", file.read_text(), re.M), name
    for name in {name for line in imports for name in names_of(line)}:
        assert len(re.findall(rf"\b{name}\b", file.read_text())) > 1, f"{name} is imported and not used"


def test_imports_run_one_way() -> None:
    graph = {
        file.name: {match[1] for line in file.read_text().splitlines() if (match := IMPORT.fullmatch(line))}
        for file in FILES
    }
    assert set(TopologicalSorter(graph).static_order()) == set(graph)


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_file_names_what_it_mirrors(file: Path) -> None:
    text = file.read_text()
    assert text.startswith("/* ")
    comment = text.split("*/")[0]
    sources = re.findall(r"\b(?:planner|sim|surrogate|calibration)/[\w/]+\.py\b", comment)
    assert sources or file.name in OWN | PAGE
    assert all((ROOT / source).exists() for source in sources)
    tested = (
        FOLDER.parents[1] / "tests" / "planner" / "page" / f"test_{TESTED_WITH.get(file.name, file.stem)}.py"
    ).exists()
    assert tested or file.name in IN_JOURNEYS
