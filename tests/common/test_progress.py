"""Work that tells nothing is seen: a bar that ticks on a terminal, lines in a log, with a forecast."""

from __future__ import annotations

import io
import sys
from time import sleep

import pytest

from common.progress import progress_bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("stream", [Terminal(), io.StringIO()], ids=["terminal", "log"])
def test_silent_work_is_seen(stream: io.StringIO, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stderr", stream)
    monkeypatch.setattr("common.progress._TICK", 0.05)
    monkeypatch.setattr("common.progress._LOGGED", 0.1)
    with progress_bar("tour", total=4, unit="way", ncols=80) as bar:
        bar.update(1)
        sleep(0.4)
    shown = stream.getvalue()
    assert "tour:  25%" in shown
    assert "1/4 [00:00<00:0" in shown  # elapsed, and what is left
    assert ("\r" in shown) == stream.isatty()
    assert stream.isatty() or 1 < shown.count("\n") <= 4


def test_a_hidden_bar_and_short_work_say_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    for options in ({"disable": True}, {}):
        with progress_bar("rows", total=2, **options) as bar:
            bar.update(2)
    assert capsys.readouterr().err == ""
