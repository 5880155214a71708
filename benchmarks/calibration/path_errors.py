"""The error on a square, before and after a calibration: as the report states it, and on the true robot.

Each robot has its own coefficients and one hidden effect or law. Its table of 128 runs is simulated on a finer
mesh by time stepping, with 2.5 % of noise and session scatter; the fitter starts from the paper's coefficients.
The schedules planned with the robot as given and with the corrected robot are those of the report, and are
replayed in time steps on the true robot. Distances are from the square as drawn, in tail lengths.

Usage: python -m benchmarks path_errors [ROBOTS] [FIRST]

Takes 15 minutes.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from calibration.report.path_error import CarriedOut, path_errors, wanted_paths
from calibration.report.robot_verdict import calibrate_robot
from calibration.swimmer.synthetic_table import make_table
from planner.paths.distance import distance_to
from sim.model.presets import PRESETS
from sim.model.robot import Robot
from sim.motion.replay import replay

HIDDEN = (
    ("end_over_end_drag", 5.0), ("disc_drag", 1.0), ("tail_spin_drag", 1.0), ("anisotropic_head_drag", 0.5),
    ("natural_splay", 0.2), ("surface_couple", 0.4), ("law_Fx_wh_speed-93_length425_tails0", 0.4),
    ("law_Cyr_speed100_length400_tails0", 1.0),
)  # fmt: skip


def main(robots: str = "8", first: str = "0") -> None:
    given = PRESETS["paper-measured"]
    wanted = wanted_paths(["square:3l"], given)
    print(
        "distance from a square of side 3 l [l]: rms, and at the end; stated: the distance within which 95 % stay"
    )
    print(f"{'hidden':36} verdict       planned with   true robot     stated in the report   within stated")
    gains = []
    for seed in range(int(first), min(int(first) + int(robots), len(HIDDEN))):
        name, size = HIDDEN[seed]
        rng = np.random.default_rng(seed)
        C_t, C_r, C_yr = np.array([2.5, 2.2, 3.5]) * np.exp(rng.uniform(-0.3, 0.3, 3))
        truth = replace(given, C_t=C_t, C_r=C_r, C_yr=C_yr, effects={name: size})
        verdict = calibrate_robot(make_table(truth, seed=seed, title=""), given, jobs=1, progress=False)
        began = time.process_time()
        (error,) = path_errors(wanted, given, verdict.corrected, verdict.knowledge)
        seconds = time.process_time() - began
        rms, metres = {}, error.tail_length
        for model, carried in error.carried_out.items():
            rms[model], largest, end = on_true_robot(carried, truth)
            print(f"{f'{name}={size:g}':36} {verdict.verdict:13} {model:12} {rms[model]:6.3f} {end:6.3f}"
                  f"{carried.rms / metres:10.3f} {carried.end / metres:6.3f} {carried.within / metres:6.3f}"
                  f"{'yes' if largest <= carried.within / metres else 'no':>12}", flush=True)  # fmt: skip
        print(*error.refusals, f"named: {', '.join(verdict.effects) or '-'}; {seconds:.1f} s of processor time",
              sep="\n", flush=True)  # fmt: skip
        if len(rms) == 2:
            gains.append(rms["as_given"] / rms["corrected"])
    print(f"rms on the true robot falls to 1/{min(gains):.1f} to 1/{max(gains):.1f}, "
          f"1/{np.median(gains):.1f} at the median of {len(gains)}")  # fmt: skip


def on_true_robot(carried: CarriedOut, truth: Robot) -> tuple[float, float, float]:
    """Replay a schedule in time steps on the true robot.

    Returns:
        Distance from the drawn path, rms over time and at most, and that of the ends, in its tail lengths.
    """
    plan = carried.plan
    track = replay([plan.schedule(truth)])[0]
    places = track[["x_over_l", "y_over_l"]].to_numpy()
    path = plan.drawn.scaled(plan.robot.tail_length / truth.tail_length).polyline()
    distance = distance_to(path, places)
    weight = np.gradient(track["time_bar"].to_numpy())
    rms = float(np.sqrt((weight * distance**2).sum() / weight.sum()))
    return rms, float(distance.max()), float(np.hypot(*(places[-1] - path[-1])))
