"""Shared by all tests: one thread for each process, modules compiled once, results that several tests need."""

from __future__ import annotations

import gc
import os
import shutil
import sys
from collections.abc import Iterator

import pytest

for library in ("OMP", "MKL", "OPENBLAS"):  # before any test imports a numerical library
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # each process would compile all modules again
sys.dont_write_bytecode = False

from tests.shared import FOLDER  # noqa: E402


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect no garbage among all that is imported here and stays."""
    gc.disable()
    yield
    gc.freeze()
    gc.enable()


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):  # the process that started the workers ends last
        shutil.rmtree(FOLDER, ignore_errors=True)
