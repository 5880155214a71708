"""Tables as people bring them: refused, mended, or closed with a weaker conclusion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from calibration.statistics.statistical_model import SESSION_SHARE
from calibration.statistics.study import middle_session
from calibration.swimmer.measured_table import read_measurements
from calibration.swimmer.protocols import PROTOCOLS
from calibration.swimmer.swimmer import SwimmerModel
from calibration.verdict.calibrate import calibrate
from calibration.verdict.verdict_json import verdict_record
from sim.io.errors import InputError, run_command
from tests.calibration import toy
from tests.calibration.toy_tables import FEW_DRAWS, START, calibrated, calibrated_toy, toy_table
from tests.page_text import PageText


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda t: t.drop(columns="omega_rpm"), "no column 'omega_rpm'"),
        (lambda t: t.assign(omega_h_rad_s=1), "omega_h_rpm and omega_h_rad_s are the same quantity"),
        (lambda t: t.drop(columns=["omega_yr_rad_s", "R_yr_cm", "theta_deg"]), "at least two outputs"),
        (lambda t: t.drop(columns=["omega_h_rpm", "omega_t_rpm", "R_yr_cm", "theta_deg"]), "at least two outputs"),
        (lambda t: t.head(10), "usable runs"),
        (lambda t: t[t["trial"] == 1], "repeated runs|usable runs"),
        (lambda t: t.assign(omega_h_rpm=-t["omega_h_rpm"]), "wrong sign .*: the head turns against the motor"),
        (lambda t: t.assign(omega_yr_rad_s=-t["omega_yr_rad_s"]), "wrong sign .* to the left"),
        (lambda t: t.assign(omega_yr_rad_s=0.05 * np.sign(t["omega_rpm"])), "does not differ between repeats"),
        (lambda t: t.assign(R_yr_cm=1000 * t["R_yr_cm"]), "check its unit"),
        (lambda t: t.head(3), "3 usable runs"),
        (lambda t: t.assign(R_yr_cm="far"), "0 usable runs"),
    ],
)
def test_bad_tables_are_refused(
    change: object, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import re

    from calibration.__main__ import main

    table = change(toy_table(1))  # type: ignore[operator]
    table.to_csv(tmp_path / "t.csv", index=False)
    words = ["calibrate", str(tmp_path / "t.csv"), "--robot", "paper-measured", "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 2
    error = capsys.readouterr().err.splitlines()
    assert len(error) == 1
    assert re.search(expected, error[0])
    assert not (tmp_path / "out").exists()


def test_bad_rows_are_named_and_set_aside(toy_model: None) -> None:
    table = toy_table(2).astype({"omega_yr_rad_s": object})
    table.loc[0, "omega_yr_rad_s"] = "fast"
    table.loc[1, "theta_deg"] = np.nan
    table.loc[2, "omega_h_rpm"] *= -1
    data = read_measurements(table)
    assert len(data) == len(table) - 3
    assert [line.split(":")[0] for line in data.excluded] == ["row 1", "row 2", "row 3"]
    assert read_measurements(table.assign(colour="red")).excluded[-1] == "column colour: not known, left out"
    with pytest.raises(InputError, match="unknown"):
        read_measurements(table.rename(columns={"trial": "tri al"}))


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize("names", [("one",), pytest.param(("one", "two"), marks=pytest.mark.rest)])
def test_few_sessions_give_a_weaker_conclusion(names: tuple[str, ...]) -> None:
    table = toy_table(5, end_over_end_drag=5.0)
    table["session"] = [names[i % len(names)] for i in range(len(table))]
    data = read_measurements(table)
    locked = middle_session(data)
    assert 0.15 < locked.mean() < 0.35
    within = table["session"].to_numpy()
    for condition in np.unique(data.condition):
        for name in names:  # repeats of a session stay together
            assert len(set(locked[(data.condition == condition) & (within == name)])) <= 1
    result = calibrated(table)
    assert result.effects == ("end_over_end_drag",)
    assert any(f"{len(names)} session" in limit for limit in result.conditions.caveats)
    assert "block" in result.conditions.split.names


@pytest.mark.usefixtures("toy_model")
def test_two_sessions_kept_whole_are_not_called_blocks() -> None:
    """The paper's protocol locks N = 2 and 5; where these are a session, none is divided."""
    table = toy_table(5)
    table["session"] = np.where(table["N"].isin((3, 4)), "inner", "outer")
    data, held_out = PROTOCOLS["paper"](read_measurements(table))
    result = calibrate(
        SwimmerModel(START, data, solver=toy.SOLVER), held_out=held_out, draws=FEW_DRAWS, progress=False
    )
    assert result.conditions.split.names == "outer"
    assert not any("sessions only" in limit for limit in result.conditions.caveats)


