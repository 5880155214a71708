/* The plan: its warnings, its table and the content of plan.json.
 *
 * Mirrors planner/planning/planned.py. A plan is {tracked, objective, drawn, declared, straight, guidance,
 * switches, errors}; tracked is {robot, vehicle, point, offset, model, ownTable, warnings}. Lengths in l, times in
 * μ0 l⁴/EI, unless a name says its unit. */
import { runningSum, sum } from "./arrays.js";
import { CAMERA } from "./feedback_error.js";
import { fixed, repr } from "./format.js";
import { polyline } from "./path.js";
import { groupValues } from "./robot.js";
import { sha256 } from "./sha256.js";
import { inLab, timeInLab } from "./units.js";
import { turnRadius, yawRate } from "./vehicle.js";

const FORMAT = 2;
const WIDE = 0.25; // turn radii; a predicted track that is further from the declared path gets a warning
const OWN_TABLE_FROM = 1.7; // stated error over predicted error, from which a table of its own is proposed
const DEGREES = 180 / Math.PI;

/* What the user should know, in words. Plan.warnings */
function planWarnings(plan) {
  return [...plan.declared.warnings, ...zigzagWarnings(plan), ...tableWarnings(plan), ...plan.tracked.warnings];
}

/* Propose the robot's own table where the errors of the look-up table decide the stated error. */
function tableWarnings({ tracked, errors, switches }) {
  const large = errors.stated >= OWN_TABLE_FROM * errors.predictedMax && errors.tableShare > 0.5;
  if (tracked.ownTable || !large) return [];
  return [
    `the stated error is mostly that of the look-up table, over ${switches.dwells.length} flips: simulate this ` +
      "robot's own table (--own-table, own_table=True), or measure poses on the way",
  ];
}

/* Warn of a predicted track that is far from the declared path. */
function zigzagWarnings({ tracked, errors, guidance }) {
  const { vehicle, robot } = tracked;
  if (errors.predictedMax <= WIDE * turnRadius(vehicle)) return [];
  const turn = guidance.dwell * yawRate(vehicle) * DEGREES;
  return [
    `the predicted track is up to ${inLab(errors.predictedMax, robot)} from the declared path: in dwells of ` +
      `${timeInLab(guidance.dwell, robot)} the robot turns by ${fixed(turn, 0)} degrees; shorter ones keep it ` +
      "nearer",
  ];
}

/* Dwell times [s]. Plan.seconds */
function planSeconds({ switches, tracked }) {
  return Float64Array.from(switches.dwells, (dwell) => dwell * tracked.robot.timeScale);
}

/* Time of the whole schedule. Plan.duration */
function planDuration({ switches }) {
  return sum(switches.dwells);
}

/* The columns of plan.csv; those in lab units come first. Plan.columns */
function planColumns(plan) {
  const { robot } = plan.tracked, { dwells, poses, firstDirection } = plan.switches, cm = 100 * robot.tailLength;
  const starts = runningSum(dwells).slice(0, -1), at = poses.slice(0, -1);
  return {
    start_s: Array.from(starts, (time) => time * robot.timeScale),
    direction: Array.from(dwells, (_, i) => (i % 2 ? -firstDirection : firstDirection)),
    dwell_s: planSeconds(plan),
    x_cm: at.map(([x]) => x * cm),
    y_cm: at.map(([, y]) => y * cm),
    heading_deg: at.map(([, , heading]) => heading * DEGREES),
    dwell_bar: dwells,
    x_over_l: at.map(([x]) => x),
    y_over_l: at.map(([, y]) => y),
    heading_rad: at.map(([, , heading]) => heading),
  };
}

/* The content of plan.json as text: {id, text}; id is a digest of all the rest. Plan.to_dict
 *
 * codeVersion: added where it is given. */
function planRecord(plan, codeVersion = null) {
  const content = planContent(plan), id = `p${sha256(pythonJson(content)).slice(0, 11)}`;
  const record = { id, ...content, ...(codeVersion === null ? {} : { code_version: codeVersion }) };
  return { id, text: pythonJson(record) };
}

function planContent(plan) {
  const { tracked, declared, errors, switches, drawn } = plan, { robot } = tracked;
  const [x, y, heading] = switches.poses[0];
  return {
    format: new Whole(FORMAT),
    robot: {
      name: robot.name,
      groups: groupValues(robot),
      tail_length_m: robot.tailLength,
      motor_speed_rad_s: robot.motorSpeed,
      time_scale_s: robot.timeScale,
    },
    point: tracked.point,
    offset_over_l: tracked.offset,
    first_direction: new Whole(switches.firstDirection),
    start: { x_over_l: x, y_over_l: y, heading_rad: heading },
    dwell_bar: Array.from(switches.dwells),
    dwell_s: Array.from(planSeconds(plan)),
    predicted_poses: switches.poses,
    reference: declared.reference.p,
    raw_path: polyline(drawn),
    closed: drawn.closed,
    objective: plan.objective,
    minimum_dwell_bar: plan.guidance.dwell,
    off_drawn_over_l: declared.offDrawn,
    missed_over_l: declared.missed,
    zigzag_rms_over_l: plan.straight.rms,
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
      heading_rad: Array.from(declared.reference.heading),
      look_ahead_over_l: plan.guidance.ahead,
      swing_rad: plan.guidance.swing,
      straight: straightContent(plan.straight),
    },
    model: tracked.model,
    own_table: tracked.ownTable,
    warnings: planWarnings(plan),
    ...(tracked.calibration ? { calibration: tracked.calibration } : {}),
  };
}

/* The content of plan.json about straight motion. Zigzag.to_dict */
function straightContent({ dwells, speed, swing, sway, drift, rms, largest }) {
  return {
    dwells_bar: dwells, speed_bar: speed, swing_rad: swing, sway_over_l: sway, drift_bar: drift, rms_over_l: rms,
    largest_over_l: largest,
  };
}

/* A whole number, which Python writes without a point. */
class Whole {
  constructor(value) {
    this.value = value;
  }
}

/* Write JSON as Python's json.dumps does; numbers are floats, but for `Whole`. */
function pythonJson(value) {
  if (typeof value === "number") return repr(value).replace("inf", "Infinity").replace("nan", "NaN");
  if (typeof value === "string") return asciiText(value);
  if (value instanceof Whole) return String(value.value);
  if (Array.isArray(value)) return `[${value.map(pythonJson).join(", ")}]`;
  if (value === null || typeof value === "boolean") return String(value);
  const entries = Object.entries(value).map(([name, entry]) => `${asciiText(name)}: ${pythonJson(entry)}`);
  return `{${entries.join(", ")}}`;
}

/* A text in double quotes, with other signs than those of ASCII as \uXXXX. */
function asciiText(text) {
  const hidden = (unit) => `\\u${unit.charCodeAt(0).toString(16).padStart(4, "0")}`;
  return JSON.stringify(text).replace(/[\x7f-\uffff]/g, (unit) => (unit === "\x7f" ? unit : hidden(unit)));
}

export { planWarnings, planSeconds, planDuration, planColumns, planRecord };
