"""The toy robot in place of the simulator, for the tests that ask for it."""

from __future__ import annotations

import pytest

from tests.calibration.toy_tables import install_few_candidates, install_toy


@pytest.fixture
def toy_model(monkeypatch: pytest.MonkeyPatch) -> None:
    install_toy(monkeypatch)


@pytest.fixture
def few_candidates(monkeypatch: pytest.MonkeyPatch) -> None:
    install_few_candidates(monkeypatch)
