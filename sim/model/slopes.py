"""Names in derivatives of the steady motion, which `sim.motion.sensitivity` gives and data sets store.

SLOPE_INPUTS are groups of `sim.model.groups`; effects can be inputs, too.
"""

SLOPE_INPUTS = ("C_t", "C_r", "C_yr", "l_over_R", "L_over_R", "l_over_r0", "omega_bar", "a_over_R")
SLOPE_OUTPUTS = ("omega_t_bar", "omega_h_bar", "omega_yr_bar", "v_x", "v_z", "R_yr_over_l", "theta_rad")
