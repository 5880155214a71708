"""Motion of the paper's control example by an independent solver.

The robot has N = 2, C = (3.0, 2.8, 2.0) and ω̄ = 10 (`sim.model.presets`: paper-control). The solver is another
program for the same equations: 32 edges on a tail, converged in the step. Its numbers are typed from its output.
"""

from __future__ import annotations

INDEPENDENT = {  # by column of `sim.motion.steady_motion`
    "omega_t_bar": 7.589,
    "omega_h_bar": -2.411,
    "omega_yr_bar": 0.0490,
    "v_x": 0.0425,
    "v_z": 0.0180,
    "R_yr_over_l": 0.9415,
    "theta_deg": 67.1,
}
