"""`softflagella compare`: what differs between robots, plans, tracks, verdicts."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from common.errors import InputError
from sim.api import replay
from sim.inputs import load_robot
from softflagella.__main__ import main
from softflagella.compare import Bounded, compare

Capsys = pytest.CaptureFixture[str]
C_T = {"title": "C_t", "unit": "1", "shown": 1.0, "scale": "logarithm", "value": 3.0, "interval": [2.0, 4.5]}
ZERO = {"title": "zero", "unit": "°", "shown": 2.0, "scale": "as it is", "value": 1.0, "interval": [0.0, 2.0]}
VERDICT = {
    "verdict": "effect", "effects": ["end_over_end_drag"], "advice": "corrected", "table": "runs.csv",
    "number_of_runs": 40, "error_uncalibrated": 0.2, "error_before": 0.1, "error_after": 0.05,
    "error_after_interval": [0.04, 0.06], "scatter_of_a_run": {"v": 0.02}, "output_scales": {"v": [100.0, "%"]},
    "output_titles": {"v": "speed"}, "parameters": {"C_t": C_T, "zero": ZERO},
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make two plans, a track of each, a track in cm alone, two verdicts, robots."""
    place = tmp_path_factory.mktemp("compared")
    robots = {"slow": ["--set", "motor.speed_rpm=30"], "fast": ["--set", "motor.speed_rpm=60"]}
    for name, changes in robots.items():
        main(["robot", "paper-control", *changes, "--out", str(place / f"{name}.toml")])
        words = ["plan", "circle:2l", "--robot", str(place / f"{name}.toml"), "--objective", "flips"]
        main([*words, "--out", str(place / name)])
        replay(place / name / "plan.json").to_csv(place / f"{name}.csv", index=False)
    time = np.linspace(0, 10, 11)
    for name, shift in (("here", 0.0), ("there", 0.3)):
        track = {"time_s": time, "x_cm": time, "y_cm": shift + 0 * time, "heading_deg": 10 * time}
        pd.DataFrame(track).to_csv(place / f"{name}.csv", index=False)
    (place / "verdict.json").write_text(json.dumps(VERDICT))
    moved = {
        "C_t": {**C_T, "value": 6.0, "interval": [4.0, 9.0]},
        "zero": {**ZERO, "value": 3.0, "interval": [2, 4]},
    }
    other = {**VERDICT, "parameters": moved, "verdict": "none", "error_after": None}
    (place / "calibrated").mkdir()
    (place / "calibrated" / "verdict.json").write_text(json.dumps(other))
    points = pd.DataFrame([load_robot(place / f"{name}.toml").group_values() for name in robots])
    points.to_csv(place / "points.csv", index=False)
    return place


def table(lines: list[str]) -> dict[str, str]:
    """Return the lines of a comparison by their titles."""
    return {line.split("  ")[0]: " ".join(line.split("  ")[1:]) for line in lines}


