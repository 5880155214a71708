"""Shared by all tests: one thread for each process, and a folder for the results that several tests need."""

from __future__ import annotations

import os
import shutil

import pytest

for library in ("OMP", "MKL", "OPENBLAS"):  # before any test imports a numerical library
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

from tests.shared import FOLDER  # noqa: E402


def pytest_unconfigure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):  # the process that started the workers ends last
        shutil.rmtree(FOLDER, ignore_errors=True)
