"""Tables to test a calibration on: the simulator with a hidden effect, on a finer mesh, with noise.

The design is the paper's: tail counts, tail lengths, two motor levels, both directions, repeated trials, one
session for each tail count. The truth is simulated with half the edge length and half the step of the fitted
model, so that the two do not share their discretisation. Noise is multiplicative on spins, yaw rate and radius,
and additive on θ. A session shifts all its runs together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from common.errors import InputError
from common.keywords import checks_keywords
from sim.effects import effect_named
from sim.inputs import group_columns
from sim.model.robot import Robot
from sim.motion.batches import stepped_columns
from sim.motion.steady_motion import RPM, lab_columns


@checks_keywords
def make_table(
    robot: Robot,
    *,
    seed: int,
    tails: Sequence[int] = (2, 3, 4, 5),
    lengths_cm: Sequence[float] = (5.0, 7.0, 9.0, 11.0),
    motor_rpm: Sequence[float] = (100.0, 150.0),
    trials: int = 2,
    noise: float = 0.025,
    session_noise: float = 0.005,
    jobs: int | None = None,
    title: str = "table",
) -> pd.DataFrame:
    """Simulate a table of runs of `robot` (its effects are the truth), with the columns of `measured_table`.

    Args:
        robot: the truth; its tail count, tail length and motor speed are replaced by those of the design.
        seed: of the noise.
        tails, lengths_cm, motor_rpm, trials: the design; both directions of the motor.
        noise: scatter of single runs, relative (θ: radians).
        session_noise: scatter of sessions, one session a tail count.
        jobs: threads; default all processors.
        title: of the progress bar; empty for none.

    Raises:
        InputError: the robot cannot be simulated, or does not settle in a steady motion in some of the runs.

    Example:
        >>> from softflagella import load_robot, make_table
        >>> table = make_table(load_robot("paper-measured"), seed=1, tails=(2,), lengths_cm=(6.0,), title="")
        >>> len(table), table["N"].unique().tolist()
        (8, [2])
    """
    design = [(n, length, rpm) for n in tails for length in lengths_cm for rpm in motor_rpm]
    runs = [replace(robot, tails=n, tail_length=length / 100, motor_speed=rpm * RPM) for n, length, rpm in design]
    columns = group_columns(runs)
    odd = any(effect_named(name).symmetry == "odd" for name in robot.effects)
    directions = (1, -1) if odd else (1,)  # else a reversed motor mirrors the motion
    both = {k: np.concatenate([d * v if k == "omega_bar" else v for d in directions]) for k, v in columns.items()}
    motion = stepped_columns(both, finer=2, jobs=jobs, title=title)
    lost = np.flatnonzero(~np.isfinite(motion["omega_yr_bar"]))
    if lost.size:
        n, length, rpm = design[lost[0] % len(design)]
        raise InputError(
            f"{lost.size} of {len(motion['omega_yr_bar'])} motions do not become steady, for example N = {n}, "
            f"l = {length:g} cm, {rpm:g} rpm; choose smaller effects or another robot"
        )
    rng = np.random.default_rng(seed)
    shift = {n: rng.normal(scale=session_noise, size=4) for n in tails}
    rows = []
    for i, (n, length, rpm) in enumerate(design):
        for direction in (1, -1):
            at = i + len(design) if odd and direction < 0 else i
            sense = 1 if odd else direction
            seen = lab_columns({name: values[at] for name, values in motion.items()}, length, runs[i].time_scale)
            for trial in range(1, trials + 1):
                factor = np.exp(rng.normal(scale=noise, size=4) + shift[n])
                rows.append(
                    {
                        "N": n,
                        "l_cm": length,
                        "trial": trial,
                        "session": f"N={n}",
                        "omega_rpm": direction * rpm,
                        "omega_h_rpm": sense * float(seen["omega_h_rpm"]) * factor[0],
                        "omega_t_rpm": sense * float(seen["omega_t_rpm"]) * factor[1],
                        "omega_yr_rad_s": sense * float(seen["omega_yr_rad_s"]) * factor[2],
                        "R_yr_cm": float(seen["R_yr_cm"]) * factor[3],
                        "theta_deg": float(seen["theta_deg"]) + rng.normal(scale=math.degrees(noise)),
                    }
                )
    table = pd.DataFrame(rows)
    order = np.lexsort((rng.random(len(table)), table["N"]))
    table = table.iloc[order].reset_index(drop=True)
    table.insert(0, "run", np.arange(1, len(table) + 1))
    return table
