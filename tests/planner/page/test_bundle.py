"""Modules are joined in order, each in a scope of its own; other forms of import and export are refused."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

import planner.page.bundle
from planner.page.bundle import joined, read_module
from tests.planner.page.page_core import node
from tests.processes import LIMIT


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(planner.page.bundle, "FOLDER", tmp_path)
    (tmp_path / "low").mkdir()
    (tmp_path / "low" / "one.js").write_text(
        "/* One. */\nconst own = 1, uno = 1;\nexport { own };\nexport { uno };\n"
    )
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
    assert "/* One. */" not in script
    (folder / "script.cjs").write_text(script)
    process = subprocess.run([node(), str(folder / "script.cjs")], capture_output=True, text=True, timeout=LIMIT)
    assert process.stderr == ""
    assert json.loads(process.stdout) == [1, 2, 5]


@pytest.mark.parametrize(
    "line",
    [
        "export function own() {}",
        'import own from "./low/one.js";',
        "export default 1;",
        "export { own as first };",
        'import "./two.js";',
    ],
)
def test_other_forms_are_refused(folder: Path, line: str) -> None:
    (folder / "other.js").write_text(f"{line}\n")
    with pytest.raises(ValueError, match="cannot be joined"):
        read_module(folder / "other.js")


def test_a_circle_is_refused(folder: Path) -> None:
    (folder / "a.js").write_text('import { b } from "./b.js";\nconst a = b;\nexport { a };\n')
    (folder / "b.js").write_text('import { a } from "./a.js";\nconst b = a;\nexport { b };\n')
    with pytest.raises(ValueError, match=r"a\.js → b\.js"):
        joined("a.js")
