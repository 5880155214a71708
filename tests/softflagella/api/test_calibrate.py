"""Tracks and decisions through the public functions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from sim.io.errors import InputError
from tests.calibration.toy_tables import DRAG, START, ambiguous, on_the_toy, toy_table


def circle_track(run: int, samples: int) -> pd.DataFrame:
    time = np.linspace(0, 120, samples)
    angle = 0.05 * time
    columns: dict[str, Any] = {"run": run, "time_s": time, "x_cm": 9 * np.cos(angle), "y_cm": 9 * np.sin(angle)}
    return pd.DataFrame({**columns, "heading_deg": np.degrees(angle) + 20})


def test_tracks_that_are_left_out_are_warned_of() -> None:
    samples = pd.concat([circle_track(1, 200), circle_track(2, 5)])
    runs = pd.DataFrame({"run": [1, 2], "N": 2, "l_cm": 11.0, "omega_rpm": 43.0})
    with pytest.warns(UserWarning, match="excluded: run 2: 5 samples") as warned:
        table = sf.tracks(samples, runs)
    assert warned[0].filename == __file__
    assert table["R_yr_cm"].round(6).tolist()[0] == 9.0
    assert np.isnan(table["R_yr_cm"].iloc[1])
    assert len(table.attrs["excluded"]) == 1
    assert table.attrs["units"]["v_cm_s"] == "cm/s"


@pytest.mark.slow
def test_new_runs_decide_a_verdict_that_is_at_hand() -> None:
    table = toy_table(1, lengths_cm=(8.0,), **{DRAG: 4.0})
    more = toy_table(2, lengths_cm=(5.0, 11.0), **{DRAG: 4.0}).assign(session="new").sample(8, random_state=1)
    with on_the_toy():
        decision = sf.decide(pd.concat([table, more], ignore_index=True), ambiguous(), START)
    assert decision.new_runs == 8
    assert decision.decided == "head's end-over-end drag"
    assert decision.sentence.startswith("Decided: head's end-over-end drag.")
    assert not sf.Decision(decision.standings[:1] * 2, 8).decided


def test_lengths_of_paths_have_the_unit_that_is_given() -> None:
    with pytest.raises(InputError, match=r"missing\.csv"):
        sf.calibrate("missing.csv", "paper-control", paths=("square:24",), unit="cm")
    with pytest.raises(InputError, match="unit"):
        sf.calibrate("missing.csv", "paper-control", paths=("square:24",))
    with pytest.raises(InputError, match="max_seconds"):
        sf.calibrate("missing.csv", "paper-control", max_seconds=0.0)
