/* From a path, or a start and a goal, and a robot to a plan, without simulating.
 *
 * A plan is {tracked, objective, drawn, declared, straight, guidance, switches, errors, unmeasured, clear}; clear is as in
 * obstacles.js. Lengths in l, times in μ0 l⁴/EI, unless a name says its unit. */
import { CONSTANTS } from "./constants.js";
import { declare } from "./declare.js";
import { Followed, guaranteedError, lookAhead } from "./stated_error.js";
import { ended, wayToGoal } from "./goal.js";
import { follow, firstTurn } from "./guidance.js";
import { linspace, smallest, sum } from "./math.js";
import { ANYWHERE, BlockedError, clearances, footprint, keptClear } from "./obstacles.js";
import { checkSize } from "./path.js";
import { inLab, timeInLab } from "./units.js";
import { QUICK, checkLeast, dwellsFor, longerDwells, nearlyFastest, rodOf, turnRadius, zigzag } from "./vehicle.js";
import { zigzagHysteresis } from "./vehicle.js";
import { InputError, general, refusing } from "./words.js";

const { WORTH, SAVED, LENGTHENED_FROM, MORE, GROWS, MARGINS, OTHERS } = CONSTANTS.solve, { ZIGZAGS } = CONSTANTS.trip;
const OWN_TABLE = "softflagella surrogate robot"; // makes the table of one robot
const { DEFAULTS } = CONSTANTS.request;

/* Fill in the defaults of what is asked of a plan besides path and robot; refuse a tolerance that is none. */
function planRequest(options = {}) {
  const request = { ...DEFAULTS, space: ANYWHERE, ...options }, { tolerance } = request;
  if (tolerance !== null && !(Number.isFinite(tolerance) && tolerance > 0)) {
    throw new InputError(`tolerance ${general(tolerance)} l; give a number above 0`, "options");
  }
  return request;
}

/* The shortest dwell that the motor allows; null: the user gave none. */
function leastDwell({ minimumSeconds, minimumDwell }, robot) {
  if (minimumSeconds === null) return minimumDwell;
  if (!(Number.isFinite(minimumSeconds) && minimumSeconds > 0)) {
    throw new InputError(`minimum dwell ${general(minimumSeconds)} s; give a number above 0`, "options");
  }
  return Math.max(minimumSeconds / robot.timeScale, minimumDwell ?? QUICK);
}

/* Plan for a path, a vehicle with its tracked point and a request. progress: called now and then. */
function makePlan(drawn, tracked, request, progress = null) {
  const chosen = followedPath(drawn, tracked, request, progress), { declared, straight, guidance, switches } = chosen;
  const { errors, unmeasured, clear, drawn: asked, length } = chosen, { objective, goal } = request;
  return { tracked, objective, drawn: asked, declared, straight, guidance, switches, errors, unmeasured, clear, goal, length };
}

/* The schedule that a request chooses, as in stated_error.js. */
function followedPath(drawn, tracked, request, progress = null) {
  if (request.goal) return followedWay(tracked, request, progress);
  const { vehicle, robot } = tracked, declaredPaths = new Map();
  checkSize(drawn, robot, turnRadius(vehicle));
  const { dwell: given, objective, corner, timeWeight, tolerance, seed, space } = request;
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
    const switches = follow(declared.reference, vehicle, guidance, tracked.offset, progress);
    const guaranteed = guaranteedError(vehicle, rodOf(tracked), straight.swing, guidance.ahead);
    return new Followed({ tracked, drawn, declared, straight, guidance, switches, guaranteed, seed });
  };
  const clear = (followed) => Object.assign(followed, { clear: keptClear(followed, space) });
  if (given === null && objective === "time" && space === ANYWHERE) {
    const drift = driftOf(tracked, zigzag(vehicle, dwells[0], tracked.offset), dwells[0]);
    const best = quickest(tracked, declaredPath(drift), dwells[0], least);
    dwells = [best, ...dwells.filter((dwell) => dwell < best)];
  }
  let first = withDwell(dwells[0]);
  if (given === null && objective === "error") {
    first = leastStated(first, longerDwells(vehicle, first.guidance.dwell), withDwell);
  }
  clear(first);
  if (tolerance === null || first.stated <= tolerance) return first;
  return shortened(first, dwells, (dwell) => clear(withDwell(dwell)), tolerance);
}

