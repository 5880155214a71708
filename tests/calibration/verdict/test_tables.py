"""Tables as people bring them: refused, mended, or closed with a weaker conclusion."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from calibration.linear.gls import UNKNOWN_RATIO
from calibration.statistics.study import middle_session
from calibration.swimmer.measured_table import PROTOCOLS, read_measurements
from common.errors import InputError, run_command
from softflagella.__main__ import main
from tests.calibration.toy_tables import DRAG, calibrated, effect, toy_table
from tests.page_text import PageText

PAPER = ("N", "l_cm", "trial", "session", "omega_rpm", "omega_h_rpm", "omega_yr_rad_s")  # what its protocol takes


def commanded(table: pd.DataFrame, folder: Path) -> int:
    """Calibrate a table by the command; return its status."""
    table.to_csv(folder / "t.csv", index=False)
    words = ["calibrate", str(folder / "t.csv"), "--robot", "paper-measured", "--out", str(folder / "out")]
    return run_command(main, [*words, "--no-path"])


@pytest.mark.usefixtures("toy_model")
@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda t: t.drop(columns="omega_rpm"), "no column 'omega_rpm'"),
        (lambda t: t.assign(omega_h_rad_s=1), "omega_h_rpm and omega_h_rad_s are the same quantity"),
        (lambda t: t.drop(columns=["omega_yr_rad_s", "R_yr_cm", "theta_deg"]), "at least two outputs"),
        (lambda t: t[t["trial"] == 1].assign(session=range(48)), "0 repeated runs, too few"),
        (lambda t: t.assign(omega_h_rpm=-t["omega_h_rpm"]), "wrong sign .*: the head turns against the motor"),
        (lambda t: t.assign(omega_yr_rad_s=-t["omega_yr_rad_s"]), "wrong sign .* to the left"),
        (lambda t: t.assign(omega_yr_rad_s=0.05 * np.sign(t["omega_rpm"])), "rad_s is the same in all repeats"),
        (lambda t: t.assign(R_yr_cm=1000 * t["R_yr_cm"]), "check its unit"),
        (lambda t: t.head(3), "3 usable runs"),
        (lambda t: t.assign(R_yr_cm="far"), "0 usable runs"),
        (lambda t: t.assign(l_cm=np.nan), "0 usable runs"),
        (lambda t: t.assign(omega_yr_rad_s=np.nan, R_yr_cm=np.nan, theta_deg=np.nan), "without any value: om"),
    ],
    ids=["column", "twice", "spins alone", "no repeats", "sign of the spin",
         "sign of the yaw", "constant", "unit", "three rows", "words", "no lengths", "empty outputs"],
)  # fmt: skip
def test_bad_tables_are_refused(change: Any, expected: str, tmp_path: Path, capsys: Any) -> None:
    assert commanded(change(toy_table(1)), tmp_path) == 2
    (error,) = capsys.readouterr().err.splitlines()
    assert re.search(expected, error)
    assert not (tmp_path / "out").exists()


def test_bad_rows_are_named_and_set_aside() -> None:
    table = toy_table(2).astype({"omega_yr_rad_s": object})
    table.loc[0, "omega_yr_rad_s"] = "fast"
    table.loc[1, "theta_deg"] = np.nan
    table.loc[2, "omega_h_rpm"] *= -1
    data = read_measurements(table)
    assert len(data) == len(table) - 2
    assert [line.split(":")[0] for line in map(str, data.excluded)] == ["row 1", "row 3", "column theta_deg"]
    assert data.gaps.sum() == data.gaps[0, data.outputs.index("theta")] == 1
    assert str(data.excluded[-1]) == "column theta_deg: no value in row 2; the other outputs there count"
    assert (
        read_measurements(table.assign(colour="red")).excluded[-1].reason == "column colour: not known, left out"
    )
    with pytest.raises(InputError, match="unknown"):
        read_measurements(table.rename(columns={"trial": "tri al"}))


@pytest.mark.usefixtures("few_candidates")
def test_an_empty_cell_costs_no_other_output(tmp_path: Path) -> None:
    """A coefficient hardly changes, where without the rows it would, and `n/a` is no nan."""
    table, rng = toy_table(5), np.random.default_rng(0)
    outputs = ["omega_h_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg"]
    gaps = rng.random((len(table), len(outputs))) < 0.04
    sparse = table.copy()
    sparse[outputs] = table[outputs].astype(object).where(~gaps, "n/a")
    sparse.to_csv(tmp_path / "t.csv", index=False)
    data = read_measurements(tmp_path / "t.csv")
    assert len(data) == len(table)
    assert data.gaps.sum() == gaps.sum()
    assert len(data.excluded) == gaps.any(0).sum()
    assert not any("nan" in line for line in map(str, data.excluded))
    paper = PROTOCOLS["paper"](data)[0]
    assert paper.gaps.sum() == gaps[:, :2].sum()


def test_a_header_in_the_table_and_a_row_number_are_named(tmp_path: Path) -> None:
    """As they come from tables that were written one below the other, and from spreadsheets."""
    lines = toy_table(2).drop(columns="run").rename_axis("Nr").to_csv().splitlines()
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(["# tank 2", *lines[:40], *lines]))
    data = read_measurements(path)
    assert str(data.excluded[0]) == "row 40 (line 42): the header again"
    assert str(data.excluded[1]).startswith("row 41 (line 43): a copy of an earlier row")
    assert str(data.excluded[1]).endswith("(row 1 (line 3))")
    assert str(data.excluded[-1]) == "column Nr: not known, left out"
    assert data.row_name(0) == "row 1 (line 3)"


def test_a_single_session_gives_a_weaker_conclusion() -> None:
    table = toy_table(5, **{DRAG: 5.0}).assign(session="one")
    data = read_measurements(table)
    locked = middle_session(data)
    assert 0.15 < locked.mean() < 0.35
    for condition in np.unique(data.condition):  # repeats stay together
        assert len(set(locked[data.condition == condition])) == 1
    result = calibrated(table, few=True)
    assert result.effects == (DRAG,)
    assert any("1 session" in limit for limit in result.caveats)
    assert ", part " in result.split.names
    table = toy_table(5).assign(session="one")
    table["R_yr_cm"] *= 1.03  # what shifts all runs of a session is no evidence
    table["omega_h_rpm"] *= 0.98
    shifted = calibrated(table, few=True)
    assert shifted.verdict == "none"
    assert (shifted.base.noise.session_ratio == UNKNOWN_RATIO).all()


def test_two_sessions_kept_whole_are_not_called_blocks() -> None:
    """The paper's protocol locks N = 2 and 5; where these are a session, none is divided."""
    table = toy_table(5)
    table["session"] = np.where(table["N"].isin((3, 4)), "inner", "outer")
    _, held_out = PROTOCOLS["paper"](read_measurements(table))
    result = calibrated(table[["run", *PAPER]], few=True, held_out=held_out)
    assert result.split.names == "outer"
    assert not any("sessions only" in limit for limit in result.caveats)


