"""A model of one's own: its table, from any file; the command; and what is saved."""

from __future__ import annotations

import json
import re
import runpy
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import softflagella as sf
from calibration.own_model.table_of_runs import Roles, read_runs_of
from calibration.verdict.calibrate import calibrate
from common.errors import InputError, run_command
from softflagella.__main__ import main
from tests.calibration.own_model.test_faults import DIAMETER, MODEL, TABLE, fall, said

REAL = Path(__file__).parents[4] / "shared/measured/real"
NAMES = {"rho_ball_kg_m3": "rho_ball", "rho_fluid_kg_m3": "rho_oil"}
measured = pytest.mark.skipif(not REAL.exists(), reason="measured tables are not here")


def runs_of(table: Any, model: sf.Model = MODEL, **roles: Any) -> Any:
    return read_runs_of(table, model, Roles(**({"session": "round"} | roles)))[0].runs


def test_tables_are_read_as_all_tables_are(tmp_path: Path) -> None:
    """Decimal commas, a spreadsheet, lines of comments: the same runs."""
    TABLE.to_excel(tmp_path / "falls.xlsx", index=False)
    text = TABLE.to_csv(index=False, sep=";", decimal=",")
    (tmp_path / "falls.csv").write_text(f"# falls\n{text}")
    expected = runs_of(TABLE)
    for name in ("falls.xlsx", "falls.csv"):
        runs = runs_of(tmp_path / name)
        np.testing.assert_allclose(runs.y, expected.y)
        assert runs.session_names == expected.session_names
    assert runs.row_name(0) == "row 1 (line 3)"
    assert expected.input_names == ("ln d",)
    assert expected.settings["d"][0] == pytest.approx(TABLE["d"])


def test_columns_are_converted_to_the_units_of_the_model() -> None:
    model, told = replace(MODEL, units={"d": "m"}), list[str]()
    for name, factor in {"d_mm": 1000, "d [cm]": 100, "d_m": 1, "d": 1}.items():
        table = TABLE.drop(columns=["d", "v"]).assign(**{name: factor * TABLE["d"], "v_cm_s": 100 * TABLE["v"]})
        runs = runs_of(table, model)
        np.testing.assert_allclose(runs.y, runs_of(TABLE).y)
        assert runs.settings["d"][0] == pytest.approx(TABLE["d"])
    sf.calibrate(
        table.rename(columns={"d": "d_mm"}).assign(d_mm=1000 * TABLE["d"]),
        model,
        session="round",
        progress=False,
        tell=told.append,
    )
    assert told[1:] == ["column d_mm converted from mm to m (d_m)"]
    assert told[:1] == ["column v_cm_s converted from cm/s to m/s (v_m_s)"]
    assert "d_m and d_mm are the same quantity" in said(model, TABLE.assign(d_mm=1.0))
    angles = replace(MODEL, function=lambda c, p: fall({"d": c["a"]}, p), units={"a": "rad"})
    degrees = TABLE.rename(columns={"d": "a_deg"}).assign(a_deg=np.degrees(TABLE["d"]))
    assert runs_of(degrees, angles).settings["a"][0] == pytest.approx(TABLE["d"])
    for units in {"d": "ell"}, {"d_mm": "m"}:
        with pytest.raises(InputError, match="give a unit that is known"):
            replace(MODEL, units=units)


def test_rows_that_lack_what_is_needed_are_excluded_and_said() -> None:
    table = TABLE.astype({"d": object, "round": object, "v": object})
    table.loc[3, "d"], table.loc[5, "v"], table.loc[7, "round"], table.loc[9, "v"] = "wide", None, None, -1.0
    assert [str(each) for each in runs_of(table).excluded] == [
        "row 4: d = wide is not a finite number",
        "row 6: no output has a value",
        "row 8: round has no value",
        "row 10: v = -1 is not above 0",
    ]