@pytest.mark.usefixtures("toy_model")
def test_what_shifts_all_runs_of_a_single_session_is_no_evidence() -> None:
    shifted = toy_table(5).assign(session="one")
    shifted["R_yr_cm"] *= 1.03
    shifted["omega_h_rpm"] *= 0.98
    result = calibrated(shifted)
    assert result.verdict == "none"
    assert result.base.noise.share == SESSION_SHARE


@pytest.mark.usefixtures("toy_model")
def test_robots_of_one_kind_are_closed_with_both_limits() -> None:
    table = pd.concat([t[t["N"] == 3] for t in (toy_table(5), toy_table(6))])
    result = calibrated(table)
    assert result.verdict == "none"
    assert [("N = 3" in limit, "1 session only" in limit) for limit in result.conditions.caveats] == [
        (True, False),
        (False, True),
    ]


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize(
    "kept",
    [
        ("R_yr_cm", "theta_deg"),
        pytest.param(("omega_h_rpm", "omega_yr_rad_s"), marks=pytest.mark.rest),
        pytest.param(("omega_t_rpm", "omega_yr_rad_s"), marks=pytest.mark.rest),
    ],
)
def test_any_two_outputs_are_enough(kept: tuple[str, str]) -> None:
    table = toy_table(5, end_over_end_drag=5.0)
    outputs = [
        c for c in ("omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg") if c not in kept
    ]
    result = calibrated(table.drop(columns=outputs))
    assert result.verdict in {"effect", "ambiguous"}
    assert "end_over_end_drag" in result.effects


@pytest.mark.usefixtures("toy_model")
def test_a_slipped_decimal_point_is_named_and_set_aside() -> None:
    """The run, not its repeat."""
    table = toy_table(12)
    table.loc[17, "omega_yr_rad_s"] *= 10
    result = calibrated(table)
    assert [line.split(" is ")[0] for line in result.conditions.excluded] == ["row 18: omega_yr"]
    assert not result.conditions.split.fitted[17]


@pytest.mark.usefixtures("toy_model", "few_candidates")
def test_mistracked_runs_have_little_weight_and_are_named() -> None:
    table = toy_table(5, end_over_end_drag=5.0)
    clean = calibrated(table)
    rng = np.random.default_rng(0)
    mistracked = np.flatnonzero(rng.random(len(table)) < 0.05)
    for run in mistracked:
        table.loc[run, "R_yr_cm"] *= 1 + rng.uniform(0.1, 0.3)
    result = calibrated(table)
    assert result.effects == clean.effects == ("end_over_end_drag",)
    assert clean.conditions.little_weight == ()
    assert set(result.conditions.little_weight) <= set((mistracked + 1).tolist())
    assert len(result.conditions.little_weight) >= 2
    assert any("have a weight below one half" in line for line in result.conditions.caveats)
    record = verdict_record(result, table="t")
    assert record["rows_of_little_weight"] == list(result.conditions.little_weight)


@pytest.mark.rest
@pytest.mark.usefixtures("toy_model")
def test_the_verdict_is_that_of_the_table_without_the_slipped_decimal_point() -> None:
    table = toy_table(12)
    table.loc[17, "omega_yr_rad_s"] *= 10
    result = calibrated(table)
    without = calibrated(table.drop(index=17))
    assert result.verdict == without.verdict
    assert result.noise_ceiling == pytest.approx(without.noise_ceiling, rel=0.05)


