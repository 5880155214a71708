"""A search that ends early: after its processor time or at Ctrl-C, with what it has and a list of what it left."""

from __future__ import annotations

import os
import signal
from typing import Any

import pytest

from calibration.attribution import refits
from calibration.statistics.budget import limited, limited_as_one, skipped, spent, stopped_by_interrupt
from calibration.statistics.fit import fit
from calibration.verdict.record import facts
from calibration.words.render import next_steps
from tests.calibration.toy_tables import DRAG, FEW_CANDIDATES, calibrated, effect, toy_table


def test_limits_end_with_those_around_them() -> None:
    assert not spent()
    with limited(1e6) as outer:
        with limited(-1.0):
            assert spent()
            assert skipped("a drag")
            assert skipped("a drag")
        assert not skipped("a couple")
        with limited_as_one():
            outer.end = 0.0
            assert spent()
    assert outer.not_tried == ["a drag"]
    assert not spent()


def test_a_verdict_without_time_is_provisional() -> None:
    table = toy_table(5, **{DRAG: 5.0})
    verdict = calibrated(table, few=FEW_CANDIDATES, max_seconds=1e-9)
    assert verdict.verdict == "unexplained"
    assert any("end-over-end" in what for what in verdict.not_tried)
    assert verdict.caveats[0].startswith("provisional: the search ended after 0 s of processor time")
    assert all(c.refit is None for c in verdict.found.candidates)
    assert next_steps(facts(verdict))
    assert not effect().not_tried


def test_the_first_interrupt_leaves_a_provisional_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*arguments: Any, **options: Any) -> Any:
        os.kill(os.getpid(), signal.SIGINT)
        return fit(*arguments, **options)

    monkeypatch.setattr(refits, "fit", interrupted)
    with stopped_by_interrupt():
        verdict = calibrated(toy_table(5, **{DRAG: 5.0}), few=FEW_CANDIDATES)
    assert verdict.verdict == "unexplained"
    assert verdict.caveats[0].startswith("provisional: the search ended at Ctrl-C")


def test_further_interrupts_and_those_outside_a_search_end_the_program() -> None:
    before = signal.getsignal(signal.SIGINT)
    with stopped_by_interrupt():
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        with limited(1e6):
            os.kill(os.getpid(), signal.SIGINT)
            assert spent()
            with pytest.raises(KeyboardInterrupt):
                os.kill(os.getpid(), signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before