/* The schedule from a start to a goal, with the margin that covers its stated error. */
function followedWay(tracked, request, progress) {
  const { vehicle, robot, offset } = tracked, { start, goal, dwell: given, objective, tolerance, seed, space } = request;
  const least = checkLeast(leastDwell(request, robot)), wayFor = wayToGoal(tracked, request);
  const at = (dwell) => {
    const straight = zigzag(vehicle, dwell, offset), drift = driftOf(tracked, straight, dwell);
    let margin = space === ANYWHERE ? 0 : ZIGZAGS * straight.largest, stated;
    for (let n = 0; n < MARGINS; n++) {
      const { declared, length } = wayFor(drift, margin), guidance = chooseGuidance(vehicle, declared, straight, dwell);
      const begin = { pose: start, sense: firstTurn(declared.reference.heading) };
      const swum = follow(declared.reference, vehicle, guidance, offset, progress, begin);
      const switches = ended(swum, goal, vehicle, dwell, least);
      guidance.dwell = Math.min(dwell, ...switches.dwells);
      const drawn = { points: declared.reference.p, closed: false };
      const followed = new Followed({ tracked, drawn, declared, straight, guidance, switches, guaranteed: null, seed });
      followed.length = length;
      if (space === ANYWHERE) return followed;
      ({ stated } = followed);
      const clearance = smallest(clearances(followed.rolled.motion, footprint(robot, 0), space));
      if (stated <= margin && clearance > 0) return Object.assign(followed, { clear: { space, margin, clearance } });
      margin = Math.max(MORE * stated, GROWS * margin);
    }
    throw new BlockedError(
      `there is no way that leaves the plan's stated error around the robot: it is ${inLab(stated, robot)}; plan with `
      + `feedback, make a table of this robot (${OWN_TABLE}), or move the path, the goal or the obstacles`,
    );
  };
  const dwells = given === null ? dwellsFor(vehicle, objective, least) : [checkLeast(given)];
  const others = Array.from(linspace(0, dwells.length - 1, OTHERS + 1), (place) => dwells[Math.trunc(place)]);
  const first = firstClear(at, given === null ? new Set(others) : dwells);
  return tolerance === null || first.stated <= tolerance ? first : shortened(first, dwells, at, tolerance);
}

/* Plan with the first dwell for which there is a way. */
function firstClear(at, dwells) {
  const refusals = [];
  for (const dwell of dwells) {
    const followed = unblocked(() => at(dwell), (refusal) => refusals.push(refusal) && null);
    if (followed) return followed;
  }
  throw refusals[0];
}

/* Do some work; where the way is blocked there is another answer. */
function unblocked(work, instead) {
  return refusing(work, (refusal) => {
    if (refusal instanceof BlockedError) return instead(refusal);
    throw refusal;
  });
}

/* The dwell with which a declared path takes the least time; straight motion is the fastest with `fastest`. */
function quickest({ vehicle, offset }, declared, fastest, least) {
  let best = fastest, time = Infinity;
  for (const dwell of nearlyFastest(vehicle, least)) {
    const guidance = chooseGuidance(vehicle, declared, zigzag(vehicle, dwell, offset), dwell);
    const follows = () => sum(follow(declared.reference, vehicle, guidance, offset).dwells);
    const taken = refusing(follows, () => null); // null: too long for this path
    if (taken !== null && taken > time + SAVED * fastest) break;
    if (taken !== null && taken < time) [best, time] = [dwell, taken];
  }
  return best;
}

/* Lengthen the dwells where this makes the stated error smaller by a fifth or more. */
function leastStated(first, longer, withDwell) {
  let best = first;
  if (first.stated < LENGTHENED_FROM * first.predictedMax) return best;
  for (const dwell of longer) {
    const candidate = refusing(() => withDwell(dwell), () => null); // null: too long for this path
    if (candidate === null || candidate.predictedMax >= best.stated) break;
    if (candidate.stated < WORTH * best.stated) best = candidate;
  }
  return best;
}

/* Halve between the first dwell, which is too long, and the shortest one, until the tolerance is kept. */
function shortened(first, dwells, withDwell, tolerance) {
  let best = first, kept = null, low = 0, high = dwells.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1, candidate = unblocked(() => withDwell(dwells[middle]), () => null);
    if (candidate?.stated < best.stated) best = candidate;
    if (candidate?.stated <= tolerance) [kept, high] = [candidate, middle];
    else low = middle;
  }
  if (kept !== null) return kept;
  const { robot } = first.tracked;
  throw new InputError(
    `tolerance ${inLab(tolerance, robot)} cannot be kept: the smallest stated error is `
    + `${inLab(best.stated, robot)}, with dwells from ${timeInLab(best.guidance.dwell, robot)}; `
    + `allow more, or make a table of this robot with ${OWN_TABLE}`,
    "options",
  );
}

/* What carries the robot off its heading, with one shortest dwell, as shares of its net speed. */
function driftOf({ vehicle, robot }, straight, dwell) {
  if (straight.speed <= 0) {
    const turn = dwell * Math.max(...vehicle.twist.map((twist) => Math.abs(twist[2])));
    const remedy = turn > 1 ? "shorter ones: it turns too far" : "longer ones: it is still accelerating";
    throw new InputError(
      `with dwells of ${timeInLab(dwell, robot)} the robot does not get ahead; allow ${remedy} in each dwell`,
      "options",
    );
  }
  const sideways = straight.drift / straight.speed; // of a mirror-symmetric robot it is rounding
  const current = vehicle.current.map((speed) => speed / straight.speed);
  return { sideways: Math.abs(sideways) < 1e-9 ? 0 : sideways, current };
}

/* Choose look-ahead and hysteresis for a declared path and a shortest dwell. */
function chooseGuidance(vehicle, declared, straight, dwell) {
  const ahead = lookAhead(vehicle, declared.curvature, straight);
  return { dwell, ahead, swing: zigzagHysteresis(straight, ahead) };
}

export { planRequest, makePlan, followedPath };