def test_robots_of_one_kind_are_closed_with_both_limits() -> None:
    table = pd.concat([t[t["N"] == 3] for t in (toy_table(5), toy_table(6))])
    result = calibrated(table, few=True)
    assert result.verdict == "none"
    kind, session, level = result.caveats
    assert ("N = 3" in kind, "1 session only" in session, "C_t and C_yr to no better" in level) == (True,) * 3
    assert result.to_dict()["limits"] == [kind, session, level]


@pytest.mark.parametrize(
    "kept",
    [
        ("R_yr_cm", "theta_deg"),
        pytest.param(("omega_h_rpm", "omega_yr_rad_s"), marks=pytest.mark.rest),
        pytest.param(("omega_t_rpm", "omega_yr_rad_s"), marks=pytest.mark.rest),
    ],
)
def test_any_two_outputs_are_enough(kept: tuple[str, str]) -> None:
    outputs = {"omega_h_rpm", "omega_t_rpm", "omega_yr_rad_s", "R_yr_cm", "theta_deg"}
    result = calibrated(toy_table(5, **{DRAG: 5.0}).drop(columns=list(outputs - set(kept))), few=True)
    assert result.verdict in {"effect", "ambiguous"}
    assert DRAG in result.effects


def test_a_slipped_decimal_point_is_named_and_set_aside() -> None:
    """The run, not its repeat; the verdict is that of the table without it."""
    table = toy_table(12)
    table.loc[17, "omega_yr_rad_s"] *= 10
    result, without = (calibrated(each, few=True) for each in (table, table.drop(index=17)))
    assert [line.split(" is ")[0] for line in map(str, result.excluded)] == ["row 18: omega_yr"]
    assert not result.split.fitted[17]
    assert result.verdict == without.verdict
    assert result.noise_ceiling == pytest.approx(without.noise_ceiling, rel=0.05)