def test_an_output_that_is_missing_in_some_rows_is_a_gap() -> None:
    def both(columns: Any, p: Any) -> Any:
        v = fall(columns, p)["v"]
        return {"v": v, "tilt": 0.1 * v}

    outputs = {"v": sf.Output("speed", unit="m/s"), "tilt": sf.Output("tilt", unit="rad", kind="difference")}
    model, noise = replace(MODEL, function=both, outputs=outputs), np.random.default_rng(5).normal(size=45)
    table = TABLE.assign(tilt=0.1 * TABLE["v"] + 0.01 * noise)
    table.loc[[4, 30], "tilt"] = np.nan
    runs = runs_of(table, model)
    assert runs.gaps.sum() == 2
    assert [str(each) for each in runs.excluded] == [
        "column tilt: no value in row 5, row 31; the other outputs there count"
    ]
    result = sf.calibrate(table, model, session="round", progress=False)
    assert result.effects == ("wall",)
    record = result.to_dict()
    assert record["output_titles"] == {"v": "speed", "tilt": "tilt"}
    assert record["output_scales"] == {"v": [100.0, "%"], "tilt": [1.0, "rad"]}


def test_each_column_has_its_role() -> None:
    table = TABLE.assign(
        ball=[f"d{d:g}" for d in TABLE["d"]], operator=["A", "B", "A"] * 15, bath_C=20.0, time_s=1 / TABLE["v"],
        test=TABLE["round"] > 4,
    )  # fmt: skip
    model, held_out = read_runs_of(table, MODEL, Roles(session="round", specimen="ball", held_out="test"))
    assert set(model.runs.notes) == {"day", "operator", "bath_C"}  # time_s follows from v
    assert model.runs.specimen_names[0] == "d0.02"
    np.testing.assert_array_equal(held_out, table["round"] > 4)
    part = model.runs.subset(table["round"].to_numpy() == 2)
    assert len(part.notes["operator"]) == len(part) == 9
    assert list(runs_of(table, notes=["operator"]).notes) == ["operator"]
    by_name = read_runs_of(table, MODEL, Roles(session="round", held_out=["2", "round 4"]))[1]
    np.testing.assert_array_equal(by_name, table["round"].isin([2, 4]))
    assert (runs_of(table).sigma, runs_of(table).noise_known) == (None, True)
    assert runs_of(table, noise={"v": "3 %"}).sigma == pytest.approx([0.03])
    assert not runs_of(table, noise="unknown").noise_known
    declared = replace(MODEL, outputs={"v": sf.Output("speed", unit="m/s", sigma="2 %")})
    assert runs_of(table, declared).subset(np.arange(5)).sigma == pytest.approx([0.02])


def test_the_function_gets_one_number_where_a_parameter_differs_between_runs() -> None:
    seen = []

    def strict(columns: Any, p: Any) -> Any:
        seen.append((len(columns["d"]), {type(value) for value in p.values()}))
        return fall(columns, p)

    model = read_runs_of(TABLE, replace(MODEL, function=strict), Roles(session="round"))[0]
    seen.clear()
    speeds = np.where(TABLE["round"] == 2, 330.0, 300.0)
    prediction = model.predict([{"v1": speeds, "wall": 1.0}])[0, :, 0]
    assert seen == [(36, {float}), (9, {float})]
    np.testing.assert_allclose(np.exp(prediction), fall(TABLE, {"v1": speeds, "wall": 1.0})["v"])


def test_the_next_runs_are_named_by_the_columns_of_the_table() -> None:
    model = read_runs_of(TABLE, MODEL, Roles(session="round"))[0]
    others, settings = model.possible()
    assert settings == [{"d": d} for d in TABLE["d"][:9]]
    assert len(others.runs) == 9
    wider = read_runs_of(TABLE, MODEL, Roles(session="round"), own={"d": (0.05, 0.5)})[0].possible()
    assert wider[1] == [{"d": 0.05}, {"d": 0.5}]
    start = {"v1": 300.0, "wall": 1.0}
    np.testing.assert_allclose(
        np.exp(wider[0].predict([start])).ravel(), fall({"d": np.array([0.05, 0.5])}, start)["v"]
    )


