/* A vehicle without a robot: five numbers that a laboratory measures, and what of them is uncertain, as in
 * planner/vehicle/measured.py.
 *
 * Such a vehicle is {name, tailLength, timeScale, outline, measured}: its unit of length, the mean radius of its circles, stands
 * where a robot has its tail length; measured are the lines of a vehicle.toml in SI units as [key, content], where that of each
 * of the five numbers is [value, standard deviation]. Lengths in l, times in units of timeScale. */
import { CONSTANTS } from "./constants.js";
import { arc, compose, inversePose } from "./math.js";
import { splitName } from "./units.js";
import { BEFORE_KNOTS, COUNT, STEP, modeBetween, trackedPoint } from "./vehicle.js";
import { repr } from "./words.js";

const { SUBSTEPS, MODEL } = CONSTANTS.measured; // SUBSTEPS of a step between TIMES, for the integral of the motion
const STILL = [0, 0, 0];

/* Make the motion of a measured vehicle, and add the tracked point. */
function trackedMeasured(swims, point) {
  const numbers = swims.measured.filter(([, given]) => Array.isArray(given));
  const values = numbers.map(([, [value]]) => value), motionWith = (i, value) => motionOf(values.with(i, value), swims);
  const modes = numbers.flatMap(([key, [value, spread]], i) => {
    if (!(spread > 0)) return [];
    const name = splitName(key).quantity, above = value + spread;
    const below = name === "lag" ? Math.max(value - spread, 0) : value - spread;
    return [modeBetween(name, motionWith(i, above), motionWith(i, below), spread / (above - below))];
  });
  const spread = [0, 1].map(() => new Float64Array(3 * COUNT)), still = { phaseRate: [0, 0], current: [0, 0] };
  const vehicle = { ...motionOf(values, swims), spread, modes, ...still, tailGap: Infinity, leastGap: 1 };
  return trackedPoint(swims, { vehicle, unmeasured: [], calibrated: true, ownTable: true }, point, MODEL);
}

/* Twists, lags and lags from rest for five numbers. */
function motionOf([speed, left, right, slip, lag], { tailLength, timeScale }) {
  const ahead = (speed * Math.cos(slip)) / tailLength, across = (speed * Math.sin(slip)) / tailLength;
  const sides = [[ahead, across, left], [ahead, -across, -right]], constant = lag / timeScale;
  const twist = sides.map((side) => side.map((rate) => timeScale * rate));
  const lagOf = (end, other) => {
    const table = new Float64Array(BEFORE_KNOTS.length * 3 * COUNT);
    BEFORE_KNOTS.forEach((before, k) => {
      const decay = lag > 0 ? Math.exp((-before * timeScale) / lag) : 0, leftOver = decay / (1 + decay);
      const start = other.map((rate, axis) => rate + leftOver * (end[axis] - rate));
      table.set(relaxation(start, end, constant), k * 3 * COUNT);
    });
    return table;
  };
  const rest = twist.map((end) => relaxation(STILL, end, constant));
  return { twist, lag: [lagOf(twist[0], twist[1]), lagOf(twist[1], twist[0])], rest };
}

/* The lags at TIMES, flat, after a twist `start` that relaxes to `end`: the motion is the lag, and then the arc of `end`. */
function relaxation(start, end, lag) {
  const table = new Float64Array(3 * COUNT), step = STEP / SUBSTEPS, rate = start.map((value, axis) => value - end[axis]);
  if (lag <= 0) return table;
  const headingAt = (time) => end[2] * time - rate[2] * lag * Math.expm1(-time / lag);
  let x = 0, y = 0;
  for (let i = 1; i < COUNT; i++) {
    for (let k = 0; k <= SUBSTEPS; k++) { // Simpson's rule
      const time = (i - 1) * STEP + k * step, heading = headingAt(time), c = Math.cos(heading), s = Math.sin(heading);
      const decay = Math.exp(-time / lag), ahead = end[0] + rate[0] * decay, across = end[1] + rate[1] * decay;
      const share = ((k % SUBSTEPS === 0 ? 1 : k % 2 ? 4 : 2) * step) / 3;
      x += share * (c * ahead - s * across);
      y += share * (s * ahead + c * across);
    }
    table.set(compose([x, y, headingAt(i * STEP)], inversePose(arc(end, i * STEP))), 3 * i);
  }
  return table;
}

/* Write the text of a vehicle.toml that is read back to the same vehicle, to the last bit. */
function vehicleToml({ measured }) {
  const written = (given) => {
    if (Array.isArray(given)) return `[${given.map(repr).join(", ")}]`;
    return typeof given === "number" ? repr(given) : JSON.stringify(given).replaceAll("\x7f", "\\u007f");
  };
  return `${measured.map(([key, given]) => `${key} = ${written(given)}`).join("\n")}\n`;
}

export { trackedMeasured, vehicleToml };
