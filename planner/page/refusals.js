/* Refusals of a look-up table in the words of a laboratory: rpm and cm first, the group in brackets.
 *
 * Mirrors surrogate/table/refusals.py, which explains how the known values are found. */
import { geomspace } from "./arrays.js";
import { general, pythonText } from "./format.js";
import { MOST_TAILS } from "./groups.js";
import { InputError } from "./input_error.js";
import { OutsideError, query } from "./lookup.js";
import { groupValues, makeRobot } from "./robot.js";
import { fromSi } from "./si_units.js";

const FACTOR = 1000; // values up to this many times as large or as small are asked about
const STEPS = 600; // on either side
const REMEDY = "change the robot, or simulate it (softflagella steady, softflagella surrogate robot)";
const NUMBERS = {
  omega_bar: { words: "motor speed", field: "motorSpeed", unit: "rpm" },
  l_over_R: { words: "tail length", field: "tailLength", unit: "cm" },
  l_over_r0: { words: "tail radius", field: "tailRadius", unit: "mm" },
  L_over_R: { words: "head length", field: "headLength", unit: "mm" },
  a_over_R: { words: "disc offset", field: "discOffset", unit: "mm" },
  N: { words: "number of tails", field: "tails", unit: "" },
};

/* Do some work with a table; say in the units of a laboratory why it refuses the robot. refusing_robots */
function refusingRobot(robot, table, work) {
  try {
    return work();
  } catch (refusal) {
    if (!(refusal instanceof OutsideError)) throw refusal;
    throw new OutsideError(inLabUnits(refusal.reason, robot, table), refusal.reason);
  }
}

/* Name a number of the robot that is outside, and the values of it that the table knows. */
function inLabUnits(reason, robot, table) {
  const values = groupValues(robot);
  const outside = Object.keys(NUMBERS).filter((name) => {
    const [low, high] = table.ranges[name];
    return !(low * (1 - 1e-9) <= values[name] && values[name] <= high * (1 + 1e-9));
  });
  const groups = outside.length ? outside : ["omega_bar"]; // the number that is changed most easily
  let [group] = groups, known = [];
  for (const name of groups) {
    known = knownVariants(robot, name, table);
    if (!known.length) continue;
    group = name;
    break;
  }
  const value = `${NUMBERS[group].words} ${inLab(robot, group)} (${groupText(robot, group)})`;
  const why = outside.includes(group) ? value : `${reason}; ${value}`;
  const ends = known.length ? [known[0], known[known.length - 1]] : [];
  const within = ends.map((end) => `${inLab(end, group)} (${groupText(end, group)})`).join(" to ");
  return `robot ${pythonText(robot.name)} is outside the look-up table: ${why}`
    + `${within && `; for this robot it knows ${within}`}; ${REMEDY}`;
}

function groupText(robot, group) {
  return `${group} = ${general(groupValues(robot)[group], 3)}`;
}

/* Write the number that decides a group in its unit. */
function inLab(robot, group) {
  const { unit } = NUMBERS[group];
  return unit ? `${general(fromSi(sizeOf(robot, group), unit), 4)} ${unit}` : String(robot.tails);
}

/* The number that decides a group, in SI units. */
function sizeOf(robot, group) {
  return robot[NUMBERS[group].field] ?? robot.headRadius; // the default of the disc offset
}

/* Those nearest to a robot that the table knows, without a gap, of robots that differ in one number. */
function knownVariants(robot, group, table) {
  const robots = variants(robot, group), size = sizeOf(robot, group);
  const known = robots.map((variant) => !query(table, groupValues(variant), { flag: true }).outside);
  let nearest = -1, least = Infinity;
  robots.forEach((variant, i) => {
    const far = Math.abs(Math.log(sizeOf(variant, group) / size));
    if (known[i] && far < least) [nearest, least] = [i, far];
  });
  if (nearest < 0) return [];
  let first = nearest, last = nearest;
  while (first > 0 && known[first - 1]) first -= 1;
  while (last < robots.length - 1 && known[last + 1]) last += 1;
  return robots.slice(first, last + 1);
}

/* Robots that differ in the number that decides a group, rising; without those that cannot be. */
function variants(robot, group) {
  const tails = Array.from({ length: MOST_TAILS }, (_, i) => i + 1), size = sizeOf(robot, group);
  const factors = geomspace(1 / FACTOR, FACTOR, 2 * STEPS + 1);
  const values = group === "N" ? tails : factors.map((factor) => size * factor);
  return Array.from(values).flatMap((value) => {
    try {
      return [makeRobot({ ...robot, [NUMBERS[group].field]: value })];
    } catch (refusal) {
      if (!(refusal instanceof InputError)) throw refusal;
      return [];
    }
  });
}

export { refusingRobot };
