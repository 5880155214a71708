/* A replayed (or measured) track against its plan.
 *
 * Mirrors planner/files/tracking_error.py. The error is the distance of the tracked point from the declared path,
 * weighted by time. Lengths in l. */
import { largest, smallest, sum } from "./arrays.js";
import { distanceTo, twoSided } from "./distance.js";
import { general } from "./format.js";
import { InputError } from "./input_error.js";
import { formatLength } from "./si_units.js";
import { convertColumns } from "./quantities.js";

const LARGEST = 1e100; // of a number
const COLUMNS = ["time_bar", "x_over_l", "y_over_l", "heading_rad"];
const ALIKE = 1e-3; // of a place and of the tail length, largest difference of the same place in cm and in l
const LAB = ["time_s", "x_cm", "y_cm", "heading_deg"]; // or in other units

/* Compare a track with its plan: {rms, largest, rawRms, rawLargest, missed, stated, track, time, distance,
 * tailLength}; those called raw from the path as given.
 *
 * plan: content of plan.json. table: {names, columns} of the head's centre, as replays or labs have them; it may
 * have `plans`, the ids of the plans that it is of. */
function trackingError(plan, table) {
  const [other] = (table.plans ?? []).filter((id) => id !== plan.id).sort();
  if (other)
    throw new InputError(`the track is of plan ${other}, not of ${plan.id}; compare it with its own plan.json`);
  const [time, x, y, heading] = columnsInTails(table, plan.robot);
  if (![time, x, y, heading].every((values) => values.every((value) => Math.abs(value) < LARGEST))) {
    throw new InputError("the track has a value that is not a finite number; correct the file");
  }
  if (x.length < 2 || !(largest(time) - smallest(time) > 0)) {
    throw new InputError("the track has no two times; give a row for each time, in order");
  }
  const back = time.findIndex((value, i) => i > 0 && value < time[i - 1]);
  if (back >= 0) {
    throw new InputError(`the track's time goes back at row ${back + 1}; give a row for each time, in order`);
  }
  const offset = plan.offset_over_l ?? 0;
  const track = Array.from(x, (value, i) => [
    value + Math.cos(heading[i]) * offset, y[i] + Math.sin(heading[i]) * offset,
  ]);
  const declared = distanceTo(plan.reference, track), raw = distanceTo(plan.raw_path, track), last = x.length - 1;
  const weights = time.map((_, i) => {
    const early = time[Math.max(i - 1, 0)], late = time[Math.min(i + 1, last)];
    return Math.max((late - early) / (i > 0 && i < last ? 2 : 1), 0);
  });
  const total = Math.max(sum(weights), 1e-300);
  const rms = (away) => Math.sqrt(sum(away.map((value, i) => (weights[i] / total) * value ** 2)));
  return {
    rms: rms(declared),
    largest: largest(declared),
    rawRms: rms(raw),
    rawLargest: largest(raw),
    missed: twoSided(plan.raw_path, track)[0],
    stated: plan.stated_error_over_l,
    track,
    time,
    distance: declared,
    tailLength: plan.robot.tail_length_m,
  };
}

/* The errors in one sentence, in units of length and in l. TrackingError.line */
function trackingLine(error) {
  const written = (value) => `${formatLength(value * error.tailLength)} (${general(value, 3)} l)`;
  const verdict = error.largest <= error.stated ? "within" : "ABOVE";
  const raw = `${written(error.rawRms)} rms, ${written(error.rawLargest)} at most`;
  return (
    `tracking error ${written(error.rms)} rms, ${written(error.largest)} at most, ${verdict} the stated error ` +
    `${written(error.stated)}; from the path as drawn ${raw}, every point of it within ${written(error.missed)}`
  );
}

/* Time, x, y and heading in the units of a replay. track_in_tails */
function columnsInTails(table, robot) {
  const replayed = COLUMNS.every((name) => table.names.includes(name)), cm = 100 * robot.tail_length_m;
  const own = table.names.map((name, i) => [name, table.columns[i]]).filter(([name]) => !COLUMNS.includes(name));
  const given = replayed ? { names: own.map(([name]) => name), columns: own.map(([, values]) => values) } : table;
  const lab = convertColumns(given, LAB, "the track").table;
  if (replayed) {
    for (const axis of ["x", "y"]) {
      const inCm = lab.columns[lab.names.indexOf(`${axis}_cm`)];
      const inTails = table.columns[table.names.indexOf(`${axis}_over_l`)];
      const alike = (value, i) => Math.abs(value * cm - inCm[i]) <= ALIKE * (cm + Math.abs(inCm[i]));
      if (inCm && !inTails.every(alike)) {
        throw new InputError(
          `${axis}_over_l and ${axis}_cm of the track disagree with the plan's tail length, ${general(cm)} cm: ` +
            "it is the track of another robot",
        );
      }
    }
    return COLUMNS.map((name) => table.columns[table.names.indexOf(name)]);
  }
  const missing = LAB.find((name) => !lab.names.includes(name));
  if (missing) {
    throw new InputError(
      `the track has no column '${missing}'; it needs time_s, x_cm, y_cm and heading_deg, or in other units`,
    );
  }
  const scales = [robot.time_scale_s, cm, cm, 180 / Math.PI];
  return LAB.map((name, i) => lab.columns[lab.names.indexOf(name)].map((value) => value / scales[i]));
}

export { columnsInTails, trackingError, trackingLine };
