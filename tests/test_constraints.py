"""constraints.txt pins each package by version and hash."""

from __future__ import annotations

import re
from pathlib import Path


def test_each_package_has_a_version_and_hashes() -> None:
    lines = (Path(__file__).parents[1] / "constraints.txt").read_text().splitlines()
    blocks = re.split(r"\n(?=\S)", "\n".join(line for line in lines if line[:1] != "#").strip())
    assert len(blocks) > 100
    for block in blocks:
        assert re.match(r"[\w.\[\]-]+==[0-9][\w.+!]*( ; [^\\]+)? \\\n {4}--hash=sha256:[0-9a-f]{64}\b", block), (
            block
        )
