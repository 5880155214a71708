/* A measured track beside the plan: its errors, in cm and s, and the motions that lay it on the plan.
 *
 * The error is the distance of the tracked point from the declared path, weighted by time. */
import { largest, smallest, sum } from "./math.js";
import { distanceTo } from "./reference.js";
import { convertColumns } from "./units.js";
import { InputError, general, repr } from "./words.js";

const LARGEST = 1e100; // of a number
const COLUMNS = ["time_bar", "x_over_l", "y_over_l", "heading_rad"];
const LAB = ["time_s", "x_cm", "y_cm", "heading_deg"]; // or in other units
const ALIKE = 1e-3; // of a place and of the tail length, largest difference of the same place in cm and in l
const HOW = {
  none: "", time: "its first time is 0", rigid: "its first pose is that of the plan, its first time 0",
};

/* Compare a track with a plan, as measured ("none"), from time 0 ("time"), or laid on the plan's start ("rigid").
 *
 * plan: content of plan.json. table: {names, columns} of the head's centre, as replays or labs have them, and
 * `plans`, the ids in it. The page plans anew, with other last digits, so the id of another plan is told, not
 * refused. */
function comparedTrack(plan, table, how) {
  const moved = movedTrack(columnsInTails(table, plan.robot), plan, how), [time, x, y, heading] = moved;
  checkTrack(moved);
  const { tail_length_m: tail, time_scale_s: second } = plan.robot, cm = 100 * tail, offset = plan.offset_over_l ?? 0;
  const track = Array.from(x, (value, i) => [
    value + Math.cos(heading[i]) * offset, y[i] + Math.sin(heading[i]) * offset,
  ]);
  const declared = distanceTo(plan.reference, track), raw = distanceTo(plan.raw_path, track), last = x.length - 1;
  const weights = time.map((_, i) => {
    const early = time[Math.max(i - 1, 0)], late = time[Math.min(i + 1, last)];
    return Math.max((late - early) / (i > 0 && i < last ? 2 : 1), 0);
  });
  const total = Math.max(sum(weights), 1e-300);
  const rms = (away) => cm * Math.sqrt(sum(away.map((value, i) => (weights[i] / total) * value ** 2)));
  const worst = declared.indexOf(largest(declared)), place = ([atX, atY]) => [atX * cm, atY * cm];
  return {
    points: track.map(place),
    shift: HOW[how],
    ofPlan: (table.plans ?? []).find((id) => id !== plan.id) ?? "",
    csv: trackTable(moved, cm, second),
    error: {
      rms: rms(declared), largest: cm * largest(declared), rawRms: rms(raw), rawLargest: cm * largest(raw),
      stated: cm * plan.stated_error_over_l,
      times: Array.from(time, (value) => value * second),
      distances: Array.from(declared, (value) => value * cm),
      worst: { time: time[worst] * second, place: place(track[worst]) },
    },
  };
}

function checkTrack([time, ...others]) {
  if (![time, ...others].every((values) => values.every((value) => Math.abs(value) < LARGEST))) {
    throw new InputError("the track has a value that is not a finite number; correct the file");
  }
  if (time.length < 2 || !(largest(time) - smallest(time) > 0)) {
    throw new InputError("the track has no two times; give a row for each time, in order");
  }
  const back = time.findIndex((value, i) => i > 0 && value < time[i - 1]);
  if (back < 0) return;
  throw new InputError(`the track's time goes back at row ${back + 1}; give a row for each time, in order`);
}

/* Time, x, y and heading in the units of a replay. */
function columnsInTails(table, robot) {
  const replayed = COLUMNS.every((name) => table.names.includes(name)), cm = 100 * robot.tail_length_m;
  const kept = (values) => values.filter((_, i) => !replayed || !COLUMNS.includes(table.names[i]));
  const lab = convertColumns({ names: kept(table.names), columns: kept(table.columns) }, LAB, "the track").table;
  const inLab = (name) => lab.columns[lab.names.indexOf(name)];
  if (replayed) {
    const [time, ...pose] = COLUMNS.map((name) => table.columns[table.names.indexOf(name)]);
    for (const [i, axis] of ["x", "y"].entries()) {
      const inCm = inLab(`${axis}_cm`);
      if (inCm && !pose[i].every((value, k) => Math.abs(value * cm - inCm[k]) <= ALIKE * (cm + Math.abs(inCm[k])))) {
        throw new InputError(
          `${axis}_over_l and ${axis}_cm of the track disagree with the plan's tail length, ${general(cm)} cm: it is the `
          + "track of another robot",
        );
      }
    }
    return [time, ...pose];
  }
  const missing = LAB.find((name) => !lab.names.includes(name));
  if (missing) {
    throw new InputError(
      `the track has no column '${missing}'; it needs time_s, x_cm, y_cm and heading_deg, or in other units`,
    );
  }
  const scales = [robot.time_scale_s, cm, cm, 180 / Math.PI];
  return LAB.map((name, i) => inLab(name).map((value) => value / scales[i]));
}

/* Move a track in time; with "rigid" in the plane, too, so that it begins with the pose of the plan. */
function movedTrack([time, x, y, heading], plan, how) {
  if (!(how in HOW)) throw new InputError(`a track cannot be moved by ${how}`);
  if (how === "none") return [time, x, y, heading];
  const times = time.map((value) => value - time[0]);
  if (how === "time") return [times, x, y, heading];
  const { x_over_l: startX, y_over_l: startY, heading_rad: start } = plan.start, turn = start - heading[0];
  const cos = Math.cos(turn), sin = Math.sin(turn);
  return [
    times,
    x.map((value, i) => startX + cos * (value - x[0]) - sin * (y[i] - y[0])),
    x.map((value, i) => startY + sin * (value - x[0]) + cos * (y[i] - y[0])),
    heading.map((value) => value + turn),
  ];
}

/* The track in the columns that `planner check` reads. */
function trackTable([time, x, y, heading], cm, second) {
  const rows = Array.from(time, (value, i) => {
    return [value * second, x[i] * cm, y[i] * cm, (heading[i] * 180) / Math.PI].map(repr).join(",");
  });
  return `time_s,x_cm,y_cm,heading_deg\n${rows.join("\n")}\n`;
}

export { comparedTrack };
