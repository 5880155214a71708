/* From a pose to a pose: the way that is declared, and last dwells with which the robot ends at the goal, as in
 * planner/goal. Poses are those of the head's centre, [x, y, heading]. Lengths in l, times in μ0 l⁴/EI, angles in rad. */
import { CONSTANTS } from "./constants.js";
import { chainOf } from "./dubins.js";
import { compose, dot, halfTurn, largestSize, sum } from "./math.js";
import { dampedStep } from "./nearest_path.js";
import { footprint } from "./obstacles.js";
import { ratio, referenceOfPivot } from "./reference.js";
import { lengthOf, route } from "./route.js";
import { inLab } from "./units.js";
import { motionAfter, pivotDistance, pivotRadius, rodOf, rollOut } from "./vehicle.js";
import { InputError, general, quoted } from "./words.js";

const { STEP, LAST, DROPPED, CHANGE, REACHED, MISSED, CONVERGED, MOST_STEPS, DAMPING, EXACT } = CONSTANTS.last_dwells;
const { SPACING, SHORTER } = CONSTANTS.trip, { LONGEST } = CONSTANTS.paths_units;

/* Read a pose in words, X,Y,DEGREES with the length of `cm` tails. */
function readPose(words, name, cm) {
  const [x, y, degrees, ...more] = words.split(",").map((text) => (text.trim() ? Number(text) : NaN));
  if (more.length || ![x, y, degrees].every(Number.isFinite)) {
    throw new InputError(`${name} ${quoted(words)}; write X,Y,DEGREES with numbers in cm, such as 60,20,90`, "regions");
  }
  const rest = degrees % 360;
  return [x / cm, y / cm, (Math.abs(rest) > 180 ? rest - 360 * Math.sign(rest) : rest) * (Math.PI / 180)];
}

/* Make a function of a drift and a margin that declares the way from the start to the goal: {declared, length}. */
function wayToGoal(tracked, { start, goal, space }) {
  const { robot, vehicle } = tracked, back = pivotDistance(vehicle), lattices = new Map();
  const body = footprint(robot, -back), radius = pivotRadius(vehicle);
  return (drift, margin) => {
    const key = JSON.stringify(drift), [begin, end] = [start, goal].map(([x, y, heading]) => {
      const course = heading + Math.atan(ratio(heading, drift));
      return [x - back * Math.cos(heading), y - back * Math.sin(heading), course];
    });
    if (!lattices.has(key)) lattices.set(key, new Map());
    const way = route(begin, end, { radius, body, space, drift }, margin, lattices.get(key), robot), length = lengthOf(way);
    if (length > LONGEST) {
      throw new InputError(`the way is ${inLab(length, robot)} long; at most ${general(LONGEST)} l can be planned`);
    }
    const poses = chainOf(way, SPACING);
    if (poses.length < 2) throw new InputError("start and goal are the same; nothing to do");
    const reference = referenceOfPivot(poses, rodOf(tracked), drift, start[2]);
    return { declared: { reference, curvature: 0, offDrawn: 0, missed: 0, warnings: [] }, length };
  };
}

/* Change the last dwells of a schedule so that it ends at a goal: without any or some of them, whichever costs least.
 * dwell: the plan's shortest; least: that of the motor. */
function ended(switches, goal, vehicle, dwell, least) {
  const shortest = Math.min(dwell, Math.max(least, SHORTER * dwell)), { firstDirection, dwells, poses } = switches;
  let best = null;
  for (let count = dwells.length; count >= Math.max(dwells.length - DROPPED, 1); count--) {
    const fewer = { firstDirection, dwells: dwells.subarray(0, count), poses: poses.slice(0, count + 1) };
    const candidate = endedWith(fewer, goal, vehicle, shortest);
    if (!(best?.cost <= candidate.cost)) best = candidate;
  }
  const changed = { ...switches, dwells: best.dwells };
  return { ...changed, poses: rollOut(vehicle, changed, 0, 1).poses };
}

/* Change the last dwells, none below `least`, so that a schedule ends at a goal: {dwells, cost}. */
function endedWith({ firstDirection, dwells, poses }, goal, vehicle, least) {
  const kept = Math.max(dwells.length - LAST, 0), first = dwells.slice(0, kept), [currentX, currentY] = vehicle.current;
  const [, , heading] = poses[poses.length - 1], target = [goal[0], goal[1], heading - halfTurn(heading - goal[2])];
  const planned = dwells.slice(kept).map((dwell) => Math.max(dwell, least));
  const offGoal = (last) => {
    let pose = poses[kept], sense = kept % 2 ? -firstDirection : firstDirection, before = kept ? dwells[kept - 1] : null;
    for (const time of last) {
      const [x, y, turned] = compose(pose, motionAfter(vehicle, sense, before, time));
      [pose, sense, before] = [[x + currentX * time, y + currentY * time, turned], -sense, time];
    }
    return pose.map((value, axis) => value - target[axis]);
  };
  const last = leastChange(offGoal, planned, least), missed = largestSize(offGoal(last));
  const change = sum(last.map((dwell, i) => (dwell / planned[i] - 1) ** 2));
  const cost = sum(first) + sum(last) + CHANGE * change + MISSED * Math.max(missed - REACHED, 0);
  return { dwells: Float64Array.of(...first, ...last), cost };
}

/* Find dwells, not below `least`, that end at a goal and differ least from those planned, by Levenberg's method. */
function leastChange(offGoal, planned, least) {
  const count = planned.length, residuals = (dwells) => {
    return Float64Array.of(...offGoal(dwells).map((off) => EXACT * off), ...dwells.map((dwell, i) => dwell / planned[i] - 1));
  };
  const at = (dwells) => {
    const values = residuals(dwells), slopes = Array.from(dwells, (dwell, i) => {
      const row = residuals(dwells.with(i, dwell + STEP)).map((value, k) => (value - values[k]) / STEP);
      return dwell <= least && dot(row, values) > 0 ? row.fill(0) : row;
    });
    const band = new Float64Array(count * count); // of a full matrix
    slopes.forEach((row, j) => slopes.slice(j).forEach((below, d) => (band[j * count + d] = dot(row, below))));
    const right = Float64Array.from(slopes, (row) => dot(row, values));
    return { cost: dot(values, values), band, right, width: count - 1 };
  };
  let dwells = planned, damping = DAMPING, system = at(dwells);
  for (let n = 0; n < MOST_STEPS; n++) {
    const step = dampedStep(system, damping), moved = dwells.map((dwell, i) => Math.max(dwell - step[i], least));
    const candidate = at(moved), gained = 1 - candidate.cost / system.cost;
    damping *= gained > 0 ? 0.2 : 6;
    if (!(gained > 0)) continue;
    [dwells, system] = [moved, candidate];
    if (gained < CONVERGED) break;
  }
  return dwells;
}

export { readPose, wayToGoal, ended };
