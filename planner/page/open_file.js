/* What a file is that the user opens, by its ending and its content: a robot, a path, a track, runs, or a plan.
 *
 * An opened path is {kind: "path", paths: [{points, closed, name}], unit}: unit is the size of its unit in cm, null:
 * the numbers have no unit. A track is {kind: "track", table}, a table of runs {kind: "runs", table}, a robot {kind:
 * "robot", fields}. */
import { CONSTANTS } from "./constants.js";
import { textOf } from "./data.js";
import { readRobot } from "./robot.js";
import { areOfRuns } from "./measured.js";
import { checkPlanId } from "./seals.js";
import { readDrawing } from "./svg_drawing.js";
import { numbersOf, parseWords, readTablePath, textsOf } from "./tables.js";
import { splitName } from "./units.js";
import { InputError } from "./words.js";

const { KINDS, ADVICE, READ } = CONSTANTS.path_files; // KINDS: of each its endings, and how it begins
const HEAD = 4096; // bytes that tell
const FORMAT = 2; // of plan.json
const TRACK = ["heading", "time"]; // what a path does not have
const PATH = ["x", "y"]; // what a table of runs does not have

/* Read a file. bytes: its content. tree: of a drawing, {tag, attributes, children, text} of its elements. */
function openFile({ name, bytes, tree }) {
  const content = new Uint8Array(bytes ?? []), stem = name.replace(/\.[^.]*$/, "");
  if (/\.toml$/i.test(name)) return { kind: "robot", fields: readRobot(textOf(content, name), name) };
  if (tree) {
    const { paths, unit } = readDrawing(tree, name);
    const named = paths.map((path) => ({ ...path, name: paths.length > 1 ? path.name : stem }));
    return { kind: "path", unit: unit === null ? null : 100 * unit, paths: named };
  }
  refuseOtherKinds(name, content);
  if (/\.json$/i.test(name)) return pathOfPlan(textOf(content, name), name, stem);
  const { names, words, lines } = parseWords(content, name), texts = names.map(String);
  const table = { names, columns: words.map((column, i) => numbersOf(column, names[i])), lines };
  const quantities = texts.map((column) => splitName(column).quantity.toLowerCase());
  if (TRACK.every((quantity) => quantities.some((each) => each.startsWith(quantity)))) {
    const plans = [...new Set(words[names.indexOf("plan_id")])].filter(Boolean); // of which the track is
    return { kind: "track", table: { ...table, plans } };
  }
  if (!PATH.every((quantity) => quantities.includes(quantity)) && areOfRuns(texts)) {
    return { kind: "runs", table: { ...table, names: texts, texts: words.map(textsOf) } };
  }
  const { path, unit } = readTablePath(table, name);
  return { kind: "path", unit: unit === null ? null : 100 * unit, paths: [{ ...path, name: stem }] };
}

/* Refuse a file that is neither a table nor a drawing. bytes: its content. */
function refuseOtherKinds(name, bytes) {
  const head = String.fromCharCode(...bytes.subarray(0, HEAD)).replace(/^\xef\xbb\xbf/, "").trimStart();
  const ending = /\.([^.]*)$/.exec(name)?.[1].toLowerCase(), kinds = Object.keys(KINDS);
  const kind = kinds.find((each) => new RegExp(KINDS[each][1], "iy").test(head)) ??
    kinds.find((each) => KINDS[each][0].split(" ").includes(ending));
  if (kind === undefined || (kind === "JSON" && ending === "json")) return; // plan.json
  if (READ.includes(kind)) {
    throw new InputError(`${name}: the page does not read ${kind}; give CSV or SVG, or make the page with this path`);
  }
  const words = ADVICE[kind] ?? "give a table with columns x and y, such as CSV, or an SVG drawing";
  throw new InputError(`${name}: ${kind} is not read; ${words}`);
}

/* The drawn path of a plan.json, which may have more: walls, laps; and the plan, for its tracks. */
function pathOfPlan(text, name, stem) {
  const refused = (why) => new InputError(`${name} is not a plan.json of the planner (${why}); plan again`);
  let plan;
  try {
    plan = JSON.parse(text);
  } catch (broken) {
    throw refused(broken.message);
  }
  if (plan?.format === undefined) throw refused("no entry 'format'");
  if (plan.format !== FORMAT) {
    throw new InputError(`${name} has format ${plan.format}, this version reads ${FORMAT}: plan again`);
  }
  checkPlanId(plan.id, text, name);
  const { robot, raw_path: path, closed } = plan;
  const isPoint = (point) => Array.isArray(point) && point.length === 2 && point.every(Number.isFinite);
  if (!(robot?.tail_length_m > 0)) throw refused("no entry 'tail_length_m'");
  if (!(Array.isArray(path) && path.length >= 2 && path.every(isPoint))) {
    throw new InputError(`${name}: raw_path must have two or more rows of 2 finite numbers; plan again`);
  }
  const points = closed ? path.slice(0, -1) : path;
  return { kind: "path", unit: 100 * robot.tail_length_m, paths: [{ points, closed, name: stem }], plan };
}

export { openFile };
