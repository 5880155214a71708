"""The robots that the shipped look-up table is for, and the wider ones that it learns."""

from __future__ import annotations

from sim.model.groups import GROUP_COLUMNS, OPTIONAL_COLUMNS

ROBOT = (*GROUP_COLUMNS, *OPTIONAL_COLUMNS)  # columns of a robot without effects
DOMAIN = {
    "C_t": (0.5, 8.0), "C_r": (0.5, 6.0), "C_yr": (0.2, 12.0), "l_over_R": (2.0, 12.0), "L_over_R": (1.5, 8.0),
    "l_over_r0": (12.0, 80.0), "omega_bar": (0.5, 150.0), "a_over_R": (0.5, 1.2),
}  # fmt: skip
MOST_TAILS = 8
WIDE = {
    "C_t": (0.3, 12.0), "C_r": (0.3, 9.0), "C_yr": (0.1, 18.0), "l_over_R": (1.85, 13.0), "L_over_R": (1.2, 10.0),
    "l_over_r0": (11.0, 88.0), "omega_bar": (0.42, 165.0), "a_over_R": (0.46, 1.3),
}  # fmt: skip
COEFFICIENTS = ("C_t", "C_r", "C_yr")  # of the head; the table needs no learning for them
# Where `surrogate.table.inverse` looks: for coefficients as far as there are learned robots.
BOUNDS = {name: (WIDE if name in COEFFICIENTS else DOMAIN)[name] for name in DOMAIN}
