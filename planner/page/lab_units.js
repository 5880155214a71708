/* The steady motion of a robot in the units of a laboratory, under the column names of a measured table.
 *
 * Mirrors `lab_columns` of sim/motion/lab_units.py, one robot at a time. */

const RPM = (2 * Math.PI) / 60; // rad/s

/* Convert a dimensionless motion. lengthCm: tail length [cm]. timeScale: unit of time [s]. */
function labColumns(motion, lengthCm, timeScale) {
  return {
    omega_h_rpm: motion.omega_h_bar * (1 / timeScale / RPM),
    omega_t_rpm: motion.omega_t_bar * (1 / timeScale / RPM),
    omega_yr_rad_s: motion.omega_yr_bar / timeScale,
    R_yr_cm: motion.R_yr_over_l * lengthCm,
    theta_deg: motion.theta_deg,
    v_cm_s: (Math.hypot(motion.v_x, motion.v_z) * lengthCm) / timeScale,
  };
}

export { labColumns };