def test_what_the_lab_can_set_may_tell_explanations_apart() -> None:
    """Within the table's diameters the two do not differ, far beyond them they do; new runs there decide."""
    steeper = sf.Effect("steeper", "steeper", low=-1, high=4)
    model = replace(
        MODEL,
        function=lambda c, p: {"v": fall(c, p)["v"] * np.exp(-2.0 * p["steeper"] * c["d"])},
        effects=[*MODEL.effects, steeper],
    )
    result, wider = (
        sf.calibrate(TABLE, model, session="round", progress=False, own=own) for own in (None, ["d=0.05,0.5,2"])
    )
    assert result.verdict == wider.verdict == "ambiguous"
    assert wider.next_batch.decides > result.next_batch.decides
    assert {run["d"] for run in wider.next_batch.settings} <= {0.05, 0.5, 2.0}
    d, noise = np.array([run["d"] for run in wider.next_batch.settings]), np.random.default_rng(0)
    numbers = {"v1": 300.0, "wall": 0.0, "steeper": 0.0}
    for effect in ("wall", "steeper"):
        at = {**numbers, effect: 1.0}
        new = pd.DataFrame({"round": 9, "d": d, "v": model.function({"d": d}, at)["v"]})
        new["v"] *= np.exp(0.01 * noise.normal(size=len(d)))
        for table in (new, pd.concat([TABLE, new], ignore_index=True)):
            decision = sf.decide(table, wider, model, session="round")
            assert decision.decided == next(e.title for e in model.effects if e.name == effect)
            assert decision.new_runs == len(d)
    with pytest.raises(InputError, match=r"were there before.*; excluded: .*round is not a finite number"):
        sf.decide(pd.concat([TABLE, new.assign(round="new")]), wider, model, session="round")
    with pytest.raises(InputError, match="'b' is no setting of this table; there are d"):
        sf.calibrate(TABLE, model, session="round", progress=False, own={"b": (1.0,)})


def test_a_model_is_saved_with_its_numbers(tmp_path: Path) -> None:
    result = sf.calibrate(TABLE, MODEL, session="round", progress=False)
    assert [path.name for path in result.save(tmp_path)] == ["verdict.json", "report.html", "corrected.json"]
    saved = json.loads((tmp_path / "corrected.json").read_text())
    assert saved["numbers"]["v1"]["value"] == result.corrected["v1"]
    low, high = saved["effects"]["wall"]["interval"]
    assert low < result.corrected["wall"] < high
    assert saved["covariance"]["names"] == ["v1", "wall"]
    assert np.linalg.eigvalsh(saved["covariance"]["on_their_scales"]).min() > 0
    page = (tmp_path / "report.html").read_text()
    assert "Fitted to one end of the settings, it predicts the other runs (p = " in " ".join(page.split())
    assert "softflagella plan" not in page
    assert json.loads((tmp_path / "verdict.json").read_text())["subject"] == "model"
    assert "wall" in repr(result)
    assert "<svg" in page


def test_a_model_without_effects_has_a_report(tmp_path: Path) -> None:
    result = sf.calibrate(TABLE, MODEL.without("wall"), session="round", progress=False)
    assert result.verdict == "unexplained"
    result.save(tmp_path)
    assert list(result.corrected) == ["v1"]


