/* What the page asks of the planner: questions and answers in plain data. Lengths in cm, times in s. */
import { inflated, readData } from "./data.js";
import { unmeasuredError } from "./errors.js";
import { trackedVehicle, vehicleOfParts } from "./from_table.js";
import { geomspace } from "./math.js";
import { openFile } from "./open_file.js";
import { pageShape, pathLength, pathOf, polyline, scaled, smoothed } from "./path.js";
import { makePlan, planRequest } from "./plan.js";
import { planDuration, planFiles, planRecord, planSeconds, planWarnings } from "./plan_files.js";
import { makeRobot, robotToml } from "./robot.js";
import { comparedRuns } from "./runs.js";
import { readTable } from "./table.js";
import { comparedTrack } from "./track.js";
import { QUICK, SAMPLES, longestDwell, speedOf, trackedPoint, turnRadius, yawRate } from "./vehicle.js";
import { InputError, inPage, refusing, repr } from "./words.js";

const STROKE = 60; // a drawn stroke is smoothed over this part of its length
const TRADED = 10; // dwells of the trade-off

/* Make the answers to the page's questions, by name. `data` is what Python has written: {table, files}. */
async function service(data) {
  const locked = data.table.vehicle ? lockedVehicle(await readData(data.table), data.table.name) : null;
  const table = locked ? null : await readTable(data.table);
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
    return trackedPoint(makeRobot({ ...fields, groups: locked.groups }), locked, point, data.table.identity);
  }

  function planOf(wish, progress = null) {
    const key = JSON.stringify(wish);
    if (last?.key === key) return last.plan;
    const swims = refusing(() => tracked(wish.robot, wish.options.point), (refusal) => {
      refusal.about ??= "robot";
      throw refusal;
    });
    const { drawn, request } = wishIn(wish, swims), plan = makePlan(drawn, swims, request, progress);
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
    open: openFile,
    runs: ({ table: measured, name, robot }) => comparedRuns(measured, name, robot, table),
    compare: ({ table: track, how }) => {
      if (!last) throw new InputError("there is no plan with which the track can be compared; plan first");
      return comparedTrack(JSON.parse(planRecord(last.plan).text), track, how);
    },
  };
}

/* The vehicle of a robot that the page does not compute anew, of what Python has written. */
function lockedVehicle({ vehicle, groups, ownTable, calibrated }, name) {
  const flat = (part) => part?.values ?? null;
  const rows = ({ shape: [count], values }) => Array.from({ length: count }, (_, i) => {
    return values.subarray((i * values.length) / count, ((i + 1) * values.length) / count);
  });
  const flattened = (parts) => Object.fromEntries(Object.entries(parts).map(([key, part]) => [key, flat(part)]));
  const modeOf = ({ twist, lag, current, ...mode }) => {
    return { ...mode, twist: rows(twist), lag: lag && rows(lag), current: flat(current) };
  };
  const parts = {
    ...vehicle,
    twist: rows(vehicle.twist),
    curves: vehicle.curves.map(flattened),
    before: flat(vehicle.before),
    phaseRate: Array.from(flat(vehicle.phaseRate)),
    errors: vehicle.errors.map((error) => ({ lag: null, memory: null, ...flattened(error) })),
    modes: vehicle.modes.map(modeOf),
    current: Array.from(flat(vehicle.current)),
  };
  const unmeasured = vehicle.unmeasured.map(modeOf);
  return { groups, ownTable, calibrated, unmeasured, vehicle: vehicleOfParts(parts, name) };
}

/* The path in cm that a state of the page describes. */
function drawnPath({ points, closed, words }) {
  if (points) return pathOf(points, closed);
  const at = words.lastIndexOf(":");
  return pageShape(words.slice(0, at), Number(words.slice(at + 1)));
}

/* The drawn path in tail lengths, and what is asked of a plan; options of the page are in s and cm. */
function wishIn({ path, options: { smooth, ...options } }, { robot }) {
  const cm = 100 * robot.tailLength, tolerance = options.tolerance === null ? null : options.tolerance / cm;
  return { drawn: scaled(drawnPath(path), 1 / cm), request: planRequest({ ...options, tolerance }) };
}

/* Steady motion, in the units of a laboratory. */
function steadyMotion({ robot, vehicle }) {
  const cm = 100 * robot.tailLength, [[forward, left]] = vehicle.twist;
  return {
    turnRadius: cm * turnRadius(vehicle),
    slip: Math.atan2(Math.abs(left), forward),
    yawRate: yawRate(vehicle) / robot.timeScale,
    speed: (cm * speedOf(vehicle)) / robot.timeScale,
    tailGap: vehicle.tailGap,
    omegaBar: robot.omegaBar,
  };
}

/* The numbers of a plan that the page shows. */
function pictured(plan) {
  const { tracked, errors, switches, declared, drawn, guidance, straight, unmeasured } = plan, { robot } = tracked;
  const cm = 100 * robot.tailLength, place = ([x, y, ...heading]) => [x * cm, y * cm, ...heading];
  const inCm = (length) => (length === null ? null : length * cm);
  return {
    drawn: { points: drawn.points.map(place), closed: drawn.closed },
    reference: declared.reference.p.map(place),
    closed: drawn.closed,
    track: errors.track.map(place),
    samples: SAMPLES,
    motion: errors.motion.map(place),
    flips: errors.track.filter((_, i) => i % SAMPLES === 0).map(place),
    start: place(switches.poses[0]),
    dwells: Array.from(planSeconds(plan)),
    firstDirection: switches.firstDirection,
    seconds: planDuration(plan) * robot.timeScale,
    minimumDwell: guidance.dwell * robot.timeScale,
    stated: inCm(errors.stated),
    calibrated: tracked.calibrated,
    unmeasured: inCm(unmeasured),
    feedback: inCm(errors.feedback),
    guaranteed: inCm(errors.guaranteed),
    predictedRms: inCm(errors.predictedRms),
    predictedMax: inCm(errors.predictedMax),
    offDrawn: inCm(declared.offDrawn),
    missed: inCm(declared.missed),
    netSpeed: inCm(straight.speed) / robot.timeScale,
    warnings: planWarnings(plan).map((words) => inPage(words, robot)),
    body: {
      headLength: 100 * robot.headLength, headRadius: 100 * robot.headRadius, tailLength: cm,
      tailRadius: 100 * robot.tailRadius, discOffset: 100 * (robot.discOffset ?? robot.headRadius), tails: robot.tails,
    },
    tailLength: cm,
    timeScale: robot.timeScale,
  };
}

/* Stated error and time of plans with several dwells, up to the longest that makes sense. */
function tradedOff(wish, tracked) {
  const { drawn, request } = wishIn(wish, tracked), { robot: { tailLength, timeScale }, vehicle } = tracked;
  const rows = Array.from(geomspace(QUICK, longestDwell(vehicle, QUICK), TRADED)).flatMap((dwell) => refusing(() => {
    const plan = makePlan(drawn, tracked, { ...request, tolerance: null, minimumSeconds: null, dwell });
    const stated = 100 * tailLength * plan.errors.stated;
    return [{ dwell: dwell * timeScale, seconds: planDuration(plan) * timeScale, stated }];
  }, () => [])); // such dwells do not get the robot around the path
  if (rows.length < 2) throw new InputError("no two dwells get the robot around this path");
  return rows;
}

/* path.csv: the path in cm, from which the command makes the same plan. */
function pathTable(path) {
  return `x_cm,y_cm\n${polyline(path).map((point) => point.map(repr).join(",")).join("\n")}\n`;
}

export { service };
