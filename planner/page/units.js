/* Lengths in the units of a laboratory, and paths whose size makes no sense for a robot.
 *
 * Mirrors planner/paths/units.py. Of a robot, tailLength [m] and timeScale [s] count. Lengths in l. */
import { column, largest, smallest } from "./arrays.js";
import { fixed, general } from "./format.js";
import { InputError } from "./input_error.js";
import { pathLength } from "./path.js";
import { formatLength, formatTime, toSi } from "./si_units.js";

const ANY_UNIT = ["l", "m", "cm", "mm"];
const LONGEST = 12_000.0; // l
const SMALLEST = 0.25; // of the radius of the robot's circle, largest extent of a path
const MOST_CIRCLES = 30.0; // of the robot, across a path whose unit is not stated
const MOST_SECONDS = 4 * 3600.0; // that such a path may take
const LITTLE = 2.0; // turn radii across: a path whose unit may be wrong
const SENSIBLE = [3.0, 300.0]; // length in l

/* A path is too tight for a robot. */
class TooTightError extends InputError {}

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

/* Convert a unit of length to tail lengths; l is the tail length itself. */
function inTails(unit, robot) {
  return unit === "l" ? 1 : toSi(1, unit) / robot.tailLength;
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
      `the path is ${describe(path, robot)}; at most ${general(LONGEST)} l can be planned` +
        remedy(path, robot, ANY_UNIT),
    );
  }
  if (Math.max(...extent(path)) < SMALLEST * turnRadius) {
    throw new InputError(
      `the path is ${describe(path, robot)}: too small, the robot's circle has a radius of ` +
        `${inLab(turnRadius, robot)}${remedy(path, robot, ANY_UNIT)}`,
    );
  }
}

/* Ask for the unit of a path that is very large if its numbers are tail lengths, which nobody said.
 *
 * speed: net, along a path, in l per unit of time. */
function checkUnstatedUnit(path, robot, turnRadius, speed) {
  const circles = Math.max(...extent(path)) / (2 * turnRadius);
  const seconds = (pathLength(path) / Math.max(speed, 1e-9)) * robot.timeScale;
  if (circles > MOST_CIRCLES || seconds > MOST_SECONDS) {
    throw new InputError(
      `the path is ${describe(path, robot)} if its numbers are tail lengths: ${fixed(circles, 0)} of the ` +
        `robot's circles across, about ${formatTime(seconds)}; say its unit, --unit l if this is meant` +
        remedy(path, robot, ["l"]),
    );
  }
}

/* Do some work, and add advice on the path's unit where it is too tight, and not much larger than the robot's
 * circle. givenIn: units in which the user may have given the numbers; none: the path has a size of its own. */
function hintingAtUnits(path, robot, turnRadius, givenIn, work) {
  try {
    return work();
  } catch (refusal) {
    if (!(refusal instanceof TooTightError)) throw refusal;
    const hint = Math.max(...extent(path)) < LITTLE * turnRadius ? unitHint(path, robot, givenIn) : "";
    throw new TooTightError(hint ? `${refusal.message}; or, ${hint}` : refusal.message);
  }
}

/* Suggest at most two units with which the numbers of a path would make sense; empty if there is none. */
function unitHint(path, robot, givenIn) {
  const hints = [], whole = pathLength(path);
  for (const given of givenIn) {
    for (const meant of ANY_UNIT) {
      const length = (whole / inTails(given, robot)) * inTails(meant, robot);
      if (given !== meant && SENSIBLE[0] <= length && length <= SENSIBLE[1]) {
        hints.push(`if you gave ${given} and mean ${meant}, it is ${general(length, 3)} l: --unit ${meant}`);
      }
    }
  }
  return hints.slice(0, 2).join("; or ");
}

/* Suggest units that would make sense, or another scale. */
function remedy(path, robot, givenIn) {
  return `; ${unitHint(path, robot, givenIn) || "scale it"}`;
}

export { ANY_UNIT, LONGEST, TooTightError, inLab, timeInLab, placeInLab, describe, inTails, extent, checkSize };
export { checkUnstatedUnit, hintingAtUnits, unitHint };
