"""The files of a plan: they agree with it, and the header compiles."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from planner.files.plan_files import milliseconds, write_plan
from planner.files.plan_json import plan_record
from planner.paths.path import circle, polygon
from planner.planning.plan import plan
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.schedule import load_schedule

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
    assert schedule.robot == plan_record(result)["robot"]["groups"]
    header = written[2].read_text()
    numbers = [int(v) for v in header.split("{")[1].split("}")[0].replace("\n", " ").split(",")]
    assert sum(numbers) == pytest.approx(1000 * result.seconds.sum(), abs=1)
    assert f"SCHEDULE_COUNT {len(numbers)}" in header
    assert "<svg" in written[4].read_text()


def test_the_header_compiles(tmp_path: Path) -> None:
    import shutil

    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    header = write_plan(plan(circle(2.0), CONTROL), tmp_path)[2]
    (tmp_path / "main.c").write_text(
        '#include "schedule.h"\n#include <stdio.h>\nint main(void){long s=0;'
        "for(int i=0;i<SCHEDULE_COUNT;i++)s+=schedule_ms[i];"
        'printf("%ld %ld %f %f %ld",s,(long)SCHEDULE_TOTAL_MS,SCHEDULE_START_X,SCHEDULE_START_HEADING,'
        "(long)schedule_checkpoints[SCHEDULE_CHECKPOINTS-1].ms);return 0;}"
    )
    subprocess.run([compiler, "-Wall", "-Werror", "-o", str(tmp_path / "a"), str(tmp_path / "main.c")], check=True)
    words = subprocess.run([str(tmp_path / "a")], capture_output=True, text=True, check=True).stdout.split()
    total = int(words[0])
    content = json.loads((header.parent / "plan.json").read_text())
    seconds = content["dwell_s"]
    assert int(words[1]) == int(words[4]) == total
    start = [content["start"]["x_over_l"], content["start"]["heading_rad"]]
    assert [float(words[2]), float(words[3])] == pytest.approx(start, abs=1e-6)
    assert total == pytest.approx(1000 * sum(seconds), abs=1)


def test_milliseconds_carry_rounding_and_split_long_dwells() -> None:
    assert sum(milliseconds(np.full(1000, 0.0104))) == 10400
    assert milliseconds(np.array([1.0, 140.0])) == [1000, 65535, 0, 65535, 0, 8930]
    with pytest.raises(InputError, match="longer minimum dwell"):
        milliseconds(np.array([1.0, 0.0001]))
