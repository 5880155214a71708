"""Reference values typed from their sources.

Single filament: boundary-value solution of the continuous rod (nothing discretised as a rod) for
a = R = 16 mm, l = 0.11 m, r0 = 3.2 mm, E = 1.2 MPa, μ0 = 1.49 Pa s, no inertia. Forces of the fluid on the rod.
Elastica: inextensible cantilever with a dead tip load (elliptic integrals). Linear rotating filament: small
offset a, S = ζ⊥ ω l⁴/EI. Clamped-free beam: roots of cos k cosh k = −1. Steady points: an independent solver of
the same equations, 32 edges, converged in the step.
"""

from __future__ import annotations

# ω [rad/s]: (|F_z| [N], |M_z| [N m])
FILAMENT = {
    2.0: (6.130e-4, 1.732e-4),
    4.0: (9.848e-4, 2.571e-4),
    8.0: (1.37038e-3, 4.32812e-4),
    12.0: (1.8005e-3, 6.183e-4),
    16.0: (2.3513e-3, 8.036e-4),
}
FILAMENT_TIP = (-0.06898, -0.03756, 0.97213)  # over l, at 8 rad/s, tail along +z

# α = P l²/EI: (w/l, u/l)
ELASTICA = {1.0: (0.30172, 0.05643), 2.0: (0.49346, 0.16064), 5.0: (0.71379, 0.38763), 10.0: (0.81061, 0.55500)}

# S: (thrust/[(ζ⊥ − ζ∥) ω a²], tip offset/a)
LINEAR_FILAMENT = {1.0: (0.124, 0.998), 10.0: (0.763, 0.840), 30.0: (0.594, 0.603), 100.0: (0.372, 0.508)}

BEAM_K4 = (12.3624, 485.519)

# The paper's measured point: N = 4, l = 11 cm, 143.66 rpm: ω_h = 63.33, ω_t = 80.33 rpm.
MEASURED_HEAD_SHARE = 63.33 / 143.66
INDEPENDENT_HEAD_SHARE = 0.403

# Points of the independent solver over the sweep domain:
# C_t, C_r, C_yr, l/R, L/R, l/r0, ω̄, N -> ω̄_t, ω̄_h, ω̄_yr, v_x, v_z, R_yr/l, θ [deg]
STEADY_POINTS = (
    ((2.767, 2.475, 4.729, 4.877, 2.338, 24.753, 35.717, 2),
     (29.623351, -6.093649, 0.303738, 0.244842, 0.063683, 0.832917, 75.420475)),
    ((5.152, 2.501, 2.198, 7.659, 4.678, 42.825, 1.686, 3),
     (0.820901, -0.865099, 0.012054, 0.011031, 0.000678, 0.91688, 86.482443)),
    ((1.956, 3.862, 3.21, 9.11, 3.333, 19.357, 9.848, 5),
     (4.919857, -4.928143, 0.116193, 0.092968, 0.01418, 0.809368, 81.327736)),
    ((3.156, 1.312, 3.413, 3.692, 4.96, 16.415, 95.716, 2),
     (74.077493, -21.638507, 1.426773, 1.629855, 0.242873, 1.15495, 81.524416)),
    ((3.696, 2.297, 0.679, 5.963, 3.051, 45.353, 20.923, 4),
     (13.653677, -7.269323, 0.038184, 0.032177, 0.04088, 1.362476, 38.206226)),
    ((2.543, 3.587, 1.712, 4.058, 4.389, 30.209, 13.415, 5),
     (9.979561, -3.435439, 0.112824, 0.121194, 0.078784, 1.281194, 56.973511)),
)  # fmt: skip
STEADY_INPUTS = ("C_t", "C_r", "C_yr", "l_over_R", "L_over_R", "l_over_r0", "omega_bar", "N")