def test_the_example_runs_from_the_command_to_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_command(main, ["model"]) == 0
    next_command = capsys.readouterr().out.splitlines()[-1]
    runpy.run_path("falls.py", run_name="__main__")
    assert run_command(main, next_command.split()[1:]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert len(printed) <= 8
    missing = (
        r"Missing: wall of the tube, [\d.]+ times the size of theory \(95 %: [\d.]+ to [\d.]+\)\. \[claimed.*\]"
    )
    assert re.fullmatch(missing, printed[0])
    assert printed[1].startswith("error on the held-out runs: refitted ")
    assert json.loads(Path("falls/corrected.json").read_text())["effects"]["wall"]["value"] == pytest.approx(
        1, abs=0.1
    )
    assert json.loads(Path("falls/verdict.json").read_text())["table"] == "falls.csv"
    assert run_command(main, ["model"]) == 2
    assert "is there already" in capsys.readouterr().err


def test_the_example_of_traces_runs_from_the_command_to_the_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Radiation is hidden in it; each cup has its own start."""
    monkeypatch.chdir(tmp_path)
    assert run_command(main, ["model", "--trace", "--out", "mugs.py"]) == 0
    next_command = capsys.readouterr().out.splitlines()[-1]
    runpy.run_path("mugs.py", run_name="__main__")
    assert run_command(main, next_command.split()[1:]) == 0
    assert "radiation" in capsys.readouterr().out
    corrected = json.loads(Path("cups/corrected.json").read_text())
    low, high = corrected["effects"]["emissivity"]["interval"]
    assert low < 0.95 < high
    assert json.loads(Path("cups/verdict.json").read_text())["verdict"] == "effect"
    assert run_command(main, ["model", "--trace", "--out", "mugs.py"]) == 2
    assert "is there already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("MODEL = 1\n", "model.py defines no MODEL"),
        ("import numpy\n\nMODEL = (\n", "model.py, line 3: '(' was never closed"),
        ("x = 1\ny = x / 0\n", "model.py, line 2: ZeroDivisionError: division by zero"),
        ("import sys\nsys.exit(3)\n", "model.py, line 2: SystemExit: 3"),
        ("import no_such_package\n", "model.py, line 1: ModuleNotFoundError"),
        ("from TEST import MODEL\ndef read(path):\n    return 3\n", "returns int; return a DataFrame"),
        ("from TEST import MODEL\ndef read(path):\n    return path.no\n", "model.py, line 3: AttributeError"),
        (
            "from TEST import MODEL\ndef read(path):\n    raise ValueError('old file')\n",
            "line 3: ValueError: old file",
        ),
    ],
)
def test_a_fault_of_a_file_is_one_line(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, table = tmp_path / "model.py", tmp_path / "falls.csv"
    file.write_text(text.replace("TEST", "tests.calibration.own_model.test_faults"))
    TABLE.to_csv(table, index=False)
    assert run_command(main, ["calibrate", str(table), "--model", str(file), "--out", str(tmp_path / "out")]) == 2
    line = capsys.readouterr().err
    assert words in line
    assert line.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_either_a_robot_or_a_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for given in ([], ["--robot", "paper-control", "--model", "falls.py"]):
        assert run_command(main, ["calibrate", "falls.csv", *given, "--out", str(tmp_path)]) == 2
        assert "give --robot, or, for a table, --model" in capsys.readouterr().err


@measured
def test_the_viscosity_is_that_of_the_capillary() -> None:
    """0.1946 Pa s in the same session, within the spread of the forms that the balls cannot tell apart."""
    model = runpy.run_path(str(Path(__file__).parents[3] / "calibration/own_model/falls.txt"))["MODEL"]
    table = pd.read_csv(REAL / "falls_heidelberg-2019.csv").rename(
        columns=lambda name: name.removesuffix("_kg_m3")
    )
    table = table.rename(columns={"rho_fluid": "rho_oil"}).assign(v=table["distance_mm"] / 1e3 / table["time_s"])
    experiment = read_runs_of(table, model, Roles(session="repeat", specimen="ball"))[0]
    result = calibrate(experiment, progress=False)
    assert result.error_after < 0.5 * result.error_before
    assert result.errors.of_conditions is not None
    assert result.errors.of_conditions.after < result.errors.of_conditions.before
    low, high = result.final_intervals["viscosity"]
    assert low < 0.1946 < high


@pytest.mark.parametrize("limit", [2.0, 60.0])
def test_time_in_which_the_function_waits_counts(limit: float) -> None:
    """As for a solver in another process."""

    def slow(columns: Any, p: Any) -> Any:
        time.sleep(0.1)
        return fall(columns, p)

    began = time.perf_counter()
    result = sf.calibrate(TABLE, replace(MODEL, function=slow), session="round", max_seconds=limit, progress=False)
    assert (result.verdict == "effect") == (limit == 60)
    assert time.perf_counter() - began < min(limit + 2, 20)
    assert any(caveat.startswith("provisional") for caveat in result.caveats) == (limit == 2)


def test_a_long_table_ends_with_its_limit() -> None:
    table = pd.concat([TABLE] * 1000, ignore_index=True)
    table["v"] *= np.exp(0.02 * np.random.default_rng(1).standard_normal(len(table)))
    began = time.process_time()
    assert sf.calibrate(table, MODEL, session="round", max_seconds=2, progress=False).runs.y.size == 45_000
    assert time.process_time() - began < 15
    many = table.assign(d=np.random.default_rng(2).uniform(0.02, 0.12, len(table)))
    with pytest.raises(InputError, match="45000 settings in 45000 rows are more than can be tested"):
        sf.calibrate(many, MODEL, session="round", progress=False)


def pasted(table: pd.DataFrame, how: str) -> pd.DataFrame:
    parts = {"whole": [table] * 5, "a block": [table, table[10:30]], "twice": [table, table[5:25], table[5:25]]}
    if how == "each row":
        return table.loc[table.index.repeat(3)].reset_index(drop=True)
    if how == "shuffled":
        return pd.concat([table] * 2).sample(frac=1, random_state=1).reset_index(drop=True)
    return pd.concat(parts[how], ignore_index=True)


@pytest.mark.parametrize("digits", [2, 6], ids=["few digits", "many digits"])
@pytest.mark.parametrize("how", ["whole", "each row", "shuffled", "a block", "twice"])
def test_pasted_rows_are_no_repeats(how: str, digits: int) -> None:
    table = TABLE.assign(v=TABLE["v"].round(digits))
    runs = runs_of(pasted(table, how))
    assert len(runs) == 45
    assert all("a copy of an earlier row" in str(each) for each in runs.excluded)
    np.testing.assert_allclose(np.sort(runs.y[:, 0]), np.sort(np.log(table["v"])))


@pytest.mark.parametrize("seed", range(5))
def test_repeats_of_few_digits_may_be_equal(seed: int) -> None:
    """Rows without a number of the trial: honest repeats agree in all columns."""
    noise = 1 + 0.02 * np.random.default_rng(seed).standard_normal(180)
    diameters = np.tile(DIAMETER, 4)
    table = pd.DataFrame({"d": diameters, "round": 1, "v": (3000 * diameters**2 * noise).round()})
    assert table.duplicated().sum() > 60
    assert len(runs_of(table)) == 180


def test_runs_are_proposed_for_each_specimen_with_numbers_of_its_own() -> None:
    """Both specimens at the same settings, and two effects that these cannot tell apart."""

    def rate(columns: Any, p: Any) -> Any:
        c = columns["conc"]
        return {"rate": p["slope"] * c / (1 + p["saturation"] * c) * c ** -p["power"]}

    model = sf.Model(
        rate,
        outputs={"rate": sf.Output("rate", sigma="10 %")},
        numbers=[sf.Number("slope", 10, low=0.1, high=1e3, per="specimen")],
        effects=[
            sf.Effect("saturation", "saturation", low=0, high=50, typical=1),
            sf.Effect("power", "power law", low=-1, high=1, typical=0.3),
        ],
    )
    conc = np.tile([0.2, 0.4, 0.6, 1.1], 6)
    cells, noise = np.repeat(["treated", "untreated"], 12), np.exp(0.1 * np.random.default_rng(3).normal(size=24))
    slope = np.where(cells == "treated", 20.0, 12.0)
    exact = rate({"conc": conc}, {"slope": slope, "saturation": 1.5, "power": 0.0})["rate"]
    table = pd.DataFrame({"cells": cells, "conc": conc, "rate": exact * noise})
    verdict = sf.calibrate(table, model, specimen="cells", progress=False, own={"conc": (0.05, 5.0)})
    assert verdict.verdict == "ambiguous"
    assert {run.settings["specimen"] for run in verdict.next_runs} <= {"treated", "untreated"}
    possible, settings = read_runs_of(table, model, Roles(specimen="cells"), own={"conc": (0.05, 5.0)})[
        0
    ].possible()
    assert {(s["specimen"], s["conc"]) for s in settings} == {
        (name, value) for name in ("treated", "untreated") for value in (0.05, 5.0)
    }
    assert len(possible.runs) == len(settings) == 4
