"""Flow of single forces and torques in a viscous fluid (μ = 1), spread over a length so that it is finite.

Source: Pozrikidis (1992), ch. 2; spread as by Cortez, Fauci and Medovikov (2005).
"""

from __future__ import annotations

import numpy as np

from sim.jit import formula
from sim.linear.vectors import Vector, cross, dot, minus, plus, times


@formula
def stokeslets(at: Vector, start: Vector, end: Vector, force: Vector, spread: float) -> Vector:
    """Compute the velocity at a point from a force that is constant on a straight segment, spread over a length.

    With σ along the segment from the foot of the perpendicular c, and R² = σ² + |c|² + spread²:
    ∫ [(1/R + spread²/R³) f + (r·f) r/R³] dσ/8π, r = c − σ t.
    """
    segment = minus(end, start)
    length = np.sqrt(dot(segment, segment))
    t = times(1 / length, segment)
    away = minus(at, start)
    foot = dot(away, t)
    c = minus(away, times(foot, t))
    square = dot(c, c) + spread * spread
    first, last = -foot, length - foot
    r_first, r_last = np.sqrt(first * first + square), np.sqrt(last * last + square)
    if first > 0:
        log = np.log((last + r_last) / (first + r_first))
    elif last < 0:
        log = np.log((r_first - first) / (r_last - last))
    else:
        log = np.log((last + r_last) * (r_first - first) / square)
    cubes = (last / r_last - first / r_first) / square
    first_moment = 1 / r_first - 1 / r_last
    second_moment = log - (last / r_last - first / r_first)
    by_c, by_t = dot(c, force), dot(t, force)
    total = times(log + spread * spread * cubes, force)
    total = plus(total, times(cubes * by_c - first_moment * by_t, c))
    total = plus(total, times(second_moment * by_t - first_moment * by_c, t))
    return times(1 / (8 * np.pi * length), total)


@formula
def rotlet(away: Vector, torque: Vector, spread: float) -> Vector:
    """Compute the velocity at a distance `away` from a torque on the fluid that is spread over a length."""
    square = dot(away, away) + spread * spread
    scale = (square + 1.5 * spread * spread) / (8 * np.pi * square * square * np.sqrt(square))
    return times(scale, cross(torque, away))