@pytest.mark.parametrize(
    ("words", "refusal"),
    [
        ("slow.toml", "give two files or more"),
        ("slow.toml slow", "slow.toml is a robot and slow a plan; give files of one kind"),
        (
            "slow here.csv",
            "here.csv a track; give files of one kind, a plan of tracks with --with",
        ),
        ("slow fast --with slow", "--with slow is the plan of tracks; leave it out for a plan"),
        ("slow.toml no.toml", "no robot 'no.toml'"),
        ("slow.toml paper-controll", "no robot 'paper-controll'"),
        ("here.csv no.csv", "no.csv"),
        ("slow slow/plan.csv", "is a plan"),
        ("here.csv slow/plan.csv", "plan: the track has no column 'time_s'"),
        ("points.csv slow.toml", "points.csv is a track and slow.toml a robot"),
        ("points.csv points.csv", "the track has no column 'time_s'"),
        ("verdict.json slow/plan.json", "verdict.json is a verdict and slow/plan.json a plan"),
        ("slow empty", "empty"),
        ("slow list.json", "list.json"),
        ("verdict.json bare.json", "bare is not a verdict.json of this version (no entry 'advice')"),
        ("slow bare-plan.json", "bare-plan is not a plan.json of the planner (no entry 'dwell_s'); plan again"),
        ("here.csv there.csv --plot picture", "a name that ends with .svg, .png, .pdf"),
        ("slow.csv fast.csv --with slow", "fast: the track is of plan"),
    ],
)
def test_what_cannot_be_compared_is_refused(
    words: str, refusal: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capsys
) -> None:
    monkeypatch.chdir(folder)
    Path("empty").mkdir(exist_ok=True)
    Path("list.json").write_text("[1, 2]")
    plan = json.loads(Path("slow/plan.json").read_text())
    Path("bare-plan.json").write_text(json.dumps({k: v for k, v in plan.items() if k not in ("id", "dwell_s")}))
    Path("bare.json").write_text('{"verdict": "none"}')
    with pytest.raises(InputError) as refused:
        main(["compare", *words.split()])
    assert refusal in str(refused.value)
    assert capsys.readouterr().out == ""


