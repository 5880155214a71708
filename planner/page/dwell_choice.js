/* Choose the minimum dwell for the user's objective: time, error or number of flips.
 *
 * Mirrors planner/vehicle/dwell_choice.py. Times in μ0 l⁴/EI. */
import { geomspace, largest } from "./arrays.js";
import { general, pythonText } from "./format.js";
import { InputError } from "./input_error.js";
import { compose } from "./planar.js";
import { SHORTEST, motionAfter } from "./vehicle.js";

const OBJECTIVES = ["error", "time", "flips"];
const QUICK = 0.3; // below this, the last two dwells matter, not only the last one
const LONGEST = 4;
const KEPT = { error: 0.9, time: 1, flips: 0.95 }; // share of the best net speed that is kept
const NEARLY = 0.97; // share of the best net speed with which a path may be followed in less time
const COMPARED = 10; // such dwells
const WIDEST = 0.6; // rad that the heading swings to a side
const GRID = 100; // dwells that are compared
const LONGER = 1.3; // from one longer dwell to the next

/* Dwells in order of preference: the best one, then shorter ones; `least`: null, or the shortest one allowed. */
function dwellsFor(vehicle, objective, least) {
  if (!OBJECTIVES.includes(objective)) {
    throw new InputError(`objective ${pythonText(objective)}; allowed are ${OBJECTIVES.join(", ")}`, "options");
  }
  const shortest = checkLeast(least), most = longestDwell(vehicle, shortest);
  if (most === shortest) return [shortest];
  const grid = geomspace(shortest, most, GRID), speeds = netSpeeds(vehicle, grid);
  const enough = KEPT[objective] * largest(speeds), good = [];
  speeds.forEach((speed, i) => {
    if (speed >= enough) good.push(i);
  });
  const first = objective === "flips" ? good[good.length - 1] : good[0];
  if (first === 0) return [shortest];
  const count = Math.max(2, Math.ceil(8 * Math.log2(grid[first] / shortest)) + 1);
  return Array.from(geomspace(shortest, grid[first], count)).reverse();
}

/* Dwells with which straight motion is nearly as fast as with the fastest, longest first.
 * nearly_fastest */
function nearlyFastest(vehicle, least) {
  const shortest = checkLeast(least), grid = geomspace(shortest, longestDwell(vehicle, shortest), GRID);
  const speeds = netSpeeds(vehicle, grid), enough = NEARLY * largest(speeds);
  const good = grid.filter((_, i) => speeds[i] >= enough);
  return Array.from(geomspace(good[good.length - 1], good[0], COMPARED));
}

/* Longer dwells, up to the longest that is considered. longer_dwells */
function longerDwells(vehicle, dwell) {
  const count = Math.floor(Math.log(longestDwell(vehicle, dwell) / dwell) / Math.log(LONGER));
  return Array.from({ length: count }, (_, k) => dwell * LONGER ** (k + 1));
}

/* The longest dwell that is considered; not below `least`. */
function longestDwell(vehicle, least) {
  const quickest = Math.max(...vehicle.twist.map((twist) => Math.abs(twist[2])));
  return Math.max(least, Math.min(LONGEST, (2 * WIDEST) / quickest));
}

/* Net speeds of straight motion with some shortest dwells, as in zigzag.js; no current. net_speeds */
function netSpeeds(vehicle, dwells) {
  const rates = vehicle.twist.map((twist) => Math.abs(twist[2])), quickest = Math.max(...rates);
  return dwells.map((dwell) => {
    const positive = (dwell * quickest) / rates[0], negative = (dwell * quickest) / rates[1];
    const first = motionAfter(vehicle, 1, negative, positive);
    const move = compose(first, motionAfter(vehicle, -1, positive, negative));
    return Math.sqrt(move[0] ** 2 + move[1] ** 2) / (positive + negative);
  });
}

/* The shortest dwell that is allowed; refuse one that the curves of the response do not cover. check_least */
function checkLeast(least) {
  if (least === null) return QUICK;
  if (Number.isFinite(least) && least >= SHORTEST) return least;
  throw new InputError(
    `minimum dwell ${general(least)} is below ${general(SHORTEST)} time units; for shorter dwells the response of `
    + `the tails is not known: give at least ${general(SHORTEST)}`,
    "options",
  );
}

export { QUICK, dwellsFor, nearlyFastest, longerDwells, longestDwell, netSpeeds, checkLeast };
