"""The files of a plan: they agree with it, and the header compiles."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from planner.files.plan_files import milliseconds, write_plan
from planner.paths.path import circle, polygon
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.schedule import load_schedule
from tests.processes import LIMIT

CONTROL = PRESETS["paper-control"]


def test_files_of_a_plan(tmp_path: Path) -> None:
    result = plan(polygon(4, 3.0), CONTROL)
    written = write_plan(result, tmp_path / "out")
    assert [p.name for p in written] == ["plan.json", "plan.csv", "schedule.h", "tracker.h", "plan.svg"]
    content = json.loads(written[0].read_text())
    assert content["stated_error_over_l"] == pytest.approx(result.stated_error)
    assert content["model"] == result.tracked.model
    schedule = load_schedule(written[0])
    assert np.array_equal(schedule.dwells, result.dwells)
    assert schedule.first_direction == result.first_direction
    assert schedule.robot == result.to_dict()["robot"]["groups"]
    header = written[2].read_text()
    numbers = [int(v) for v in header.split("{")[1].split("}")[0].replace("\n", " ").split(",")]
    assert sum(numbers) == pytest.approx(1000 * result.seconds.sum(), abs=1)
    assert f"SCHEDULE_COUNT {len(numbers)}" in header
    assert "<svg" in written[4].read_text()


def test_the_header_compiles(tmp_path: Path) -> None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    header = write_plan(plan(circle(2.0), CONTROL), tmp_path)[2]
    (tmp_path / "main.c").write_text(
        '#include "schedule.h"\n#include <stdio.h>\nint main(void){long s=0;'
        "for(int i=0;i<SCHEDULE_COUNT;i++)s+=schedule_ms[i];"
        'printf("%ld %ld %f %f %ld",s,(long)SCHEDULE_TOTAL_MS,SCHEDULE_START_X_CM,SCHEDULE_START_HEADING_DEG,'
        "(long)schedule_checkpoints[SCHEDULE_CHECKPOINTS-1].ms);return 0;}"
    )
    subprocess.run(
        [compiler, "-Wall", "-Werror", "-o", str(tmp_path / "a"), str(tmp_path / "main.c")],
        check=True,
        timeout=LIMIT,
    )
    words = subprocess.run(
        [str(tmp_path / "a")], capture_output=True, text=True, check=True, timeout=LIMIT
    ).stdout.split()
    total = int(words[0])
    content = json.loads((header.parent / "plan.json").read_text())
    seconds = content["dwell_s"]
    assert int(words[1]) == int(words[4]) == total
    start = [
        100 * CONTROL.tail_length * content["start"]["x_over_l"],
        math.degrees(content["start"]["heading_rad"]),
    ]
    assert [float(words[2]), float(words[3])] == pytest.approx(start, abs=1e-3)
    assert total == pytest.approx(1000 * sum(seconds), abs=1)


def test_milliseconds_carry_rounding_and_split_long_dwells() -> None:
    assert sum(milliseconds(np.full(1000, 0.0104))) == 10400
    assert milliseconds(np.array([1.0, 140.0])) == [1000, 65535, 0, 65535, 0, 8930]
    assert milliseconds(np.array([65.535, 65.536])) == [65535, 65535, 0, 1]
    with pytest.raises(InputError, match="longer minimum dwell"):
        milliseconds(np.array([1.0, 0.0001]))


def identities(folder: Path) -> set[str]:
    """What the files of a plan say which plan they belong to."""
    header, tracker = ((folder / name).read_text().split("Plan ")[1][:12] for name in ("schedule.h", "tracker.h"))
    (column,) = set(pd.read_csv(folder / "plan.csv")["plan_id"])
    named = (folder / "plan.svg").read_text().split("<dc:identifier>")[1].split("<")[0].strip()
    return {json.loads((folder / "plan.json").read_text())["id"], column, header, tracker, named}


def test_all_files_name_the_same_plan_and_another_plan_replaces_them(tmp_path: Path) -> None:
    """Two plans in one folder used to mix: plan.json of one beside schedule.h of the other."""
    small, large = plan(circle(2.0), CONTROL), plan(circle(2.5), CONTROL)
    (tmp_path / "goal.json").write_text("{}")
    write_plan(small, tmp_path, pictures={"trade_off.svg": Figure()})
    first = identities(tmp_path)
    assert not (tmp_path / "goal.json").exists()
    write_plan(large, tmp_path)
    assert len(first) == len(identities(tmp_path)) == 1
    assert first != identities(tmp_path)
    assert not (tmp_path / "trade_off.svg").exists()


def test_a_plan_that_cannot_be_drawn_leaves_the_plan_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_plan(plan(circle(2.0), CONTROL), tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def broken(*_: object) -> None:
        raise RuntimeError

    monkeypatch.setattr("planner.files.plan_files.plan_svg", broken)
    with pytest.raises(RuntimeError):
        write_plan(plan(circle(2.5), CONTROL), tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


@pytest.mark.parametrize("name", [r"a$\frac$b", "*/ #error", '"', "ü\n"])
def test_any_name_of_a_robot_can_be_drawn_and_compiled(name: str, tmp_path: Path) -> None:
    """A formula in the name used to end with a traceback of the drawing, after four of five files."""
    write_plan(plan(circle(2.0), replace(CONTROL, name=name)), tmp_path)
    assert len(identities(tmp_path)) == 1
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler:
        source = '#include "schedule.h"\n#include "tracker.h"\nint main(void){return schedule_ms[0]==0;}'
        (tmp_path / "main.c").write_text(source)
        words = [compiler, "-std=c99", "-o", str(tmp_path / "a"), str(tmp_path / "main.c"), "-lm"]
        subprocess.run(words, check=True, timeout=LIMIT)
