"""Standard deviations beside the numbers of a robot.toml."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sim.inputs import load_robot, save_robot
from sim.io.errors import InputError
from sim.model.presets import PRESETS
from sim.model.robot_toml import robot_toml
from sim.model.uncertainty import DEFAULTS, Sigma

ROBOT = PRESETS["paper-measured"]


def test_stated_ones_are_read_back_as_they_were_written(tmp_path: Path) -> None:
    stated = {
        "youngs_modulus": Sigma(0.07, True),
        "tail_length": Sigma(5e-4, False),
        "disc_offset": Sigma(0.03, True),
        "viscosity": Sigma(0.0, False),
    }
    save_robot(replace(ROBOT, sigmas=stated), tmp_path / "robot.toml")
    found = load_robot(tmp_path / "robot.toml")
    assert found.sigmas == stated
    assert found == replace(ROBOT, sigmas=stated)
    assert found.sigma("youngs_modulus").of(found.youngs_modulus) == pytest.approx(0.07 * 1.2e6)
    assert found.sigma("tail_radius") == DEFAULTS["tail_radius"]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ('youngs_modulus_Pa_sigma = "ten %"', "youngs_modulus_Pa_sigma"),
        ("youngs_modulus_Pa_sigma = true", "a number in the unit of its key"),
        ("youngs_modulus_Pa_sigma = -1.0", "from 0 to half"),
        ("youngs_modulus_Pa_sigma = 0.9e6", "from 0 to half"),
        ('radius_m_sigma = "60 %"', "from 0 to half"),
        ("count_sigma = 1", "unknown entry"),
    ],
)
def test_what_is_no_standard_deviation_is_refused(line: str, expected: str, tmp_path: Path) -> None:
    text = robot_toml(ROBOT).replace("[tails]\n", f"[tails]\n{line}\n")
    (tmp_path / "robot.toml").write_text(text)
    with pytest.raises(InputError, match=expected):
        load_robot(tmp_path / "robot.toml")
