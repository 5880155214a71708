/* From a path and a robot to a plan, without simulating.
 *
 * Mirrors planner/planning/plan.py, which has the steps. A plan is {tracked, objective, drawn, declared, straight,
 * guidance, switches, errors}. Lengths in l, times in μ0 l⁴/EI, unless a name says its unit. */
import { sum } from "./arrays.js";
import { declare } from "./declared_path.js";
import { checkLeast, dwellsFor, longerDwells, nearlyFastest } from "./dwell_choice.js";
import { planErrors, unmeasuredError } from "./errors.js";
import { InputError } from "./input_error.js";
import { leastDwell, planRequest } from "./request.js";
import { follow } from "./schedule.js";
import { guaranteedError, lookAhead } from "./stated_error.js";
import { rodOf, trackedVehicle } from "./tracked_point.js";
import { checkSize, inLab, timeInLab } from "./units.js";
import { turnRadius } from "./vehicle.js";
import { zigzag, zigzagHysteresis } from "./zigzag.js";

const WORTH = 0.8; // of the stated error: a longer dwell, which swings further, must leave at most this
const SAVED = 3; // dwells that corners and the end of a path may save
const LENGTHENED_FROM = 1.2; // stated error over predicted error, below which fewer flips gain nothing
const OWN_TABLE = "softflagella surrogate robot"; // makes the table of one robot

/* Plan the motor's switching times for a path {points, closed} and a robot that a table knows. plan
 *
 * options: see request.js. progress: called now and then with the share of the path that is done. */
function planPath(path, robot, table, options = {}, progress = null) {
  const request = planRequest(options);
  const plan = makePlan(path, trackedVehicle(robot, table, request.point), request, progress);
  return { ...plan, unmeasured: unmeasuredError(plan) };
}

/* Plan for a path, a vehicle (see tracked_point.js) and a request (see request.js). make_plan */
function makePlan(drawn, tracked, request, progress = null) {
  const { vehicle, robot } = tracked, declaredPaths = new Map();
  checkSize(drawn, robot, turnRadius(vehicle));
  const { dwell: given, objective, corner, timeWeight, tolerance, seed } = request;
  const least = leastDwell(request, robot);
  let dwells = given === null ? dwellsFor(vehicle, objective, least) : [checkLeast(given)];
  const declaredPath = (drift) => {
    const key = JSON.stringify(drift);
    if (!declaredPaths.has(key)) {
      const feasibility = { robot, vehicle, rod: rodOf(tracked), drift, corner, timeWeight };
      declaredPaths.set(key, declare(drawn, feasibility, progress));
    }
    return declaredPaths.get(key);
  };
  const withDwell = (dwell) => {
    const straight = zigzag(vehicle, dwell, tracked.offset);
    const declared = declaredPath(driftOf(tracked, straight, dwell));
    const guidance = chooseGuidance(vehicle, declared, straight, dwell);
    const switches = follow(declared.reference, vehicle, guidance, tracked.offset, { progress });
    const bound = guaranteedError(vehicle, rodOf(tracked), straight.swing, guidance.ahead);
    const errors = planErrors(tracked, drawn, declared, switches, bound, seed, straight);
    return { tracked, objective, drawn, declared, straight, guidance, switches, errors };
  };
  if (given === null && objective === "time") {
    const drift = driftOf(tracked, zigzag(vehicle, dwells[0], tracked.offset), dwells[0]);
    const best = quickest(tracked, declaredPath(drift), dwells[0], least);
    dwells = [best, ...dwells.filter((dwell) => dwell < best)];
  }
  let first = withDwell(dwells[0]);
  if (given === null && objective === "error") {
    first = leastStated(first, longerDwells(vehicle, first.guidance.dwell), withDwell);
  }
  if (tolerance === null || first.errors.stated <= tolerance) return first;
  return shortened(first, dwells, withDwell, tolerance);
}

/* The dwell with which a declared path takes the least time; straight motion is the fastest with `fastest`.
 * _quickest */
function quickest({ vehicle, offset }, declared, fastest, least) {
  let best = fastest, time = Infinity;
  for (const dwell of nearlyFastest(vehicle, least)) {
    const guidance = chooseGuidance(vehicle, declared, zigzag(vehicle, dwell, offset), dwell);
    try {
      const taken = sum(follow(declared.reference, vehicle, guidance, offset).dwells);
      if (taken < time) [best, time] = [dwell, taken];
      if (taken > time + SAVED * fastest) break;
    } catch (refusal) { // too long for this path
      if (!(refusal instanceof InputError)) throw refusal;
    }
  }
  return best;
}

/* Lengthen the dwells where this makes the stated error smaller by a fifth or more. _least_stated */
function leastStated(first, longer, withDwell) {
  let best = first;
  if (first.errors.stated < LENGTHENED_FROM * first.errors.predictedMax) return best;
  for (const dwell of longer) {
    let candidate;
    try {
      candidate = withDwell(dwell);
    } catch (refusal) { // too long for this path
      if (!(refusal instanceof InputError)) throw refusal;
      break;
    }
    if (candidate.errors.predictedMax >= best.errors.stated) break;
    if (candidate.errors.stated < WORTH * best.errors.stated) best = candidate;
  }
  return best;
}

/* Halve between the first dwell, which is too long, and the shortest one, until the tolerance is kept.
 * _shortened */
function shortened(first, dwells, withDwell, tolerance) {
  let best = first, kept = null, low = 0, high = dwells.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1, candidate = withDwell(dwells[middle]);
    if (candidate.errors.stated < best.errors.stated) best = candidate;
    if (candidate.errors.stated <= tolerance) {
      kept = candidate;
      high = middle;
    } else low = middle;
  }
  if (kept !== null) return kept;
  const { robot } = first.tracked;
  throw new InputError(
    `tolerance ${inLab(tolerance, robot)} cannot be kept: the smallest stated error is `
    + `${inLab(best.errors.stated, robot)}, with dwells from ${timeInLab(best.guidance.dwell, robot)}; `
    + `allow more, or make a table of this robot with ${OWN_TABLE}`,
    "options",
  );
}

/* What carries the robot off its heading, with one shortest dwell, as shares of its net speed. zigzag_drift */
function driftOf({ vehicle, robot }, straight, dwell) {
  if (straight.speed <= 0) {
    const turn = dwell * Math.max(...vehicle.twist.map((twist) => Math.abs(twist[2])));
    const remedy = turn > 1 ? "shorter ones: it turns too far" : "longer ones: it is still accelerating";
    throw new InputError(
      `with dwells of ${timeInLab(dwell, robot)} the robot does not get ahead; allow ${remedy} in each dwell`,
      "options",
    );
  }
  const sideways = straight.drift / straight.speed;
  // A mirror-symmetric robot has no drift: what is left is rounding.
  return {
    sideways: Math.abs(sideways) < 1e-9 ? 0 : sideways,
    current: vehicle.current.map((speed) => speed / straight.speed),
  };
}

/* Choose look-ahead and hysteresis for a declared path and a shortest dwell. choose_guidance */
function chooseGuidance(vehicle, declared, straight, dwell) {
  const ahead = lookAhead(vehicle, declared.curvature, straight);
  return { dwell, ahead, swing: zigzagHysteresis(straight, ahead) };
}

export { planPath, makePlan, driftOf, chooseGuidance };
