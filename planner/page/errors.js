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
  const { vehicle, offset } = tracked, path = declared.reference.p, { dwells } = switches, count = dwells.length;
  const rollout = rollOut(vehicle, switches, offset), { track } = rollout;
  const predicted = predictedError(path, track, drawn.closed), fromDrawn = distanceTo(polyline(drawn), track);
  const growth = errorGrowth(vehicle, switches, rollout, flipsBetween(count));
  const stated = statedError(growth, predicted, seed), { timeScale } = tracked.robot;
  const [endX, endY] = track[track.length - 1], [startX, startY] = path[0];
  return {
    track,
    stated,
    feedback: feedbackError(predicted.distance, dwells, zigzagSpeed(straight), timeScale, stated),
    guaranteed,
    closure: drawn.closed ? Math.hypot(endX - startX, endY - startY) : null,
    predictedRms: rmsInTime(predicted.distance, dwells),
    predictedMax: largestDistance(predicted),
    drawnRms: rmsInTime(fromDrawn, dwells),
    drawnMax: largest(fromDrawn),
    tableShare: tableShare(vehicle, growth),
  };
}

/* The share of the look-up table's modes in the squared deviations along a schedule. _table_share */
function tableShare(vehicle, growth) {
  const squares = growth.modes.map(({ x, y }) => x.reduce((total, value, i) => total + value ** 2 + y[i] ** 2, 0));
  const ofTable = squares.filter((_, p) => vehicle.modes[p]?.name.startsWith("table: "));
  return sum(ofTable) / Math.max(sum(squares), 1e-300);
}

export { planErrors };