@pytest.mark.slow
def test_noise_and_missing_effects_are_no_gross_errors() -> None:
    assert calibrated_toy(5, end_over_end_drag=5.0).conditions.excluded == ()


@pytest.mark.usefixtures("toy_model", "few_candidates")
def test_half_of_a_table_does_not_go_missing_without_a_word(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The spins of the camera without their sign: one line named row 1."""
    from calibration.__main__ import main

    table = toy_table(3)
    table["omega_h_rpm"] = table["omega_h_rpm"].abs()
    count, wrong = len(table), int((table["omega_rpm"] > 0).sum())
    table.to_csv(tmp_path / "t.csv", index=False)
    words = ["calibrate", str(tmp_path / "t.csv"), "--robot", "paper-measured", "--out", str(tmp_path / "out")]
    assert run_command(main, words) == 0
    printed = capsys.readouterr()
    reason = "omega_h_rpm has the wrong sign for its omega_rpm: the head turns against the motor"
    for text in (printed.out, printed.err):
        assert f"excluded: {wrong} of {count} rows (rows " in text
        assert reason in text
    assert f"the conclusion is weaker: {wrong} of {count} rows (50 %) were excluded" in printed.out
    seen = PageText(tmp_path / "out" / "report.html").text
    assert f"Excluded: {wrong} of {count} rows:" in seen
    assert reason in seen


@pytest.mark.usefixtures("toy_model")
def test_an_output_that_follows_from_others_is_counted_once() -> None:
    table = toy_table(14)
    table["v_cm_s"] = table["R_yr_cm"] * table["omega_yr_rad_s"].abs()
    data = read_measurements(table)
    assert "v" not in data.outputs
    assert any("v_cm_s: follows from" in line for line in data.excluded)


@pytest.mark.usefixtures("toy_model")
def test_runs_of_one_robot_give_a_weaker_conclusion_that_is_stated() -> None:
    table = toy_table(15)
    table = pd.concat([table[table["N"] == 3]] * 2, ignore_index=True)
    table["session"] = np.repeat(["a", "b", "c", "d"], len(table) // 4)
    noise = np.random.default_rng(0).normal(scale=0.02, size=len(table))
    table["omega_yr_rad_s"] *= np.exp(noise)
    result = calibrated(table)
    assert any("N = 3" in line for line in result.conditions.caveats)
    assert verdict_record(result, table="t")["limits"] == list(result.conditions.caveats)


@pytest.mark.rest
@pytest.mark.usefixtures("toy_model")
def test_the_papers_protocol_fits_three_and_four_tails_and_predicts_two_and_five() -> None:
    data, held_out = PROTOCOLS["paper"](read_measurements(toy_table(16, end_over_end_drag=5.0)))
    assert data.outputs == ("omega_h", "omega_yr")
    assert set(data.tails[held_out]) == {2.0, 5.0}
    result = calibrate(
        SwimmerModel(START, data, solver=toy.SOLVER), held_out=held_out, draws=FEW_DRAWS, progress=False
    )
    assert result.conditions.split.names == "N=2, N=5"
    assert "end_over_end_drag" in result.effects
    assert result.error_after < 0.5 * result.error_before
    with pytest.raises(InputError, match="N = 2, 3, 4 and 5"):
        PROTOCOLS["paper"](read_measurements(toy_table(16).query("N != 5")))


@pytest.mark.usefixtures("toy_model")
def test_a_table_may_be_parquet(tmp_path: Path) -> None:
    table = toy_table(18)
    table.to_parquet(tmp_path / "table.parquet")
    assert read_measurements(tmp_path / "table.parquet").y == pytest.approx(read_measurements(table).y)
    (tmp_path / "broken.parquet").write_text("no table")
    with pytest.raises(InputError, match="no Parquet table"):
        read_measurements(tmp_path / "broken.parquet")
