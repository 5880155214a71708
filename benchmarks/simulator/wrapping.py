"""Torque of a tail against motor speed with the head held, beside the wrapping transition of tilted rods.

A rod that turns about an axis in a viscous fluid bends and wraps around the axis as the speed rises. If it starts
on the axis and is tilted, its torque falls meanwhile, and a motor of given torque jumps to a higher speed
(docs/wrapping.md has the literature). Tails of this robot start beside the axis and parallel to it. The five
geometries are the paper's tails of 7 to 15 cm, by the simulator; tilted rods are by linear theory.

    S = ζ⊥ ω l⁴/EI,   M: torque of a tail about the axis,   slope d ln M/d ln S: below 0 the torque falls

Usage: python -m benchmarks wrapping

Takes a minute.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from benchmarks.pictures import save_picture
from sim.arrays import Floats
from sim.mechanics.drag import tail_coefficients
from sim.model.presets import PRESETS
from sim.motion.lab_units import RPM
from tests.oracles.held_head import held_torque, linear_torque

_LENGTHS = (0.07, 0.09, 0.11, 0.13, 0.15)  # m, tails of the paper's experiments
_SPEED = 150.0  # rpm, about that of the paper's experiments
_S = np.geomspace(0.5, 2000.0, 60)
_OFFSETS = (0.0, 0.1, 0.2, 0.3, 0.4, 1.0)  # a/(θ l) of tilted rods in linear theory


class Curve(NamedTuple):
    """Torque of a tail over S."""

    label: str
    torque: Floats  # in EI/l; of linear theory per θ² or a²/l²
    at_speed: float = np.nan  # S at _SPEED

    @property
    def slope(self) -> Floats:
        """d ln M/d ln S."""
        return np.asarray(np.gradient(np.log(self.torque), np.log(_S)))

    @property
    def row(self) -> str:
        """Least slope, and where the torque falls."""
        slope = np.where(np.isfinite(self.slope), self.slope, np.inf)
        falls = _S[slope < 0]
        where = f"from S = {falls[0]:.0f} to {falls[-1]:.0f}" if len(falls) else "nowhere"
        at_speed = f"{self.at_speed:8.0f}" if np.isfinite(self.at_speed) else f"{'':8}"
        return f"  {self.label:36} {at_speed} {slope.min():12.2f} {_S[slope.argmin()]:8.0f}   {where}"


def tail_curve(length: float) -> Curve:
    """Compute the torque of a tail of a length [m] clamped at the head's radius."""
    robot = replace(PRESETS["paper-measured"], tail_length=length, motor_speed=_SPEED * RPM)
    groups = robot.groups()
    label = f"l = {100 * length:.0f} cm, a/l = {1 / groups.l_over_R[0]:.2f}, l/r0 = {groups.l_over_r0[0]:.0f}"
    at_speed = float(tail_coefficients(groups.l_over_r0)[1][0] * groups.omega_bar[0])
    return Curve(label, held_torque(groups, _S), at_speed)


def linear_curve(offset: float) -> Curve:
    """Compute the torque of a rod tilted by θ that starts at `offset` θ l from the axis, in linear theory."""
    label = "tilted, from the axis" if offset == 0 else f"tilted, a = {offset:g} θ l"
    return Curve(label, np.array([linear_torque(S, offset, 1.0) for S in _S]))


def main() -> None:
    with np.errstate(all="ignore"):
        tails = [tail_curve(length) for length in _LENGTHS]
    rods = [*map(linear_curve, _OFFSETS)]
    parallel = Curve("parallel to the axis, beside it", np.array([linear_torque(S, 1.0, 0.0) for S in _S]))
    print(f"\n  {'torque of a tail, head held':36} {'S at 150':>8} {'least slope':>12} {'at S':>8}   torque falls")
    for curve in tails:
        print(curve.row)
    print("  linear theory")
    for curve in (*rods, parallel):
        print(curve.row)
    save_picture(draw(tails, [rods[0], parallel]), "docs/wrapping.png")


def draw(tails: list[Curve], linear: list[Curve]) -> Figure:
    """Draw torque against S, and its slope."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for curve in tails:
        line = left.loglog(_S, curve.torque, label=curve.label)[0]
        right.semilogx(_S, curve.slope, color=line.get_color())
        dot = {"marker": "o", "color": line.get_color(), "mec": "k", "ls": ""}
        left.plot(curve.at_speed, np.interp(curve.at_speed, _S, curve.torque), **dot)
        right.plot(curve.at_speed, np.interp(curve.at_speed, _S, curve.slope), **dot)
    for curve, style in zip(linear, ("--", ":"), strict=True):
        left.loglog(_S, 0.1 * curve.torque, ls=style, color="0.3", label=f"linear, {curve.label} (scaled)")
        right.semilogx(_S, curve.slope, ls=style, color="0.3")
    right.axhline(0.0, color="0.6", lw=0.8)
    left.set_ylabel("torque of a tail about the axis [EI/l]")
    right.set_ylabel("d ln M/d ln S (below 0: the torque falls)")
    for axes in (left, right):
        axes.set_xlabel(f"S = ζ⊥ ω l⁴/EI (dots: {_SPEED:.0f} rpm)")
        axes.grid(alpha=0.3)
    left.legend(fontsize=7, frameon=False)
    return figure


if __name__ == "__main__":
    main()
