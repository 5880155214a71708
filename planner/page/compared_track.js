/* A measured track beside the plan: its errors, in cm and s, and the motions that lay it on the plan. */
import { largest } from "./arrays.js";
import { repr } from "./format.js";
import { InputError } from "./input_error.js";
import { columnsInTails, trackingError } from "./tracking_error.js";

const COLUMNS = ["time_bar", "x_over_l", "y_over_l", "heading_rad"];
const HOW = {
  none: "",
  time: "its first time is 0",
  rigid: "its first pose is that of the plan, its first time 0",
};

/* Compare a track with a plan, as measured ("none"), from time 0 ("time"), or laid on the plan's start ("rigid").
 *
 * plan: content of plan.json. table: {names, columns} of the file, and `plans`, the ids in it. The page plans
 * anew, with other last digits, so the id of another plan is told, not refused. */
function comparedTrack(plan, table, how) {
  const measured = columnsInTails(table, plan.robot),
    moved = how === "none" ? measured : movedTrack(measured, plan, how);
  const error = trackingError(plan, { names: COLUMNS, columns: moved });
  const cm = 100 * plan.robot.tail_length_m,
    second = plan.robot.time_scale_s;
  const worst = error.distance.indexOf(largest(error.distance)),
    place = ([x, y]) => [x * cm, y * cm];
  return {
    points: error.track.map(place),
    shift: HOW[how],
    ofPlan: (table.plans ?? []).find((id) => id !== plan.id) ?? "",
    csv: trackTable(moved, cm, second),
    error: {
      rms: error.rms * cm,
      largest: error.largest * cm,
      rawRms: error.rawRms * cm,
      rawLargest: error.rawLargest * cm,
      stated: error.stated * cm,
      times: Array.from(error.time, (time) => time * second),
      distances: Array.from(error.distance, (value) => value * cm),
      worst: { time: error.time[worst] * second, place: place(error.track[worst]) },
    },
  };
}

/* Move a track in time; with "rigid" in the plane, too, so that it begins with the pose of the plan. */
function movedTrack([time, x, y, heading], plan, how) {
  if (!(how in HOW)) throw new InputError(`a track cannot be moved by ${how}`);
  const times = Array.from(time, (value) => value - time[0]);
  if (how === "time") return [times, x, y, heading];
  const { x_over_l: startX, y_over_l: startY, heading_rad: start } = plan.start;
  const turn = start - heading[0],
    cos = Math.cos(turn),
    sin = Math.sin(turn);
  const ahead = Array.from(x, (value) => value - x[0]),
    aside = Array.from(y, (value) => value - y[0]);
  return [
    times,
    ahead.map((value, i) => startX + cos * value - sin * aside[i]),
    ahead.map((value, i) => startY + sin * value + cos * aside[i]),
    Array.from(heading, (value) => value + turn),
  ];
}

/* The track in the columns that `planner check` reads. */
function trackTable([time, x, y, heading], cm, second) {
  const rows = Array.from(time, (value, i) => {
    const row = [value * second, x[i] * cm, y[i] * cm, (heading[i] * 180) / Math.PI];
    return row.map(repr).join(",");
  });
  return `time_s,x_cm,y_cm,heading_deg\n${rows.join("\n")}\n`;
}

export { comparedTrack };
