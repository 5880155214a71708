/* Dimensionless robots: the groups that the motion depends on.
 *
 * Mirrors `checked_values` of sim/model/groups.py, one robot at a time. */
import { InputError } from "./input_error.js";
import { general, repr } from "./format.js";

const GROUP_COLUMNS = ["C_t", "C_r", "C_yr", "l_over_R", "L_over_R", "l_over_r0", "omega_bar", "N"];
const MOST_TAILS = 64;
const LEAST_SLENDERNESS = 5;
const POSITIVE = ["C_t", "C_r", "l_over_R", "L_over_R", "a_over_R"];

/* Return a robot's groups with a_over_R filled in; refuse numbers that no robot has. */
function checkedGroups(robot) {
  const missing = GROUP_COLUMNS.find((name) => !(name in robot));
  if (missing) {
    throw new InputError(`missing column '${missing}'; a robot needs ${GROUP_COLUMNS.join(", ")}`);
  }
  const values = { a_over_R: 1, ...robot };
  for (const [name, value] of Object.entries(values)) {
    if (typeof value !== "number") {
      throw new InputError(`column '${name}' has a value that is no number; give numbers`);
    }
  }
  for (const [name, value] of Object.entries(values)) {
    if (!Number.isFinite(value)) {
      throw new InputError(`${name} = ${repr(value)} in row 1; it must be a finite number`);
    }
  }
  for (const name of POSITIVE) {
    if (values[name] <= 0) throw new InputError(`${name} = ${general(values[name])} in row 1; it must be above 0`);
  }
  const ratio = values.l_over_r0;
  if (!(ratio > LEAST_SLENDERNESS)) {
    throw new InputError(
      `l/r0 = ${general(ratio)}; resistive force theory needs slender tails: above ${LEAST_SLENDERNESS}`,
    );
  }
  if (values.omega_bar === 0) {
    throw new InputError("omega_bar = 0 in row 1; the motor must turn: give a non-zero speed");
  }
  checkTails(values.N);
  return values;
}

function checkTails(count) {
  if (Number.isInteger(count) && count >= 1 && count <= MOST_TAILS) return;
  throw new InputError(`N = ${general(count)}; the number of tails is an integer from 1 to ${MOST_TAILS}`);
}

export { MOST_TAILS, checkedGroups, checkTails };
