/* How the errors of a vehicle grow along a schedule: deviations from the predicted poses, to first order.
 *
 * Mirrors planner/planning/error_growth.py. Lengths in l, times in μ0 l⁴/EI, angles in rad. */
import { arc, compose, inversePose } from "./planar.js";
import { lagAt, lagNoise, lagPlace } from "./vehicle.js";

const STILL = [0, 0, 0];
const UNCHANGED = { twist: [STILL, STILL], current: [0, 0] };

/* Propagate the modes of a vehicle, and those of its disc's phase, to some flips of a schedule, given by rising
 * numbers from 0 to that of all dwells. error_growth
 *
 * Returns {flips, modes}: of each mode {x, y, turned}, columns over the flips. */
function errorGrowth(vehicle, switches, rollout, flips) {
  const { dwells, firstDirection } = switches, from = firstDirection < 0 ? 1 : 0;
  const sides = Array.from(dwells, (_, i) => (i + from) % 2);
  const circles = Array.from(dwells, (dwell, i) => arc(vehicle.twist[sides[i]], dwell));
  const places = Array.from(dwells, (dwell, i) => lagPlace(i ? dwells[i - 1] : dwell, dwell));
  const schedule = {
    dwells, sides, circles, poses: rollout.poses, changes: rollout.changes,
    lags: rollout.changes.map((change, i) => compose(change, inversePose(circles[i]))),
  };
  return {
    flips,
    modes: [
      ...vehicle.modes.map((mode) => modeGrowth(vehicle, mode, schedule, flips, modeLags(mode, sides, places))),
      ...phaseLags(vehicle, sides, dwells).map((added) => modeGrowth(vehicle, UNCHANGED, schedule, flips, added)),
    ],
  };
}

/* What the four modes of the disc's phase add to the lags of the dwells. _phase_lags */
function phaseLags(vehicle, sides, dwells) {
  const spread = [1, -1].map((sense) => lagNoise(vehicle, sense, dwells));
  let turned = 0;
  const phase = Array.from(dwells, (dwell, i) => {
    const before = turned;
    turned += vehicle.phaseRate[sides[i]] * dwell;
    return before;
  });
  return [0, 1].flatMap((side) => [Math.cos, Math.sin].map((wave) => sides.map((of, i) => {
    return of === side ? spread[side].map((values) => values[i] * wave(phase[i])) : STILL;
  })));
}

function modeLags(mode, sides, places) {
  return sides.map((side, i) => (mode.lag ? lagAt(mode.lag[side], places[i]) : STILL));
}

function modeGrowth(vehicle, mode, schedule, flips, addedLags) {
  const { dwells, sides, circles, poses, changes, lags } = schedule;
  const twist = vehicle.twist.map((row, side) => row.map((value, k) => value + mode.twist[side][k]));
  const turns = mode.twist.flat().some((value) => value !== 0), [currentX, currentY] = mode.current;
  const growth = { x: [0], y: [0], turned: [0] };
  let x = 0, y = 0, turned = 0;
  for (let i = 0, next = 1; i < dwells.length; i++) {
    const side = sides[i], circle = turns ? arc(twist[side], dwells[i]) : circles[i];
    const added = addedLags[i];
    const moved = compose([lags[i][0] + added[0], lags[i][1] + added[1], lags[i][2] + added[2]], circle);
    const ahead = moved[0] - changes[i][0], left = moved[1] - changes[i][1];
    const c = Math.cos(poses[i][2]), s = Math.sin(poses[i][2]);
    x += c * ahead - s * left + currentX * dwells[i] - turned * (poses[i + 1][1] - poses[i][1]);
    y += s * ahead + c * left + currentY * dwells[i] + turned * (poses[i + 1][0] - poses[i][0]);
    turned += moved[2] - changes[i][2];
    if (flips[next] !== i + 1) continue;
    growth.x.push(x);
    growth.y.push(y);
    growth.turned.push(turned);
    next += 1;
  }
  return growth;
}

export { errorGrowth };
