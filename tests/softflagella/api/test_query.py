"""Inverse queries and exports of look-up tables."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

import softflagella as sf

ROBOT = sf.load_robot("paper-control")


def test_a_robot_is_found_by_its_motion() -> None:
    values = ROBOT.group_values()
    motion = sf.query(ROBOT)
    given = {name: value for name, value in values.items() if name not in ("C_t", "C_yr")}
    targets = {name: motion[name].item() for name in ("omega_yr_bar", "v_z")}
    robots = sf.inverse(pd.DataFrame([{**given, **targets}] * 2), free=["C_t", "C_yr"])
    for target in (1, 2):
        found = robots[robots["target"] == target].iloc[0]
        assert (found["C_t"], found["C_yr"]) == pytest.approx((values["C_t"], values["C_yr"]), rel=1e-4)
    with pytest.raises(sf.InputError, match="has no outputs"):
        sf.inverse(given)
    with pytest.raises(sf.InputError, match="N cannot be found"):
        sf.inverse({**given, **targets}, free=["N"])


def test_a_small_copy_is_of_a_trained_table(tmp_path: Path) -> None:
    own = sf.tabulate(ROBOT)
    with pytest.raises(sf.InputError, match="table of a single robot"):
        sf.export(tmp_path, lookup=own)
    assert sf.query(ROBOT, lookup=own)["error"].item() < 0.01
    own.save(tmp_path / "own.json")
    assert sf.query(ROBOT, lookup=tmp_path / "own.json").equals(sf.query(ROBOT, lookup=own))
