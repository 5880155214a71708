/* What a user asks of a plan, besides path and robot.
 *
 * Mirrors planner/planning/request.py. Lengths in l, times in μ0 l⁴/EI. */
import { QUICK } from "./dwell_choice.js";
import { general } from "./format.js";
import { InputError } from "./input_error.js";

const DEFAULTS = {
  point: "head_centre", corner: "nearest", timeWeight: 0, objective: "error", minimumDwell: null,
  minimumSeconds: null, dwell: null, tolerance: null, seed: 0,
};

/* Fill in the defaults; refuse a tolerance that is none. PlanRequest */
function planRequest(options = {}) {
  const request = { ...DEFAULTS, ...options }, { tolerance } = request;
  if (tolerance !== null && !(Number.isFinite(tolerance) && tolerance > 0)) {
    throw new InputError(`tolerance ${general(tolerance)} l; give a number above 0`, "options");
  }
  return request;
}

/* The shortest dwell that the motor allows; null: the user gave none. PlanRequest.least_dwell */
function leastDwell({ minimumSeconds, minimumDwell }, robot) {
  if (minimumSeconds === null) return minimumDwell;
  if (!(Number.isFinite(minimumSeconds) && minimumSeconds > 0)) {
    throw new InputError(`minimum dwell ${general(minimumSeconds)} s; give a number above 0`, "options");
  }
  return Math.max(minimumSeconds / robot.timeScale, minimumDwell ?? QUICK);
}

export { DEFAULTS, planRequest, leastDwell };
