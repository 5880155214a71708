/* The planner in a worker: {id, what, content} comes in, and {id, answer}, {id, refusal, about} or {id, progress} go
 * out. Questions and answers are plain data, lengths in cm, times in s.
 *
 * The first message is {what: "start", content: the planner's data}. Errors of the program go out as `broken`. */
import { readData } from "./data.js";
import { trackedVehicle, vehicleOfParts } from "./from_table.js";
import { readPose } from "./goal.js";
import { geomspace } from "./math.js";
import { readSpace } from "./obstacles.js";
import { openFile } from "./open_file.js";
import { extent, pageShape, pathLength, pathOf, polyline, scaled, smoothed } from "./path.js";
import { followedPath, makePlan, planRequest } from "./plan.js";
import { planDuration, planFiles, planRecord, planSeconds, planWarnings } from "./plan_files.js";
import { makeRobot, robotToml } from "./robot.js";
import { comparedRuns, comparedTrack } from "./measured.js";
import { trackedMeasured, vehicleToml } from "./measured_vehicle.js";
import { readTable } from "./table.js";
import { QUICK, SAMPLES, longestDwell, speedOf, trackedPoint, turnRadius, yawRate } from "./vehicle.js";
import { InputError, inPage, refusing, repr } from "./words.js";

const STROKE = 60; // a drawn stroke is smoothed over this part of its length
const TRADED = 10; // dwells of the trade-off

/* Make the answers to the page's questions, by name. `data` is what Python has written: {table, files}; a measured
 * vehicle has no table. */
async function service(data) {
  const locked = data.table?.vehicle ? await readData(data.table, true) : null; // a robot that is not computed anew
  if (locked) locked.vehicle = vehicleOfParts(locked.vehicle, locked.name);
  const table = locked || !data.table ? null : await readTable(data.table);
  let last = null; // {key, plan}: the plan that the page shows
  const opened = new Map(); // plan.json files by their ids, for tracks of these plans
  let asked = null; // {key, swims}: the vehicle that was asked for last

  function tracked(fields, point) {
    const key = JSON.stringify([fields, point]);
    if (asked?.key === key) return asked.swims;
    asked = { key, swims: trackedOf(fields, point) };
    return asked.swims;
  }

  function trackedOf(fields, point) {
    if (fields.measured) return trackedMeasured(fields, point);
    if (!locked) return trackedVehicle(makeRobot(fields), table, point);
    return trackedPoint(makeRobot({ ...fields, groups: locked.groups }), locked, point, locked.identity);
  }

  function planOf(wish, progress = null) {
    const key = JSON.stringify(wish);
    if (last?.key === key) return last.plan;
    const swims = refusing(() => tracked(wish.robot, pointOf(wish.options)), (refusal) => {
      refusal.about ??= "robot";
      throw refusal;
    });
    const { drawn, request } = wishIn(wish, swims);
    last = { key, plan: makePlan(drawn, swims, request, progress) };
    return last.plan;
  }

  return {
    path: ({ path, options }) => {
      const drawn = drawnPath(path), space = refusing(() => readSpace(options, 1), () => null); // the plan says why
      const poses = refusing(() => endsOf(options, 1), () => []);
      return { points: poses.length > 1 ? [] : drawn.points, closed: drawn.closed, corners: drawn, poses, space };
    },
    steady: ({ robot }) => steadyMotion(tracked(robot, "head_centre")),
    plan: (wish, progress) => pictured(planOf(wish, progress)),
    smooth: ({ points, closed, over }) => {
      const stroke = pathOf(closed ? [...points, points[0]] : points, closed);
      const length = over ?? pathLength(stroke) / STROKE;
      return { points: smoothed(stroke, length).path.points, over: Number(length.toPrecision(2)) };
    },
    tradeOff: (wish) => tradedOff(wish, tracked(wish.robot, pointOf(wish.options))),
    file: ({ name, wish }) => {
      if (name === "path.csv" && wish.options.goal) throw new InputError("a way to a goal has no path.csv; take plan.json along");
      if (name === "path.csv") return pathTable(drawnPath(wish.path));
      if (name === "robot.toml") return robotToml(makeRobot(wish.robot));
      if (name === "vehicle.toml") return vehicleToml(wish.robot);
      return planFiles(planOf(wish), data.files)[name];
    },
    open: (file) => {
      const { plan, ...content } = openFile(file);
      if (plan?.id) opened.set(plan.id, plan);
      return content;
    },
    runs: ({ table: measured, name, robot }) => comparedRuns(measured, name, robot, table),
    compare: ({ table: track, how }) => {
      if (!last) throw new InputError("there is no plan with which the track can be compared; plan first");
      const shown = JSON.parse(planRecord(last.plan).text), [id] = track.plans ?? [];
      const itsOwn = id !== shown.id && opened.get(id); // the page plans anew, with other last digits and another id
      return { ...comparedTrack(itsOwn || shown, track, how), ofFile: itsOwn ? id : "" };
    },
  };
}

