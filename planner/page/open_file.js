/* What a file is that the user opens, by its ending and its content: a robot, a path, a track, runs, or a plan.
 *
 * An opened path is {kind: "path", paths: [{points, closed, name}], unit}: unit is the size of its unit in cm,
 * null: the numbers have no unit. A track is {kind: "track", table}, a table of runs {kind: "runs", table}, a
 * robot {kind: "robot", fields}. */
import { refuseOtherKinds } from "./file_kinds.js";
import { InputError } from "./input_error.js";
import { areOfRuns } from "./measured_table.js";
import { numbersOf, textsOf } from "./number_words.js";
import { readTablePath } from "./path_files.js";
import { readRobot } from "./robot_toml.js";
import { checkPlanId } from "./seals.js";
import { splitName } from "./si_units.js";
import { pathNames, readSvg } from "./svg_drawing.js";
import { parseWords } from "./text_tables.js";

const FORMAT = 2; // of plan.json
const TRACK = ["heading", "time"]; // what a path does not have
const PATH = ["x", "y"]; // what a table of runs does not have
const TOML = /\.toml$/i,
  SVG = /\.svg$/i,
  JSON_FILE = /\.json$/i;

/* Read a file. bytes: its content. */
function openFile({ name, bytes }) {
  const content = new Uint8Array(bytes);
  if (TOML.test(name)) return { kind: "robot", fields: readRobot(textOf(content, name), name) };
  if (SVG.test(name)) return pathsOfDrawing(textOf(content, name), name);
  refuseOtherKinds(name, content);
  if (JSON_FILE.test(name)) return pathOfPlan(textOf(content, name), name);
  const { names, words, lines } = parseWords(content, name, false), columns = names.map(String);
  const quantities = columns.map((column) => splitName(column).quantity.toLowerCase());
  const table = () => ({ names, columns: words.map((column, i) => numbersOf(column, names[i])) });
  if (TRACK.every((quantity) => quantities.some((each) => each.startsWith(quantity))))
    return { kind: "track", table: { ...table(), plans: plansOf(names, words) } };
  if (!PATH.every((quantity) => quantities.includes(quantity)) && areOfRuns(columns)) {
    return { kind: "runs", table: { ...table(), texts: words.map(textsOf), lines } };
  }
  const { path, unit } = readTablePath(content, name);
  return { kind: "path", unit: unit === null ? null : 100 * unit, paths: [{ ...path, name: stem(name) }] };
}

/* The ids of the plans that a track is of. */
function plansOf(names, words) {
  return [...new Set(words[names.indexOf("plan_id")])].filter(Boolean);
}

/* The paths of an SVG, those that can be read; where there is none, the refusal of the first. */
function pathsOfDrawing(text, name) {
  const names = pathNames(text, name);
  if (names.length < 2) {
    const { path, unit } = readSvg(text, name);
    return { kind: "path", unit: unit === null ? null : 100 * unit, paths: [{ ...path, name: stem(name) }] };
  }
  const drawings = names.map((shape) => ({ shape, ...readSvg(text, name, null, shape) }));
  const [{ unit }] = drawings;
  return {
    kind: "path",
    unit: unit === null ? null : 100 * unit,
    paths: drawings.map(({ shape, path }) => ({ ...path, name: shape })),
  };
}

/* The drawn path of a plan.json. */
function pathOfPlan(text, name) {
  let plan;
  try {
    plan = JSON.parse(text);
  } catch (broken) {
    throw new InputError(`${name} is not a plan.json of the planner (${broken.message}); plan again`);
  }
  if (plan?.format === undefined)
    throw new InputError(`${name} is not a plan.json of the planner (it has no format); plan again`);
  if (plan.format !== FORMAT)
    throw new InputError(`${name} has format ${plan.format}, this version reads ${FORMAT}: plan again`);
  checkPlanId(plan.id, text, name);
  checkPlan(plan, name);
  const cm = 100 * plan.robot.tail_length_m,
    points = plan.closed ? plan.raw_path.slice(0, -1) : plan.raw_path;
  return { kind: "path", unit: cm, paths: [{ points, closed: plan.closed, name: stem(name) }] };
}

/* Refuse a plan without a length or a path. It may have more than is read here: walls, laps, an arrival. */
function checkPlan({ robot, raw_path: path }, name) {
  const isPoint = (point) => Array.isArray(point) && point.length === 2 && point.every(Number.isFinite);
  if (!(robot?.tail_length_m > 0))
    throw new InputError(`${name} is not a plan.json of the planner ('tail_length_m'); plan again`);
  if (!(Array.isArray(path) && path.length >= 2 && path.every(isPoint)))
    throw new InputError(`${name}: raw_path must have two or more rows of 2 finite numbers; plan again`);
}

/* The text of a file, which must be text. */
function textOf(bytes, name) {
  try {
    return new TextDecoder("utf-8", { fatal: true }).decode(bytes);
  } catch {
    throw new InputError(`${name} is no text in UTF-8`);
  }
}

function stem(name) {
  return name.replace(/\.[^.]*$/, "");
}

export { openFile };