def test_robots_are_compared_by_inputs_and_predicted_motion(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    lines = compare(["slow.toml", "fast.toml", "paper-control"]).lines()
    found = table(lines)
    assert found["motor.speed_rpm"].split() == ["30", "60", "43.26", "+100", "%,", "+44.2", "%"]
    assert "to" in found["speed [cm/s]"]
    assert "tails.length_cm" not in found
    assert lines[-1].endswith("of 19 quantities are equal")


def test_robots_have_the_intervals_of_their_files(folder: Path, tmp_path: Path) -> None:
    text = (folder / "slow.toml").read_text().replace("[motor]", 'viscosity_Pa_s_sigma = "10 %"\n[motor]')
    (tmp_path / "stated.toml").write_text(text)
    known = '[calibration]\nnames = ["C_t"]\ncovariance = [[0.01]]\n'
    (tmp_path / "known.toml").write_text(f"{text}\n{known}")
    (tmp_path / "more.toml").write_text(f"{text.replace('C_t = 3.0', 'C_t = 4.0')}\n{known}")
    found = table(compare([str(tmp_path / f"{name}.toml") for name in ("known", "more", "stated")]).lines())
    assert "3 (2.466 to 3.65)" in found["drag.C_t"]
    assert f"{math.log(4 / 3) / math.hypot(0.1, 0.1):+.1f} σ" in found["drag.C_t"]
    found = table(compare([str(folder / "slow.toml"), str(tmp_path / "stated.toml")]).lines())
    assert "1.49 (1.198 to 1.782)" in found["fluid.viscosity_Pa_s"]


def test_a_robot_that_the_table_does_not_know_is_simulated(tmp_path: Path) -> None:
    main(["robot", "paper-control", "--set", "effects.natural_twist=0.1", "--out", str(tmp_path / "twisted.toml")])
    comparison = compare(["paper-control", str(tmp_path / "twisted.toml")])
    assert comparison.files["twisted"]["source of the motion"] == "simulated, estimated errors"
    assert table(comparison.lines())["effects.natural_twist"].split() == ["-", "0.1"]


def test_plans_are_compared_by_what_they_state(folder: Path) -> None:
    comparison = compare([str(folder / "slow"), str(folder / "fast" / "plan.json")])
    content = json.loads((folder / "slow" / "plan.json").read_text())
    slow = comparison.files["slow"]
    assert [*comparison.files] == ["slow", "fast"]
    assert slow["duration [s]"] == Bounded(pytest.approx(sum(content["dwell_s"])))
    assert slow["flips"] == Bounded(len(content["dwell_s"]) - 1)
    assert slow["stated error [mm]"] == Bounded(pytest.approx(1000 * content["stated_error_over_l"] * 0.11))
    assert slow["path as drawn [cm]"] == Bounded(pytest.approx(2 * math.pi * 22, rel=1e-3))
    assert "omega_bar" in table(comparison.lines())
    assert "tail length [cm]" not in table(comparison.lines())


def test_tracks_are_compared_at_equal_times_and_with_their_plan(folder: Path) -> None:
    there = compare([str(folder / "here.csv"), str(folder / "there.csv")]).files["there"]
    assert there["off the first at equal times, rms [mm]"] == Bounded(pytest.approx(3.0))
    assert there["off the first from its path, largest [mm]"] == Bounded(pytest.approx(3.0))
    assert there["last pose [cm, degrees]"] == "10.00, 0.30, 100.0"
    files = [str(folder / "slow.csv"), str(folder / "here.csv")]
    tracks = compare(files, str(folder / "slow" / "plan.json")).files
    assert tracks["slow"]["tracking error, rms [mm]"].value < tracks["here"]["tracking error, rms [mm]"].value


def test_tracks_without_a_common_time_have_no_distance_at_equal_times(folder: Path, tmp_path: Path) -> None:
    late = pd.read_csv(folder / "here.csv").assign(time_s=lambda track: track["time_s"] + 100)
    late.to_csv(tmp_path / "late.csv", index=False)
    cells = compare([str(folder / "here.csv"), str(tmp_path / "late.csv")]).files["late"]
    assert "off the first at equal times, rms [mm]" not in cells
    assert cells["off the first from its path, rms [mm]"] == Bounded(pytest.approx(0.0, abs=1e-9))


def test_verdicts_are_compared_in_standard_deviations(folder: Path) -> None:
    comparison = compare([str(folder / "verdict.json"), str(folder / "calibrated")])
    found = table(comparison.lines())
    assert found["verdict"].split() == ["effect", "none"]
    sigma = math.log(4.5 / 2) / 3.92
    assert f"{math.log(2) / math.hypot(sigma, sigma):+.1f} σ" in found["C_t"]
    assert "2 (0 to 4) 6 (4 to 8) +2.8 σ" in " ".join(found["zero [°]"].split())
    assert found["error after [%]"].split() == ["5", "(4", "to", "6)", "-"]
    assert "noise, speed [%]" not in found


@pytest.mark.parametrize("ending", ["svg", "png"])
def test_what_is_compared_is_drawn(ending: str, folder: Path, tmp_path: Path, capsys: Capsys) -> None:
    for names in (["slow.toml", "fast.toml"], ["slow", "fast"], ["here.csv", "there.csv"],
                  ["verdict.json", "calibrated"]):  # fmt: skip
        picture = tmp_path / f"picture.{ending}"
        main(["compare", *(str(folder / name) for name in names), "--plot", str(picture)])
        assert capsys.readouterr().out.endswith(f"-> {picture}\n")
        assert picture.stat().st_size > 5000
        assert ending == "png" or Path(names[1]).stem in picture.read_text()


def test_what_is_equal_is_left_out(folder: Path) -> None:
    lines = compare([str(folder / "slow.toml")] * 2).lines()
    assert lines == ["intervals: of inputs 95 %, of the motion 90 %", "19 of 19 quantities are equal"]


def test_verdicts_without_a_common_number_have_an_empty_picture(folder: Path, tmp_path: Path) -> None:
    for name, titles in (("one", {"v": "speed"}), ("two", {"v": "spin"})):
        errors = {f"error_{model}": None for model in ("uncalibrated", "before", "after")}
        record = {**VERDICT, **errors, "output_titles": titles, "parameters": {}}
        (tmp_path / f"{name}.json").write_text(json.dumps(record))
    main(["compare", str(tmp_path / "one.json"), str(tmp_path / "two.json"), "--plot", str(tmp_path / "out.png")])
    assert (tmp_path / "out.png").stat().st_size > 100
