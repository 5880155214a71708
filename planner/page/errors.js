/* The errors of a plan: distances of the predicted track from declared and drawn path, and the stated error.
 *
 * Mirrors planner/planning/errors.py. Lengths in l. */
import { largest, sum } from "./arrays.js";
import { distanceTo } from "./distance.js";
import { errorGrowth } from "./error_growth.js";
import { feedbackError } from "./feedback_error.js";
import { polyline } from "./path.js";
import { rollOut } from "./rollout.js";
import { flipsBetween, largestDistance, predictedError, rmsInTime, statedError } from "./stated_error.js";
import { zigzagSpeed } from "./zigzag.js";

/* Compute the errors of a schedule: {track, stated, feedback, guaranteed, closure, predictedRms, predictedMax,
 * drawnRms, drawnMax, tableShare}. plan_errors
 *
 * tracked: see tracked_point.js. drawn: the path as drawn. declared: see declared_path.js. switches: the schedule.
 * guaranteed: bound on the error without uncertainty. seed: of the random robots.
 * straight: straight motion with the shortest dwell, see zigzag.js. */
function planErrors(tracked, drawn, declared, switches, guaranteed, seed, straight) {
  const { vehicle } = tracked, path = declared.reference.p, { dwells } = switches;
  const { track, predicted, growth } = deviations(tracked, drawn, declared, switches);
  const stated = statedError(growth, predicted, seed), fromDrawn = distanceTo(polyline(drawn), track);
  const [endX, endY] = track[track.length - 1], [startX, startY] = path[0];
  return {
    track,
    stated,
    feedback: feedbackError(predicted.distance, dwells, zigzagSpeed(straight), tracked.robot.timeScale, stated),
    guaranteed,
    closure: drawn.closed ? Math.hypot(endX - startX, endY - startY) : null,
    predictedRms: rmsInTime(predicted.distance, dwells),
    predictedMax: largestDistance(predicted),
    drawnRms: rmsInTime(fromDrawn, dwells),
    drawnMax: largest(fromDrawn),
    tableShare: tableShare(vehicle, growth),
  };
}

/* The predicted track, its distances from the declared path, and the growth of deviations along a schedule. */
function deviations({ vehicle, offset }, drawn, declared, switches) {
  const rollout = rollOut(vehicle, switches, offset), { track } = rollout;
  const growth = errorGrowth(vehicle, switches, rollout, flipsBetween(switches.dwells.length));
  return { track, predicted: predictedError(declared.reference.p, track, drawn.closed), growth };
}

/* The stated error if the coefficients are those of another robot; null: calibrated, or not known.
 * Plan.unmeasured_error */
function unmeasuredError({ tracked, drawn, declared, switches }) {
  const { vehicle, unmeasured } = tracked;
  if (!unmeasured.length) return null;
  const guessed = { ...tracked, vehicle: { ...vehicle, modes: [...vehicle.modes, ...unmeasured] } };
  const { predicted, growth } = deviations(guessed, drawn, declared, switches);
  return statedError(growth, predicted);
}

/* The share of the look-up table's modes in the squared deviations along a schedule. _table_share */
function tableShare(vehicle, growth) {
  const squares = growth.modes.map(({ x, y }) => x.reduce((total, value, i) => total + value ** 2 + y[i] ** 2, 0));
  const ofTable = squares.filter((_, p) => vehicle.modes[p]?.name.startsWith("table: "));
  return sum(ofTable) / Math.max(sum(squares), 1e-300);
}

export { planErrors, unmeasuredError };
