/* What the page asks of the planner: questions and answers in plain data. Lengths in cm, times in s. */
import { inPage } from "./advice.js";
import { pathOf, pathLength, polyline, scaled, smoothed } from "./path.js";
import { repr } from "./format.js";
import { geomspace } from "./arrays.js";
import { InputError } from "./input_error.js";
import { unmeasuredError } from "./errors.js";
import { makePlan } from "./plan.js";
import { pageShape } from "./page_shapes.js";
import { planDuration, planRecord, planSeconds, planWarnings } from "./planned.js";
import { planRequest } from "./request.js";
import { planFiles } from "./plan_files.js";
import { makeRobot } from "./robot.js";
import { robotToml } from "./robot_toml.js";
import { vehicleOfParts } from "./from_table.js";
import { readTable } from "./lookup.js";
import { trackedPoint, trackedVehicle } from "./tracked_point.js";
import { speedOf, turnRadius, yawRate } from "./vehicle.js";
import { SAMPLES, predictedPoses } from "./rollout.js";
import { QUICK, longestDwell } from "./dwell_choice.js";
import { inflated, readData } from "./table_data.js";
import { openFile } from "./open_file.js";
import { comparedRuns } from "./compared_runs.js";
import { comparedTrack } from "./compared_track.js";

const STROKE = 60; // a drawn stroke is smoothed over this part of its length
const TRADED = 10; // dwells of the trade-off

/* Make the answers to the page's questions, by name. `data` is what Python has written: {table, files}. */
async function service(data) {
  const { locked, table } = data.table.vehicle
    ? { locked: lockedVehicle(await readData(data.table), data.table.name), table: null }
    : { locked: null, table: await readTable(data.table) };
  const files = { ...data.files, tracker: await inflated(data.files.tracker).text() };
  let last = null; // {key, plan}: the plan that the page shows
  let asked = null; // {key, swims}: the vehicle that was asked for last

  function tracked(fields, point) {
    const key = JSON.stringify([fields, point]);
    if (asked?.key !== key) asked = { key, swims: vehicleOf(fields, point) };
    return asked.swims;
  }

  function vehicleOf(fields, point) {
    if (!locked) return trackedVehicle(makeRobot(fields), table, point);
    const robot = makeRobot({ ...fields, groups: locked.groups });
    return trackedPoint(robot, locked, point, data.table.identity);
  }

  function planOf(wish, progress = null) {
    const key = JSON.stringify(wish);
    if (last?.key === key) return last.plan;
    const swims = about("robot", () => tracked(wish.robot, wish.options.point)),
      cm = 100 * swims.robot.tailLength;
    const drawn = inTails(drawnPath(wish.path), cm);
    const request = requestOf(wish.options, cm);
    const plan = makePlan(drawn, swims, request, progress);
    last = { key, plan: { ...plan, unmeasured: unmeasuredError(plan) } };
    return last.plan;
  }

  return {
    path: ({ path }) => {
      const drawn = drawnPath(path);
      return { points: drawn.points, closed: drawn.closed, corners: drawn, length: pathLength(drawn) };
    },
    steady: ({ robot }) => steadyMotion(tracked(robot, "head_centre")),
    plan: (wish, progress) => pictured(planOf(wish, progress)),
    smooth: ({ points, closed, over }) => {
      const stroke = pathOf(closed ? [...points, points[0]] : points, closed);
      const length = over ?? pathLength(stroke) / STROKE;
      return { points: smoothed(stroke, length).path.points, over: Number(length.toPrecision(2)) };
    },
    tradeOff: (wish) => tradedOff(wish, tracked(wish.robot, wish.options.point)),
    file: ({ name, wish }) => {
      if (name === "path.csv") return pathTable(drawnPath(wish.path));
      if (name === "robot.toml") return robotToml(makeRobot(wish.robot));
      return planFiles(planOf(wish), files)[name];
    },
    open: (content) => openFile(content),
    runs: ({ table: measured, name, robot }) => comparedRuns(measured, name, robot, table),
    compare: ({ table: track, how }) => {
      if (!last) throw new InputError("there is no plan with which the track can be compared; plan first");
      return comparedTrack(JSON.parse(planRecord(last.plan).text), track, how);
    },
  };
}

/* Do some work, and say of its refusals what they are about, unless they do. */
function about(subject, work) {
  try {
    return work();
  } catch (refusal) {
    if (refusal instanceof InputError) refusal.about ??= subject;
    throw refusal;
  }
}

/* The vehicle of a robot that the page does not compute anew, of what Python has written. */
function lockedVehicle({ vehicle, groups, ownTable, calibrated }, name) {
  const flat = (part) => part?.values ?? null;
  const rows = ({ shape, values }) =>
    Array.from({ length: shape[0] }, (_, i) => {
      const size = values.length / shape[0];
      return values.subarray(i * size, (i + 1) * size);
    });
  const curves = vehicle.curves.map((curve) => mapped(curve, flat));
  const errors = vehicle.errors.map((error) => ({ lag: null, memory: null, ...mapped(error, flat) }));
  const modeOf = ({ name: ofMode, twist, lag, current }) =>
    ({ name: ofMode, twist: rows(twist), lag: lag && rows(lag), current: flat(current) });
  const parts = {
    ...vehicle,
    twist: rows(vehicle.twist),
    curves,
    before: flat(vehicle.before),
    phaseRate: Array.from(flat(vehicle.phaseRate)),
    errors: () => errors,
    modes: vehicle.modes.map(modeOf),
    current: Array.from(flat(vehicle.current)),
  };
  const unmeasured = vehicle.unmeasured.map(modeOf);
  return { groups, ownTable, calibrated, unmeasured, vehicle: vehicleOfParts(parts, name) };
}