/* The path in cm that a state of the page describes. */
function drawnPath({ points, closed, words }) {
  if (points) return pathOf(points, closed);
  const at = words.lastIndexOf(":");
  return pageShape(words.slice(0, at), Number(words.slice(at + 1)));
}

/* The drawn path in tail lengths, and what is asked of a plan; options of the page are in s and cm. */
function wishIn({ path, options }, { robot }) {
  const cm = 100 * robot.tailLength, tolerance = options.tolerance === null ? null : options.tolerance / cm;
  const [start, goal = null] = endsOf(options, cm);
  const request = planRequest({ ...options, tolerance, space: readSpace(options, cm), start, goal });
  return { drawn: scaled(drawnPath(path), 1 / cm), request };
}

/* The start, and the goal if there is one, with the length of `cm` tails. */
function endsOf({ start, goal }, cm) {
  const begin = readPose(start || "0,0,0", "start", cm);
  return goal ? [begin, readPose(goal, "goal", cm)] : [begin];
}

/* The point that is tracked: a goal is that of the head's centre. */
function pointOf({ point, goal }) {
  return goal ? "head_centre" : point;
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

/* The numbers of a plan that the page shows; `first_plan` of Python has the same. */
function pictured(plan) {
  const { tracked, errors, switches, declared, drawn, guidance, straight, unmeasured, clear } = plan, { robot } = tracked;
  const cm = 100 * robot.tailLength, place = ([x, y, ...heading]) => [x * cm, y * cm, ...heading];
  const inCm = (length) => (length === null ? null : length * cm);
  return {
    reference: declared.reference.p.map(place),
    closed: drawn.closed,
    motion: errors.motion.map(place),
    samples: SAMPLES,
    offset: inCm(tracked.offset),
    dwells: Array.from(planSeconds(plan)),
    firstDirection: switches.firstDirection,
    minimumDwell: guidance.dwell * robot.timeScale,
    stated: inCm(errors.stated),
    calibrated: tracked.calibrated,
    unmeasured: inCm(unmeasured),
    size: inCm(Math.max(...extent(drawn))),
    feedback: inCm(errors.feedback),
    guaranteed: inCm(errors.guaranteed),
    predictedRms: inCm(errors.predictedRms),
    predictedMax: inCm(errors.predictedMax),
    offDrawn: inCm(declared.offDrawn),
    missed: inCm(declared.missed),
    netSpeed: inCm(straight.speed) / robot.timeScale,
    warnings: planWarnings(plan),
    timeScale: robot.timeScale,
    ...(plan.goal && { goal: place(plan.goal), way: inCm(plan.length) }),
    ...(clear && { margin: inCm(clear.margin), clearance: inCm(clear.clearance) }),
  };
}

/* Stated error and time of plans with several dwells, up to the longest that makes sense. */
function tradedOff(wish, tracked) {
  const { drawn, request } = wishIn(wish, tracked), { robot: { tailLength, timeScale }, vehicle } = tracked;
  const rows = Array.from(geomspace(QUICK, longestDwell(vehicle, QUICK), TRADED)).flatMap((dwell) => refusing(() => {
    const followed = followedPath(drawn, tracked, { ...request, tolerance: null, minimumSeconds: null, dwell });
    const seconds = planDuration(followed) * timeScale, stated = 100 * tailLength * followed.stated;
    return [{ dwell: dwell * timeScale, seconds, stated }];
  }, () => [])); // such dwells do not get the robot around the path
  if (rows.length < 2) throw new InputError("no two dwells get the robot around this path");
  return rows;
}

/* path.csv: the path in cm, from which the command makes the same plan. */
function pathTable(path) {
  return `x_cm,y_cm\n${polyline(path).map((point) => point.map(repr).join(",")).join("\n")}\n`;
}

const PAUSE = 100; // ms between two words of progress

let answers = null;

async function answerTo({ id, what, content }) {
  if (what === "start") {
    answers = service(content);
    return;
  }
  let told = performance.now();
  const progress = (stage, done) => {
    if (performance.now() - told < PAUSE) return;
    told = performance.now();
    postMessage({ id, progress: { stage, done } });
  };
  try {
    postMessage({ id, answer: await (await answers)[what](content, progress) });
  } catch (error) {
    const refused = error instanceof InputError, robot = content.robot ?? content.wish?.robot;
    postMessage({
      id,
      refusal: refused ? inPage(error.message, robot) : "this cannot be planned",
      about: error.about ?? null,
      broken: refused ? null : String(error.stack ?? error),
    });
  }
}

globalThis.onmessage = ({ data }) => answerTo(data);

export { pictured };
