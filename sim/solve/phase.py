"""What the phase of the disc at a flip does to a robot's way: robots with two tails or one, from all phases.

The velocities after a flip, u(φ, t), are known at the instants of a turn and vary slowly in t
(`sim.solve.transient`). A robot that flips at the phase φ0 has those of φ0 + ∫ω_t dt. Its head also wobbles in
each turn. A wobble comes and goes, so it is no part of a lag: lags lead from the mean pose of a turn before the
flip to that of a turn after it. Poses are integrated by the midpoint method, with _STEPS in a period of a wobble.
Right after the flip velocities fall steeply; a lag that was followed at all phases leads over that. Time steps
give 0.5 to 1.1 of the heading's deviation over φ0.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from common.arrays import Floats
from sim.jit import compiled_fast
from sim.mechanics import planar
from sim.mechanics.balance import tail_spin
from sim.model.body import Body

_STEPS = 16  # of a period
_PHASES = 6  # at the flip


def at_instants(body: Body, u: Floats) -> Floats:
    """Return (v_z, h_x, ω_yr, ω_t), (..., P, 4), of one robot for its velocities u (..., P, 4)."""
    v_x, v_z, yaw = u[..., 0], u[..., 1], u[..., 2]
    spin = tail_spin(body, np.moveaxis(u, -1, 0))
    return np.stack([v_z, v_x + yaw * body.head_length / 2, yaw, spin], -1)


def lags_by_phase(
    before: Floats, times: Floats, lag: Floats, after: Floats, tails: int, twist: Floats, dwells: Floats
) -> Floats:
    """Compute the lags of a robot that flips at equal phases of the disc, (F, D, 3).

    Args:
        before: (v_z, h_x, ω_yr, ω_t) before the flip at the instants of a turn, an odd number, (P, 4).
        times: after the flip, (T,), increasing; the first one is short beside a turn.
        lag: at the first time at the same instants, (P, 3).
        after: the same velocities at these times, at the same instants, (T, P, 4).
        tails: N.
        twist: steady (v_z, h_x, ω_yr) after the flip.
        dwells: (D,), increasing.
    """
    phases = 2 * np.pi * np.arange(_PHASES) / _PHASES
    at_flip = phases - tails * after[0, :, 3].mean() * times[0]
    moved = planar.compose(_at_phases(_waves(lag), phases), planar.arc(twist, times[0]))
    start = planar.compose(_at_phases(_wobble(before, tails), at_flip), moved)
    speeds = _waves(after)
    step = 2 * np.pi / (_STEPS * tails * np.abs(after[..., 3]).max())
    poses, ends = _swim(times, speeds.real.copy(), speeds.imag.copy(), tails, start, phases, dwells, step)
    at = np.clip(np.searchsorted(times, dwells), 1, len(times) - 1)
    share = np.minimum((dwells - times[at - 1]) / (times[at] - times[at - 1]), 1.0)[:, None, None]
    wobble = _wobble(after[at - 1] + share * (after[at] - after[at - 1]), tails)
    mean = planar.compose(poses, planar.inverse(np.moveaxis(_at_phases(wobble, ends.T), 0, 1)))
    return planar.compose(mean, planar.inverse(planar.arc(twist, dwells)))


def _waves(values: Floats) -> Any:
    """Return Fourier coefficients (..., H + 1, C) of values (..., P, C): Σ Re c_m exp(i m N φ)."""
    count = values.shape[-2]
    waves = np.fft.rfft(values, axis=-2) / count
    waves[..., 1:, :] *= 2
    return waves


def _at_phases(waves: Any, phases: Floats) -> Floats:
    """Evaluate coefficients (..., H + 1, C) at phases (..., F) of the period, (..., F, C)."""
    return np.asarray((np.exp(1j * phases[..., None] * np.arange(waves.shape[-2])) @ waves).real)


def _wobble(velocities: Floats, tails: int) -> Any:
    """Return Fourier coefficients (..., H + 1, 3) of the pose beside its mean over a turn, from (..., P, 4)."""
    rate, instants = tails * velocities[..., 3:], velocities.shape[-2]
    mean = (velocities[..., :3] / rate).sum(-2, keepdims=True) / (1 / rate).sum(-2, keepdims=True)
    change = velocities[..., :3] - mean
    orders = 1j * np.maximum(np.arange(instants // 2 + 1), 1)[:, None]
    heading = _waves(change[..., 2:] / rate) / orders
    heading[..., 0, :] = 0.0
    angle = _at_phases(heading, 2 * np.pi * np.arange(instants) / instants)
    turned = angle * np.concatenate([-mean[..., 1:2], mean[..., :1]], -1)
    place = _waves((change[..., :2] + turned) / rate) / orders
    place[..., 0, :] = 0.0
    return np.concatenate([place, heading], -1)


@compiled_fast
def _swim(
    times: Floats, real: Floats, imaginary: Floats, tails: int, start: Floats, phases: Floats, dwells: Floats,
    step: float,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Integrate poses (F, D, 3) and phases of the period (F, D) at the dwells, from the first time on.

    Args:
        times: (T,), increasing.
        real, imaginary: of the waves of (v_z, h_x, ω_yr, ω_t) at these times, (T, H + 1, 4).
        tails: N.
        start: poses at the first time, (F, 3).
        phases: of the period there, (F,).
        dwells: (D,).
        step: longest step.
    """
    count, orders = len(start), real.shape[1]
    poses, ends = np.empty((count, len(dwells), 3)), np.empty((count, len(dwells)))
    speed = np.empty(4)
    for f in range(count):
        z, x, psi, phase, now, k = start[f, 0], start[f, 1], start[f, 2], phases[f], times[0], 0
        for d in range(len(dwells)):
            while now < dwells[d] - 1e-12:
                dt = min(step, dwells[d] - now)
                middle = now + dt / 2
                while k < len(times) - 2 and times[k + 1] < middle:
                    k += 1
                share = min(max((middle - times[k]) / (times[k + 1] - times[k]), 0.0), 1.0)
                half_turn = 0.0
                for _ in range(2):  # the phase in the middle of the step needs the spin there
                    for c in range(4):
                        speed[c] = real[k, 0, c] + share * (real[k + 1, 0, c] - real[k, 0, c])
                        for m in range(1, orders):
                            re = real[k, m, c] + share * (real[k + 1, m, c] - real[k, m, c])
                            im = imaginary[k, m, c] + share * (imaginary[k + 1, m, c] - imaginary[k, m, c])
                            angle = m * (phase + half_turn)
                            speed[c] += re * np.cos(angle) - im * np.sin(angle)
                    half_turn = tails * speed[3] * dt / 2
                heading = psi + speed[2] * dt / 2
                z += dt * (np.cos(heading) * speed[0] - np.sin(heading) * speed[1])
                x += dt * (np.sin(heading) * speed[0] + np.cos(heading) * speed[1])
                psi += dt * speed[2]
                phase += 2 * half_turn
                now += dt
            poses[f, d, 0], poses[f, d, 1], poses[f, d, 2], ends[f, d] = z, x, psi, phase
    return poses, ends
