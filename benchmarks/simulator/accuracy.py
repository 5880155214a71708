"""Accuracy of the simulator at its default resolution against independent references.

Usage: python -m benchmarks accuracy

Takes 20 seconds.
"""

from __future__ import annotations

import numpy as np

from sim.model.presets import INDEPENDENT, PRESETS
from sim.motion.batches import steady_columns
from sim.motion.steady import steady
from tests.reference.cases import FILAMENT, MEASURED_HEAD_SHARE, STEADY_INPUTS, STEADY_POINTS
from tests.sim.robots import extrapolated_loads

_OUTPUTS = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l")


def filament() -> None:
    robot = PRESETS["paper-control"]
    force = robot.bending_stiffness / robot.tail_length**2
    print("\nOne clamped filament against the boundary-value solution (which is given to four digits)")
    print("omega [rad/s]   thrust error   moment error")
    for omega, (thrust, moment) in FILAMENT.items():
        wrench = extrapolated_loads(omega * robot.time_scale, robot.tail_length / robot.tail_radius, 0.016 / 0.11)
        errors = abs(wrench[1]) * force / thrust - 1, abs(wrench[3]) * force * robot.tail_length / moment - 1
        print(f"{omega:13.0f}   {100 * errors[0]:10.3f} %   {100 * errors[1]:10.3f} %")


def robots() -> None:
    inputs = np.array([p[0] for p in STEADY_POINTS]).T
    truth = np.array([p[1] for p in STEADY_POINTS]).T
    columns = steady_columns(dict(zip(STEADY_INPUTS, inputs, strict=True)))
    print(f"\nWhole robot: largest error over {len(STEADY_POINTS)} points of an independent solver")
    for name, values in zip(_OUTPUTS, truth, strict=False):
        print(f"  {name:14} {100 * np.abs(columns[name] / values - 1).max():7.3f} %")
    print(f"  theta          {np.abs(columns['theta_deg'] - truth[6]).max():7.3f} degrees")
    print(f"  largest error that a row states of itself {100 * columns['error'].max():.3f} %")
    motion = steady(PRESETS["paper-control"].groups())
    control = motion.columns()
    print("\nThe paper's control example (N = 2, C = (3.0, 2.8, 2.0), motor at 10)")
    print("                 here   independent")
    for name, value in INDEPENDENT.items():
        print(f"  {name:14} {control[name][0]:9.4f} {value:9.4f}")
    measured = steady(PRESETS["paper-measured"].groups())
    share = float(measured.omega_h[0] / (measured.omega_h[0] - measured.omega_t[0]))
    print("\nThe paper's measured point (N = 4, l = 11 cm, 143.66 rpm): omega_h/omega")
    print(f"  measured {MEASURED_HEAD_SHARE:.3f}, here with the paper's fit {share:.3f}")


def main() -> None:
    filament()
    robots()
