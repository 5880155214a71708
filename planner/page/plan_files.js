/* The files of a plan: plan.json, plan.csv, and schedule.h for a microcontroller; and what it warns of.
 *
 * A plan is as in plan.js, with `unmeasured`. Lengths in l, times in μ0 l⁴/EI, unless a name says its unit. */
import { CONSTANTS } from "./constants.js";
import { differences, linspace, runningSum, sum } from "./math.js";
import { keptClearRecord } from "./obstacles.js";
import { extent, polyline } from "./path.js";
import { groupValues } from "./robot.js";
import { planId } from "./seals.js";
import { inLab, timeInLab } from "./units.js";
import { turnRadius, yawRate } from "./vehicle.js";
import { InputError, general, repr } from "./words.js";

const { WIDE, OWN_TABLE_FROM } = CONSTANTS.plan, { CAMERA } = CONSTANTS.stated_error;
const { MOST_MS, CHECKPOINTS } = CONSTANTS.headers;
const FORMAT = 2;
const DEGREES = 180 / Math.PI;
const A_LINE = 12; // numbers of a table

/* What the user should know, in words. */
function planWarnings({ tracked, declared, errors, switches, guidance }) {
  const { vehicle, robot } = tracked, own = [];
  if (errors.predictedMax > WIDE * turnRadius(vehicle)) {
    const turn = (guidance.dwell * yawRate(vehicle) * DEGREES).toFixed(0);
    own.push(
      `the predicted track is up to ${inLab(errors.predictedMax, robot)} from the declared path: in dwells of `
      + `${timeInLab(guidance.dwell, robot)} the robot turns by ${turn} degrees; shorter ones keep it nearer`,
    );
  }
  if (!tracked.ownTable && errors.stated >= OWN_TABLE_FROM * errors.predictedMax && errors.tableShare > 0.5) {
    own.push(
      `the stated error is mostly that of the look-up table, over ${switches.dwells.length} flips: simulate this robot's `
      + "own table (--own-table, own_table=True), or measure poses on the way",
    );
  }
  return [...declared.warnings, ...own, ...tracked.warnings];
}

/* Dwell times [s]. */
function planSeconds({ switches, tracked }) {
  return Float64Array.from(switches.dwells, (dwell) => dwell * tracked.robot.timeScale);
}

/* Time of the whole schedule. */
function planDuration({ switches }) {
  return sum(switches.dwells);
}

/* The content of plan.json as text: {id, text}; id is a digest of all the rest. codeVersion: added where it is
 * given. */
function planRecord(plan, codeVersion = null) {
  const content = planContent(plan), id = planId(pythonJson(content));
  return { id, text: pythonJson({ id, ...content, ...(codeVersion === null ? {} : { code_version: codeVersion }) }) };
}

function planContent(plan) {
  const { tracked, declared, errors, switches, drawn, straight, guidance } = plan, { robot } = tracked;
  const [x, y, heading] = switches.poses[0], tailLength = robot.tailLength;
  const swims = robot.measured
    ? { vehicle: Object.fromEntries(robot.measured), tail_length_m: tailLength }
    : { groups: groupValues(robot), tail_length_m: tailLength, motor_speed_rad_s: robot.motorSpeed };
  return {
    format: new Whole(FORMAT),
    robot: { name: robot.name, ...swims, time_scale_s: robot.timeScale },
    point: tracked.point,
    offset_over_l: tracked.offset,
    first_direction: new Whole(switches.firstDirection),
    start: { x_over_l: x, y_over_l: y, heading_rad: heading },
    dwell_bar: switches.dwells,
    dwell_s: planSeconds(plan),
    predicted_poses: switches.poses,
    reference: declared.reference.p,
    raw_path: polyline(drawn),
    closed: drawn.closed,
    objective: plan.objective,
    minimum_dwell_bar: guidance.dwell,
    off_drawn_over_l: declared.offDrawn,
    missed_over_l: declared.missed,
    zigzag_rms_over_l: straight.rms,
    guaranteed_error_over_l: errors.guaranteed,
    stated_error_over_l: errors.stated,
    stated_error_unmeasured_over_l: plan.unmeasured,
    table_share: errors.tableShare,
    feedback_error_over_l: errors.feedback,
    camera: CAMERA,
    predicted_rms_over_l: errors.predictedRms,
    predicted_max_over_l: errors.predictedMax,
    drawn_rms_over_l: errors.drawnRms,
    drawn_max_over_l: errors.drawnMax,
    closure_over_l: errors.closure,
    guidance: {
      heading_rad: declared.reference.heading,
      look_ahead_over_l: guidance.ahead,
      swing_rad: guidance.swing,
      straight: {
        dwells_bar: straight.dwells, speed_bar: straight.speed, swing_rad: straight.swing, sway_over_l: straight.sway,
        drift_bar: straight.drift, rms_over_l: straight.rms, largest_over_l: straight.largest,
      },
    },
    model: tracked.model,
    own_table: tracked.ownTable,
    warnings: planWarnings(plan),
    ...(plan.clear ? { kept_clear: keptClearRecord(plan.clear) } : {}),
  };
}

/* A whole number, which Python writes without a point. */
class Whole extends Number {}