function mapped(parts, change) {
  return Object.fromEntries(Object.entries(parts).map(([name, part]) => [name, change(part)]));
}

/* The path in cm that a state of the page describes. */
function drawnPath({ points, closed, words }) {
  if (points) return pathOf(points, closed);
  const at = words.lastIndexOf(":");
  return pageShape(words.slice(0, at), Number(words.slice(at + 1)));
}

function inTails(path, cm) {
  return scaled(path, 0.01 / (cm / 100));
}

/* What is asked of a plan; options of the page are in s and cm. */
function requestOf({ point, corner, timeWeight, objective, minimumSeconds, tolerance }, cm) {
  const most = tolerance === null ? null : tolerance / cm;
  return planRequest({ point, corner, timeWeight, objective, minimumSeconds, tolerance: most });
}

/* Steady motion, in the units of a laboratory. */
function steadyMotion({ robot, vehicle }) {
  const cm = 100 * robot.tailLength,
    [twist] = vehicle.twist;
  return {
    turnRadius: cm * turnRadius(vehicle),
    slip: Math.atan2(Math.abs(twist[1]), twist[0]),
    yawRate: yawRate(vehicle) / robot.timeScale,
    speed: (cm * speedOf(vehicle)) / robot.timeScale,
    tailGap: vehicle.tailGap,
    omegaBar: robot.omegaBar,
  };
}

/* The numbers of a plan that the page shows. */
function pictured(plan) {
  const { tracked, errors, switches, declared, drawn, guidance } = plan,
    { robot } = tracked;
  const cm = 100 * robot.tailLength,
    place = ([x, y, ...heading]) => [x * cm, y * cm, ...heading];
  const seconds = planSeconds(plan);
  const radius = (cm * (robot.discOffset ?? robot.headRadius)) / robot.tailLength;
  return {
    drawn: { points: drawn.points.map(place), closed: drawn.closed },
    reference: declared.reference.p.map(place),
    closed: drawn.closed,
    track: errors.track.map(place),
    samples: SAMPLES,
    motion: motionOf(tracked.vehicle, switches).map(place),
    flips: errors.track.filter((_, i) => i % SAMPLES === 0).map(place),
    start: place(switches.poses[0]),
    dwells: Array.from(seconds),
    firstDirection: switches.firstDirection,
    seconds: planDuration(plan) * robot.timeScale,
    minimumDwell: guidance.dwell * robot.timeScale,
    stated: errors.stated * cm,
    calibrated: tracked.calibrated,
    unmeasured: plan.unmeasured === null ? null : plan.unmeasured * cm,
    feedback: errors.feedback * cm,
    guaranteed: errors.guaranteed === null ? null : errors.guaranteed * cm,
    predictedRms: errors.predictedRms * cm,
    predictedMax: errors.predictedMax * cm,
    offDrawn: declared.offDrawn * cm,
    missed: declared.missed * cm,
    netSpeed: (plan.straight.speed * cm) / robot.timeScale,
    warnings: planWarnings(plan).map((words) => inPage(words, robot)),
    body: {
      headLength: 100 * robot.headLength,
      headRadius: 100 * robot.headRadius,
      tailLength: cm,
      tailRadius: 100 * robot.tailRadius,
      discOffset: radius,
      tails: robot.tails,
    },
    tailLength: cm,
    timeScale: robot.timeScale,
  };
}

/* Poses of the head's centre at the times of the track. */
function motionOf(vehicle, switches) {
  const poses = predictedPoses(vehicle, switches); // of each dwell both ends
  return poses.filter((_, i) => i % (SAMPLES + 1) < SAMPLES || i === poses.length - 1);
}

/* Stated error and time of plans with several dwells, up to the longest that makes sense. */
function tradedOff(wish, tracked) {
  const cm = 100 * tracked.robot.tailLength,
    drawn = inTails(drawnPath(wish.path), cm);
  const request = { ...requestOf(wish.options, cm), tolerance: null, minimumSeconds: null };
  const rows = [];
  for (const dwell of geomspace(QUICK, longestDwell(tracked.vehicle, QUICK), TRADED)) {
    try {
      const plan = makePlan(drawn, tracked, { ...request, dwell }, null),
        { timeScale } = tracked.robot;
      rows.push({
        dwell: dwell * timeScale,
        seconds: planDuration(plan) * timeScale,
        stated: plan.errors.stated * cm,
      });
    } catch (refusal) {
      if (!(refusal instanceof InputError)) throw refusal; // such dwells do not get the robot around the path
    }
  }
  if (rows.length < 2) throw new InputError("no two dwells get the robot around this path");
  return rows;
}

/* path.csv: the path in cm, from which the command makes the same plan. */
function pathTable(path) {
  return `x_cm,y_cm\n${polyline(path)
    .map((point) => point.map(repr).join(","))
    .join("\n")}\n`;
}

export { service };
