"""Every command runs and writes what it says; a command without a run here makes a test fail."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pandas as pd
import pytest

from calibration.statistics.statistical_model import start_values
from camera.view import read_setup
from common.errors import InputError, run_command
from common.units import format_time
from dataset.build import build
from dataset.design import Axis, load_design
from planner.files.saved_plan import load_goal, load_plan
from planner.planning.request import Camera
from sim.inputs import load_robot
from sim.model.presets import PRESETS
from sim.model.schedule import plan_id
from softflagella.__main__ import main, program_of
from softflagella.shadowing import COMMANDED
from surrogate.table_file import SHIPPED, load
from tests.calibration.toy_tables import (
    DRAG,
    ambiguous,
    on_the_toy,
    toy_swimmer,
    toy_table,
)
from tests.calibration.track import RADIUS, track
from tests.camera.test_lens import POSES, boards
from tests.dataset.sweeps import SMALL, design, invented
from tests.oracles.tank import Tank, circling
from tests.processes import LIMIT, ROOT
from tests.shared import FOLDER, shared

FILES = {"plan.json", "plan.csv", "plan.svg", "schedule.h"}
SAID = {  # by commands that write nothing
    "sim check": "this simulator, its fit     0.403",
    "sim effects": "end_over_end_drag           5 8π μ0 R³  ",
    "sim compile": "loops compiled in",
    "planner compile": "loops compiled in",
    "calibration compile": "loops compiled in",
}
COMMANDS = [(package, name) for package in COMMANDED for name in program_of(package).commands]
COMMANDS.append(("softflagella", "calibrate"))


def done(*words: object) -> None:
    """Run a command of a package; it must succeed."""
    package, *rest = map(str, words)
    assert run_command(program_of(package).main, rest) == 0


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@shared
def made() -> Path:
    """Make a robot, points, a plan with its replay, and a data set, all by commands; return their folder."""
    folder = Path(mkdtemp(dir=FOLDER))
    done("planner", "robot", "paper-control", "--out", folder / "robot.toml")
    groups = PRESETS["paper-control"].group_values()
    pd.DataFrame([{**groups, "omega_bar": speed} for speed in (8.0, -12.0)]).to_csv(
        folder / "points.csv", index=False
    )
    done("planner", "plan", "circle:1l", "--robot", folder / "robot.toml", "--out", folder / "plan")
    done("tracking", "replay", folder / "plan" / "plan.json", "--out", folder / "track.csv")
    (folder / "sweep.toml").write_text(SMALL)
    done("dataset", "build", "--config", folder / "sweep.toml", "--out", folder / "sweep", "--jobs", 1)
    return folder


def sim_steady(made: Path, out: Path) -> str:
    done("sim", "steady", made / "points.csv", "--out", out / "steady.csv", "--jobs", 1)
    found = pd.read_csv(out / "steady.csv")
    assert found["converged"].tolist() == [True, True]
    assert (found["omega_t_bar"] - found["omega_h_bar"]).tolist() == pytest.approx([8.0, -12.0])
    return "2 rows, 2 converged"


def short_plan(made: Path, out: Path) -> Path:
    """Write the first two dwells of the plan."""
    plan = json.loads((made / "plan" / "plan.json").read_text())
    short = {**plan, "dwell_bar": plan["dwell_bar"][:2], "dwell_s": plan["dwell_s"][:2]}
    short["id"] = plan_id(short)
    (out / "short.json").write_text(json.dumps(short))
    return out / "short.json"


def tracking_replay(made: Path, out: Path) -> str:
    done("tracking", "replay", short_plan(made, out), "--out", out / "track.csv", "--shapes", out / "shapes.npz")
    track, last = pd.read_csv(out / "track.csv"), np.load(out / "shapes.npz")["head_position"][-1]
    assert 100 * last[:2] == pytest.approx(track[["x_cm", "y_cm"]].iloc[-1], abs=0.02)
    with pytest.raises(InputError, match="name their file with --shapes"):
        main(["replay", str(out / "short.json"), "--out", str(out / "t.csv"), "--every", "1"])
    dwells = json.loads((out / "short.json").read_text())["dwell_bar"]
    assert track["time_bar"].iloc[-1] == pytest.approx(sum(dwells), rel=1e-6)
    assert sorted(set(track["direction"])) == [-1, 1]
    end = track.iloc[-1]
    return f"2 dwells, {format_time(end.time_s)}, ends at ({end.x_cm:.2f}, {end.y_cm:.2f}) cm = "


def planner_robot(made: Path, out: Path) -> str:
    done("planner", "robot", "paper-triangle", "--out", out / "robot.toml")
    assert load_robot(out / "robot.toml") == PRESETS["paper-triangle"]
    return "paper-triangle -> "


def sim_film(made: Path, out: Path) -> str:
    done("sim", "film", short_plan(made, out), "--out", out / "swim.gif", "--speed", 100, "--width", 160)
    assert (out / "swim.gif").read_bytes()[:6] == b"GIF89a"
    return "at 100 times the robot's speed"


def planner_page(made: Path, out: Path) -> str:
    done("planner", "page", "--robot", made / "robot.toml", "--path", "circle:2l", "--out", out / "page.html")
    assert "circle:2l" in (out / "page.html").read_text()
    return "opens in a browser"


def dataset_build(made: Path, out: Path) -> str:
    done("dataset", "build", "--config", made / "sweep.toml", "--out", made / "sweep", "--jobs", 1)  # nothing left
    assert json.loads((made / "sweep" / "manifest.json").read_text())["rows"] == 6
    return "6 rows: "


def dataset_report(made: Path, out: Path) -> str:
    done("dataset", "report", made / "sweep", "--out", out / "page.html")
    assert (out / "page.html").read_text().count("<figure>") == 1
    return f"-> {out / 'page.html'}"


def dataset_verify(made: Path, out: Path) -> str:
    done("dataset", "verify", made / "sweep", "--rows", 1)
    return "6 rows as configured, flags consistent; 1 rows simulated again"


def dataset_config(made: Path, out: Path) -> str:
    done("dataset", "config", "--out", out / "sweep.toml")
    assert load_design(out / "sweep.toml") == load_design()
    return f"-> {out / 'sweep.toml'}"


def surrogate_train(made: Path, out: Path) -> str:
    """Learn rows that were not simulated, of robots with two tails, by the smallest networks."""
    from surrogate.training import fits, networks  # they load torch

    sweep = design(100)
    sweep = replace(sweep, axes={**sweep.axes, "N": Axis(2, 2, "integer")})
    build(sweep, str(out / "data"), jobs=1, title="", simulate=invented)
    small = networks.Settings(width=8, depth=1, members=1, epochs=2, iterations=2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fits, "_GAP", small)
        patch.setattr(fits, "CURVES", small)
        patch.setattr(networks, "Settings", lambda: small)
        done("surrogate", "train", out / "data", "--out", out / "model.safetensors", "--epochs", 2)
    assert load(out / "model.safetensors").provenance["rows"]["train"] > 50
    assert not (out / "model.safetensors.states").exists()
    return "held-out error on"


def surrogate_query(made: Path, out: Path) -> str:
    done("surrogate", "query", made / "points.csv", "--out", out / "found.csv")
    found = pd.read_csv(out / "found.csv")
    assert (found["omega_t_bar"] - found["omega_h_bar"]).tolist() == pytest.approx([8.0, -12.0], rel=1e-6)
    return "2 rows -> "


def surrogate_inverse(made: Path, out: Path) -> str:
    """Find the coefficient behind a yaw rate that the table gives itself."""
    robot = {name: np.array([value]) for name, value in PRESETS["paper-control"].group_values().items()}
    found = load().query(robot)
    targets = {**{k: v for k, v in robot.items() if k != "C_yr"}, "omega_yr_bar": found["omega_yr_bar"]}
    pd.DataFrame(targets).to_csv(out / "targets.csv", index=False)
    done("surrogate", "inverse", out / "targets.csv", "--out", out / "robots.csv", "--free", "C_yr")
    assert pd.read_csv(out / "robots.csv")["C_yr"].min() == pytest.approx(robot["C_yr"][0], rel=1e-3)
    return "robots.csv"


def surrogate_errors(made: Path, out: Path) -> str:
    done("surrogate", "errors", "--lookup", SHIPPED)
    return f"model {load().identity}"


def surrogate_robot(made: Path, out: Path) -> str:
    done("surrogate", "robot", made / "robot.toml", "--out", out / "table.json")
    own = ["--lookup", out / "table.json", "--out", out / "plan"]
    done("planner", "plan", "circle:1l", "--robot", made / "robot.toml", *own)
    assert len(load_plan(out / "plan" / "plan.json")["dwell_bar"]) > 20
    return "largest error"


def planner_plan(made: Path, out: Path) -> str:
    camera = ["--camera-errors", "0.02l", 0.03, 1.5, 0.5, 0.1]
    done("planner", "plan", "square:3l", "--robot", made / "robot.toml", *camera, "--out", out / "plan")
    assert names(out / "plan") == FILES
    assert load_plan(out / "plan" / "plan.json")["camera"] == Camera((0.02, 0.03), 1.5, 0.5, 0.1).to_dict()
    return "of the declared path"


def tracking_track(made: Path, out: Path) -> str:
    words = ["track", "circle:1l", "--robot", made / "robot.toml"]
    answer = subprocess.run(
        [sys.executable, "-m", "softflagella", *map(str, words)],
        input="0\n0.5 0 0 0\n", capture_output=True, text=True, check=True, timeout=LIMIT,
        cwd=ROOT,
    )  # fmt: skip
    print(answer.stdout)
    direction, flip_at, error, alarm = answer.stdout.splitlines()[0].split()
    assert (abs(int(direction)), int(alarm)) == (1, 0)
    assert float(flip_at) > 0 < float(error)
    return f"{direction} {flip_at}"


def planner_goal(made: Path, out: Path) -> str:
    """In centimetres, with walls from a file."""
    walls = np.array([[-2, -3], [5, -3], [5, 4], [-2, 4]])
    np.savetxt(out / "walls.csv", 11 * walls, delimiter=",")
    words = ["--unit", "cm", "--goal", 8.8, 2.2, 30, "--keep-out", "circle:16.5,33,5.5"]
    words += ["--walls", out / "walls.csv", "--robot", made / "robot.toml"]
    done("planner", "goal", *words, "--out", out / "trip")
    assert names(out / "trip") == FILES | {"goal.json", "goal.svg"}
    goal, end = load_goal(out / "trip" / "goal.json"), load_plan(out / "trip" / "plan.json")["predicted_poses"][-1]
    assert goal["goal"] == pytest.approx([0.8, 0.2, np.pi / 6])
    assert end == pytest.approx(goal["goal"], abs=1e-3)
    assert np.array(goal["walls"]) == pytest.approx(walls)
    assert goal["keep_out"][0]["circle"] == pytest.approx([1.5, 3, 0.5])
    return "end: (8.80, 2.20) cm = (0.800, 0.200) l, heading 30.0 degrees"


def planner_tour(made: Path, out: Path) -> str:
    """The same places in words and in a file."""
    (out / "places.csv").write_text("x_cm,y_cm\n0,0\n44,0\n22,11\n")
    words = ["--objective", "flips", "--robot", made / "robot.toml", "--out"]
    done("planner", "tour", "0,0", "4l,0", "2l,1l", *words, out / "words")
    done("planner", "tour", out / "places.csv", *words, out / "tour")
    assert names(out / "tour") == FILES | {"tour.json", "tour.svg"}
    said, read = (json.loads((out / name / "tour.json").read_text()) for name in ("words", "tour"))
    assert said["order"] == read["order"] == [0, 2, 1]
    assert np.array(said["places"]) == pytest.approx(np.array(read["places"]))
    return "order: 1 3 2; no other order is quicker"


def planner_hold(made: Path, out: Path) -> str:
    words = ["--for", "3min", "--robot", made / "robot.toml", "--objective", "flips"]
    done("planner", "hold", "2l,1l", *words, "--out", out / "held")
    assert names(out / "held") == FILES | {"hold.json", "hold.svg"}
    return "no schedule stays nearer"


def tracking_check(made: Path, out: Path) -> str:
    done("tracking", "check", made / "plan" / "plan.json", made / "track.csv", "--out", out / "overlay.png")
    assert (out / "overlay.png").read_bytes().startswith(b"\x89PNG")
    return "within the stated error"


def camera_view(made: Path, out: Path) -> str:
    done("camera", "view", "--out", out / "view.toml")
    assert read_setup(out / "view.toml").robots[0].colours == {"front": "red", "rear": "green"}
    return "view.toml"


def camera_lens(made: Path, out: Path) -> str:
    pytest.importorskip("cv2", reason="the extra camera is not installed")
    done("camera", "lens", *boards(out, POSES))
    return "[lens]  # 8 pictures of a chessboard"


def camera_tracks(made: Path, out: Path) -> str:
    pytest.importorskip("cv2", reason="the extra camera is not installed")
    tank = Tank(width=320, height=240, scale=0.001)
    (out / "view.toml").write_text(tank.view_toml())
    film = tank.film(out / "film.mp4", circling(), 1.0)
    done("camera", "tracks", film, "--robot", "paper-control", "--view", out / "view.toml", "--out", out / "t.csv")
    assert len(pd.read_csv(out / "t.csv")) == 15
    return "15 poses -> "


def softflagella_calibrate(made: Path, out: Path) -> str:
    with on_the_toy(few=True):
        toy_table(5, lengths_cm=(6.0, 9.0)).to_csv(out / "t.csv", index=False)
        words = [out / "t.csv", "--robot", "paper-measured", "--no-path", "--own", "l_cm=5,11", "--out"]
        done("softflagella", "calibrate", *words, out / "out")
    assert json.loads((out / "out" / "verdict.json").read_text())["verdict"] == "none"
    assert load_robot(out / "out" / "corrected.toml").C_t == pytest.approx(3.1, rel=0.1)
    assert "<svg" in (out / "out" / "report.html").read_text()
    return "Nothing is missing that these runs can show. [nothing beyond noise]"


def calibration_simulate(made: Path, out: Path) -> str:
    with on_the_toy():
        words = ["--robot", "paper-measured", "--out", out / "t.csv", "--seed", 4, "--effect", "disc_drag=0.5"]
        done("calibration", "simulate", *words)
        model = toy_swimmer(pd.read_csv(out / "t.csv"))
        plain = model.predict([start_values(model)])[0] - model.runs.y
        dragged = model.predict([{**start_values(model), "disc_drag": 0.5}])[0] - model.runs.y
    assert (dragged**2).mean() < 0.03**2 < (plain**2).mean()
    return "128 runs -> "


def calibration_tracks(made: Path, out: Path) -> str:
    track(0).to_csv(out / "tracks.csv", index=False)
    pd.DataFrame({"run": [1], "N": 2, "l_cm": 11.0, "omega_rpm": -150.0}).to_csv(out / "runs.csv", index=False)
    done("calibration", "tracks", out / "tracks.csv", out / "runs.csv", "--out", out / "table.csv")
    assert pd.read_csv(out / "table.csv")["R_yr_cm"][0] == pytest.approx(RADIUS, rel=5e-3)
    return "1 runs -> "


def calibration_decide(made: Path, out: Path) -> str:
    (out / "verdict.json").write_text(json.dumps(ambiguous().to_dict()))
    before = toy_table(1, lengths_cm=(8.0,), **{DRAG: 4.0})
    new = toy_table(2, lengths_cm=(5.0, 11.0), **{DRAG: 4.0}).assign(session="new")
    pd.concat([before, new.head(10)]).to_csv(out / "more.csv", index=False)
    with on_the_toy():
        words = [out / "more.csv", out / "verdict.json", "--robot", "paper-measured"]
        done("calibration", "decide", *words)
    return "Decided: head's end-over-end drag."


@pytest.mark.slow
@pytest.mark.parametrize(("package", "name"), COMMANDS, ids=[" ".join(command) for command in COMMANDS])
def test_every_command_does_its_work(
    package: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made()
    capsys.readouterr()
    if said := SAID.get(f"{package} {name}"):
        done(package, name)
    else:
        said = globals()[f"{package}_{name}"](made(), tmp_path)
    output = capsys.readouterr()
    assert said in output.out
    assert "Traceback" not in output.err