/* Write JSON as Python does; numbers are floats, but for `Whole`, and other signs than those of ASCII \uXXXX. */
function pythonJson(value) {
  const hidden = (unit) => `\\u${unit.charCodeAt(0).toString(16).padStart(4, "0")}`;
  if (typeof value === "number") return repr(value).replace("inf", "Infinity").replace("nan", "NaN");
  if (typeof value === "string") return JSON.stringify(value).replace(/[\x80-\uffff]/g, hidden);
  if (value instanceof Whole || value === null || typeof value === "boolean") return String(value);
  if (Array.isArray(value) || ArrayBuffer.isView(value)) return `[${Array.from(value, pythonJson).join(", ")}]`;
  return `{${Object.entries(value).map(([name, entry]) => `${pythonJson(name)}: ${pythonJson(entry)}`).join(", ")}}`;
}

/* The files by name. parts: {codeVersion, schedule}, the version of the program and the template of schedule.h,
 * with @NAME@ in place of what a plan decides. */
function planFiles(plan, parts) {
  const { id, text } = planRecord(plan, parts.codeVersion);
  return {
    "plan.json": `${text}\n`,
    "plan.csv": planTable(plan, id),
    "schedule.h": controllerHeader(plan, id, parts.schedule),
  };
}

/* plan.csv: eight digits, and the identity of the plan in each row; columns in lab units come first. */
function planTable(plan, id) {
  const { robot } = plan.tracked, { dwells, poses, firstDirection } = plan.switches, cm = 100 * robot.tailLength;
  const starts = runningSum(dwells), names = [
    "start_s", "direction", "dwell_s", "x_cm", "y_cm", "heading_deg", "dwell_bar", "x_over_l", "y_over_l", "heading_rad",
  ];
  const rows = Array.from(dwells, (dwell, i) => {
    const [x, y, heading] = poses[i], direction = i % 2 ? -firstDirection : firstDirection, second = robot.timeScale;
    const row = [starts[i] * second, direction, dwell * second, x * cm, y * cm, heading * DEGREES, dwell, x, y, heading];
    return [...row.map((value) => general(value, 8)), id].join(",");
  });
  return `${[[...names, "plan_id"].join(","), ...rows].join("\n")}\n`;
}

/* Round dwells [s] to whole ms, carry rounding errors over, and split long dwells by zeros. */
function milliseconds(seconds) {
  const edges = runningSum(seconds).map((time) => Math.round(1000 * time)), entries = [];
  differences(edges).forEach((length, i) => {
    let count = length;
    if (count < 1) {
      throw new InputError(
        `dwell ${i + 1} is ${general(1000 * seconds[i], 3)} ms; the header counts whole milliseconds: use a longer `
        + "minimum dwell",
      );
    }
    for (; count > MOST_MS; count -= MOST_MS) entries.push(MOST_MS, 0);
    entries.push(count);
  });
  return entries;
}

/* Write schedule.h as text. */
function controllerHeader(plan, id, template) {
  const { robot, model } = plan.tracked, seconds = planSeconds(plan), entries = milliseconds(seconds);
  const [x, y, heading] = plan.switches.poses[0], cm = 100 * robot.tailLength, places = checkpoints(plan, seconds);
  const lines = entries.flatMap((_, i) => (i % A_LINE ? [] : [entries.slice(i, i + A_LINE).join(", ")]));
  const parts = {
    IDENTITY: id, NAME: safeName(robot), AFTER: "Stop after the last entry.", MODEL: model, STATED: statedWithin(plan),
    FIRST_DIRECTION: plan.switches.firstDirection, COUNT: entries.length, TOTAL: sum(entries),
    MOTOR: robot.measured ? "" : `#define SCHEDULE_MOTOR_RPM ${((robot.motorSpeed * 30) / Math.PI).toFixed(3)}\n`,
    X_CM: (cm * x).toFixed(4), Y_CM: (cm * y).toFixed(4), DEGREES: (DEGREES * heading).toFixed(3),
    X: x.toFixed(6), Y: y.toFixed(6), HEADING: heading.toFixed(6), CHECKPOINTS: places.length,
    entries: lines.join(",\n    "), places: places.join(",\n    "),
  };
  return template.replace(/@(\w+)@/g, (_, mark) => parts[mark]);
}

/* Say how far from the path the robot may get. */
function statedWithin({ tracked: { robot, calibrated }, drawn, errors, unmeasured }) {
  const exact = calibrated ? "" : ", if its coefficients are exact";
  const lines = [`Of 100 such robots 95 stay within ${inLab(errors.stated, robot)} of the path${exact}.`];
  if (unmeasured > Math.max(...extent(drawn))) {
    lines.push(`Not known before calibration (other robots differ by ${inLab(unmeasured, robot)}).`);
  } else if (unmeasured !== null) {
    lines.push(`With the coefficients of another robot: stated error ${inLab(unmeasured, robot)}.`);
  }
  return lines.map((line) => ` * ${line}`).join("\n");
}

/* Write time in ms and predicted pose of some flips and of the end, as C. */
function checkpoints(plan, seconds) {
  const ends = runningSum(seconds), count = ends.length;
  const places = new Set(Array.from(linspace(0, count - 1, Math.min(count, CHECKPOINTS)), Math.trunc));
  return Array.from(places, (i) => {
    const pose = plan.switches.poses[i].map((value) => `${value.toFixed(5)}f`);
    return `{${Math.round(1000 * ends[i])}UL, ${pose.join(", ")}}`;
  });
}

/* The robot's name without characters that could end a comment in C. */
function safeName({ name }) {
  return Array.from(name).filter((sign) => /[\p{L}\p{N} \-_.]/u.test(sign)).join("");
}

export { planWarnings, planSeconds, planDuration, planRecord, planFiles };
