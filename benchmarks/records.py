"""Records of a long benchmark, one JSON object a line, so that it can be interrupted and run in parts."""

from __future__ import annotations

import json
from collections.abc import Hashable
from pathlib import Path
from typing import Any


class Records:
    """Records by the value under `key`, read from a file and appended to it; without one, kept in memory."""

    def __init__(self, file: str = "", *, key: str = "seed"):
        self.file, self.key = Path(file) if file else None, key
        lines = self.file.read_text().splitlines() if self.file and self.file.exists() else []
        self.all: list[dict[str, Any]] = [json.loads(line) for line in lines]

    def __contains__(self, value: Hashable) -> bool:
        return any(record[self.key] == value for record in self.all)

    def add(self, record: dict[str, Any]) -> None:
        """Append a record."""
        self.all.append(record)
        if self.file:
            with self.file.open("a") as lines:
                lines.write(json.dumps(record) + "\n")