def test_mistracked_runs_have_little_weight_and_are_named() -> None:
    table = toy_table(5, **{DRAG: 5.0})
    clean = effect()
    rng = np.random.default_rng(0)
    mistracked = np.flatnonzero(rng.random(len(table)) < 0.05)
    table.loc[mistracked, "R_yr_cm"] *= 1 + rng.uniform(0.1, 0.3, len(mistracked))
    result = calibrated(table, few=True)
    assert result.effects == clean.effects == (DRAG,)
    assert clean.little_weight == ()
    assert len(set(result.little_weight) - set((mistracked + 1).tolist())) <= 1  # one of many is far by chance
    assert len(result.little_weight) >= 2
    assert any("have a weight below one half" in line for line in result.caveats)
    record = result.to_dict()
    assert record["rows_of_little_weight"] == list(result.little_weight)


@pytest.mark.slow
@pytest.mark.usefixtures("toy_model", "few_candidates")
def test_half_of_a_table_does_not_go_missing_without_a_word(tmp_path: Path, capsys: Any) -> None:
    """The spins of the camera without their sign: one line named row 1."""
    table = toy_table(3)
    table["omega_h_rpm"] = table["omega_h_rpm"].abs()
    count, wrong = len(table), int((table["omega_rpm"] > 0).sum())
    assert commanded(table, tmp_path) == 0
    printed = capsys.readouterr()
    reason = "omega_h_rpm has the wrong sign for its omega_rpm: the head turns against the motor"
    assert printed.err.count(f"excluded: {wrong} of {count} rows (rows ") == printed.err.count(reason) == 1
    assert f"excluded: {wrong}" not in printed.out  # once
    assert f"the conclusion is weaker: {wrong} of {count} rows (50 %) were excluded" in printed.out
    seen = PageText(tmp_path / "out" / "report.html").text
    assert f"Excluded: {wrong} of {count} rows:" in seen
    assert reason in seen


def test_an_output_that_follows_from_others_is_counted_once() -> None:
    table = toy_table(14)
    table["v_cm_s"] = table["R_yr_cm"] * table["omega_yr_rad_s"].abs()
    data = read_measurements(table)
    assert "v" not in data.outputs
    assert any("v_cm_s: follows from" in line for line in map(str, data.excluded))


def test_the_papers_protocol_fits_three_and_four_tails_and_predicts_two_and_five() -> None:
    table = toy_table(16, **{DRAG: 5.0})
    data, held_out = PROTOCOLS["paper"](read_measurements(table))
    assert data.outputs == ("omega_h", "omega_yr")
    assert set(data.tails[held_out]) == {2.0, 5.0}
    result = calibrated(table[["run", *PAPER]], few=True, held_out=held_out)
    assert result.split.names == "N=2, N=5"
    assert DRAG in result.effects
    assert result.error_after < 0.5 * result.error_before
    with pytest.raises(InputError, match="N = 2, 3, 4 and 5"):
        PROTOCOLS["paper"](read_measurements(toy_table(16).query("N != 5")))
    with pytest.raises(InputError, match="would split it"):
        PROTOCOLS["paper"](read_measurements(table.assign(session="the only one")))


def test_a_table_may_be_parquet(tmp_path: Path) -> None:
    table = toy_table(18)
    table.to_parquet(tmp_path / "table.parquet")
    assert read_measurements(tmp_path / "table.parquet").y == pytest.approx(read_measurements(table).y)
    (tmp_path / "broken.parquet").write_text("no table")
    with pytest.raises(InputError, match="no Parquet table"):
        read_measurements(tmp_path / "broken.parquet")
