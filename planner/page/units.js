/* Lengths in the units of a laboratory, and paths whose size makes no sense for a robot.
 *
 * Mirrors planner/paths/units.py. Of a robot, tailLength [m] and timeScale [s] count. Lengths in l. */
import { column, largest, smallest } from "./arrays.js";
import { fixed, general } from "./format.js";
import { InputError } from "./input_error.js";
import { pathLength } from "./path.js";
import { formatLength, formatTime } from "./si_units.js";

const LONGEST = 12_000.0; // l
const SMALLEST = 0.25; // of the radius of the robot's circle, largest extent of a path

/* Write a length given in tail lengths: 3.52 cm (0.32 l). */
function inLab(value, robot) {
  return `${formatLength(value * robot.tailLength)} (${tails(value)} l)`;
}

/* Write a time given in units of μ0 l⁴/EI: 1.79 s (0.81 time units). */
function timeInLab(value, robot) {
  return `${formatTime(value * robot.timeScale)} (${general(value, 2)} time units)`;
}

/* Write a place given in tail lengths: (3.52, 1.1) cm = (0.32, 0.1) l. */
function placeInLab(x, y, robot) {
  const written = (scale, places) => [x, y].map((value) => withoutSign(fixed(scale * value, places))).join(", ");
  return `(${written(100 * robot.tailLength, 2)}) cm = (${written(1, 3)}) l`;
}

/* Zero without a sign. */
function withoutSign(text) {
  return /^-0\.?0*$/.test(text) ? text.slice(1) : text;
}

/* Write a length in tail lengths: 0.32, 12, 1200. */
function tails(value) {
  return Math.abs(value) < 1000 ? general(value, 3) : fixed(value, 0);
}

/* Describe length and extent of a path. */
function describe(path, robot) {
  const across = extent(path), lab = across.map((value) => formatLength(value * robot.tailLength));
  return `${inLab(pathLength(path), robot)} long, ${lab.join(" by ")} (${across.map(tails).join(" by ")} l)`;
}

/* Width and height of a path. */
function extent(path) {
  return [0, 1].map((axis) => {
    const values = column(path.points, axis);
    return largest(values) - smallest(values);
  });
}

/* Refuse a path that no schedule can be meant for. */
function checkSize(path, robot, turnRadius) {
  if (pathLength(path) > LONGEST) {
    throw new InputError(
      `the path is ${describe(path, robot)}; at most ${general(LONGEST)} l can be planned; scale it`,
    );
  }
  if (Math.max(...extent(path)) < SMALLEST * turnRadius) {
    throw new InputError(
      `the path is ${describe(path, robot)}: too small, the robot's circle has a radius of ` +
        `${inLab(turnRadius, robot)}; scale it`,
    );
  }
}

export { LONGEST, inLab, timeInLab, placeInLab, describe, extent, checkSize };
