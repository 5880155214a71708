"""Names that command and page share: a constant of JavaScript in planner/page whose value is JSON."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parents[1] / "page"


def shared_names(file: str) -> dict[str, Any]:
    """Read the first object after `const` in a file of the page."""
    text = (_FOLDER / file).read_text(encoding="utf-8")
    content: dict[str, Any] = json.JSONDecoder().raw_decode(text, text.index("{", text.index("const ")))[0]
    return content
