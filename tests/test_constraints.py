"""constraints.txt pins all that pyproject.toml names, with hashes."""

from __future__ import annotations

import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest

from tests.processes import LIMIT

ROOT = Path(__file__).parents[1]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())
INSTALLED_EXTRAS = ("dev", "clusters", "docs", "dask", "ray", "s3")


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.fixture(scope="module")
def pins() -> dict[str, str]:
    """Versions and hashes by name of package."""
    text = "\n".join(line for line in (ROOT / "constraints.txt").read_text().splitlines() if line[:1] != "#")
    blocks = re.split(r"\n(?=\S)", text.strip())
    return {canonical(block.partition("==")[0]): block.partition("==")[2] for block in blocks}


def test_each_package_has_a_version_and_hashes(pins: dict[str, str]) -> None:
    assert len(pins) > 100
    for name, pin in pins.items():
        assert re.match(r"[0-9][\w.+!]*( ; [^\\]+)? \\\n {4}--hash=sha256:[0-9a-f]{64}\b", pin), name


def test_all_that_is_installed_by_name_is_pinned(pins: dict[str, str]) -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    requirements = [*PROJECT["project"]["dependencies"], *(r for extra in INSTALLED_EXTRAS for r in extras[extra])]
    names = {canonical(re.match(r"[\w.-]+", requirement)[0]) for requirement in requirements}  # type: ignore[index]
    assert names - {"softflagella"} <= set(pins)


def test_the_build_backend_is_pinned(pins: dict[str, str]) -> None:
    (backend,) = PROJECT["build-system"]["requires"]
    name, _, version = backend.partition("==")
    assert pins[name].split()[0] == version


def test_pins_are_renewed_before_anything_is_installed_by_them(tmp_path: Path) -> None:
    """Pins that contradict pyproject.toml cannot be installed."""
    for name in ("Makefile", "pyproject.toml", "constraints.txt"):
        shutil.copy(ROOT / name, tmp_path)
    make = ["make", "--dry-run", "constraints"]
    steps = subprocess.run(make, cwd=tmp_path, capture_output=True, text=True, check=True, timeout=LIMIT).stdout
    assert "uv.txt" in steps
    assert "pip compile" in steps
    assert "uv pip install" not in steps
