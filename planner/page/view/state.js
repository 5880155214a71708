/* What the user has chosen: robot, path and options; its form in the page's address; undo and redo.
 *
 * A state is a plain object and is never changed: each change makes a new one.
 *   robot    {name, values}: the values of FIELDS in laboratory units
 *   path     {shape, size}, with the size in cm; or {points, closed, name}, with points in cm: those drawn in the
 *            page are in whole thousandths, those of a file are as in the file
 *   options  those of OPTIONS
 * The address holds, after #, a version and what differs from the page's own first state. */
import { closeMatch } from "../words.js";

const VERSION = 1;
const THOUSANDTHS = 1000; // of a centimetre: the grid of points
const MOST_STEPS = 500; // that can be undone
const MOST_POINTS = 20_000; // of a path, which an address can hold

/* Fields of the robot: key, words, unit, number of the unit in one SI unit, step of a key press, of all robots. */
const FIELDS = [
  { key: "tails", words: "Number of tails N", unit: "", perSi: 1, step: 1, first: true },
  { key: "tailLength", words: "Tail length l", unit: "cm", perSi: 100, step: 0.1, first: true },
  { key: "motorSpeed", words: "Motor speed", unit: "rpm", perSi: 30 / Math.PI, step: 1, first: true },
  { key: "viscosity", words: "Viscosity", unit: "Pa s", perSi: 1, step: 0.01, first: true },
  { key: "tailRadius", words: "Tail radius", unit: "mm", perSi: 1000, step: 0.05 },
  { key: "youngsModulus", words: "Stiffness (Young's modulus)", unit: "MPa", perSi: 1e-6, step: 0.05 },
  { key: "headRadius", words: "Head radius", unit: "mm", perSi: 1000, step: 0.5 },
  { key: "headLength", words: "Head length", unit: "mm", perSi: 1000, step: 1 },
  { key: "discOffset", words: "Disc offset", unit: "mm", perSi: 1000, step: 0.5, optional: true },
  { key: "C_t", words: "Drag coefficient C_t", unit: "", perSi: 1, step: 0.05 },
  { key: "C_r", words: "Spin drag coefficient C_r", unit: "", perSi: 1, step: 0.05 },
  { key: "C_yr", words: "Side force coefficient C_yr", unit: "", perSi: 1, step: 0.05 },
];

const OPTIONS = {
  objective: "error",
  corner: "nearest",
  point: "head_centre",
  minimumSeconds: null, // shortest dwell that the motor allows [s]
  tolerance: null, // largest stated error [cm]
  timeWeight: 0,
  keepOut: "", // regions, and walls, as words [cm]
  walls: "",
  start: "", // and goal, as X,Y,DEGREES [cm]; no goal: the path is followed; no start: 0,0,0
  goal: "",
  smooth: null, // length over which a drawn stroke is smoothed [cm]; null: the page's own
};

/* Robot fields in laboratory units from those in SI units. A number that is a round one keeps its digits. */
function labValues(robot) {
  return Object.fromEntries(FIELDS.map(({ key, perSi }) => [key, tidied(robot[key] ?? null, perSi)]));
}

/* Scale a number, and remove the last bits that this leaves: 3.2 instead of 3.2000000000000006. */
function tidied(number, scale) {
  const value = number * scale, short = Number(value.toPrecision(12));
  if (number === null) return null;
  return Math.abs(short - value) <= 4 * Number.EPSILON * Math.abs(value) ? short : value;
}

/* Robot fields in SI units from those in laboratory units; `given` has exact SI values of unchanged fields. */
function siValues(values, given = {}) {
  const known = labValues(given);
  return Object.fromEntries(FIELDS.map(({ key, perSi }) => {
    return [key, values[key] === known[key] ? given[key] ?? null : values[key] && values[key] / perSi];
  }));
}

/* Put points on the grid of thousandths, without repeating one. */
function onGrid(points) {
  const rows = points.map((point) => point.map((value) => Math.round(value * THOUSANDTHS) / THOUSANDTHS));
  return rows.filter(([x, y], i) => i === 0 || x !== rows[i - 1][0] || y !== rows[i - 1][1]);
}

/* Say why points are no path of the page; empty: they are. */
function pointsRefusal({ length }) {
  if (length < 2) return "The path needs two or more corners that differ.";
  if (length <= MOST_POINTS) return "";
  return `The path has ${length} points, and the page takes up to ${MOST_POINTS}: give fewer, or plan it with softflagella plan.`;
}

/* A state as the planner takes it; `given` has exact SI values of fields of the robot. */
function wishOf({ robot, path, options: { smooth, ...options } }, given) {
  const { points, closed, name, shape, size } = path;
  const drawing = points ? { points, closed, name } : { words: `${shape}:${size}` };
  return { robot: { ...given, name: robot.name, ...siValues(robot.values, given) }, path: drawing, options };
}

/* Write a state as the part of an address behind #, without what is as in `initial`. */
function addressOf(state, initial) {
  const parts = [], { shape, size, points, closed, name } = state.path;
  const add = (key, value, first) => {
    if (value !== first) parts.push(`${key}=${encodeURIComponent(value ?? "none")}`);
  };
  add("robot", state.robot.name, initial.robot.name);
  for (const { key } of FIELDS) add(key, state.robot.values[key], initial.robot.values[key]);
  if (JSON.stringify(state.path) !== JSON.stringify(initial.path)) {
    if (!points) add("path", `${shape}:${size}`);
    else if (JSON.stringify(points) === JSON.stringify(onGrid(points))) add("points", packed(points));
    else add("places", points.join("~"));
    if (closed) add("closed", 1);
    add("name", name || undefined);
  }
  for (const key of Object.keys(OPTIONS)) add(key, state.options[key], initial.options[key]);
  return parts.length ? [`v=${VERSION}`, ...parts].join("&") : "";
}

/* Read an address; return {state, problem}. A problem is a sentence, and the state is then `initial`. locked: whether the
 * page has no other robot than the initial one. */
function fromAddress(text, initial, shapes, locked = false) {
  if (text === "") return { state: initial, problem: "" };
  try {
    if (text.split("&").includes("")) throw new Error("it is cut off or damaged");
    return { state: readState(new Map(new URLSearchParams(text)), initial, shapes, locked), problem: "" };
  } catch (broken) {
    const problem = `The link cannot be read: ${broken.message}. The page shows its own first plan.`;
    return { state: initial, problem };
  }
}

function readState(parts, initial, shapes, locked) {
  const values = { ...initial.robot.values }, options = { ...initial.options };
  const known = ["v", "robot", "points", "places", "closed", "name", "path", ...Object.keys(values), ...Object.keys(OPTIONS)];
  const unknown = [...parts.keys()].find((key) => !known.includes(key));
  if (parts.get("v") !== String(VERSION)) throw new Error("it is of another version of this page");
  if (unknown !== undefined) throw new Error(`it has an unknown part, ${unknown}`);
  if (locked && ["robot", ...Object.keys(values)].some((key) => parts.has(key))) throw new Error("it is of another robot");
  if ([...parts.values()].join("").includes("\ufffd")) throw new Error("it is cut off or damaged");
  for (const { key, optional } of FIELDS) if (parts.has(key)) values[key] = number(key, parts.get(key), optional);
  for (const [key, standard] of Object.entries(OPTIONS)) {
    if (parts.has(key)) options[key] = typeof standard === "string" ? parts.get(key) : number(key, parts.get(key), true);
  }
  return {
    robot: { name: parts.get("robot") ?? initial.robot.name, values }, options,
    path: readPath(Object.fromEntries(parts), initial.path, shapes),
  };
}

function readPath({ points, places, closed, name = "", path }, initial, shapes) {
  if (points ?? places) return { points: points ? unpacked(points) : listed(places), closed: closed === "1", name };
  if (path === undefined) return initial;
  const at = path.lastIndexOf(":"), shape = path.slice(0, at), size = number("path", path.slice(at + 1));
  if (shapes.includes(shape)) return { shape, size };
  const near = closeMatch(shape, shapes);
  throw new Error(`it has an unknown shape, ${shape}${near === null ? "" : ` (is it ${near}?)`}`);
}

/* Read a number; null: "none", which only some may be. */
function number(key, text, optional = false) {
  const value = Number(text);
  if (optional && text === "none") return null;
  if (text.trim() === "" || !Number.isFinite(value)) throw new Error(`${key} is no number`);
  return value;
}

/* Write thousandths as differences in base 36: "a.-3~1.0" has the points (10, -3) and (11, -3) thousandths. */
function packed(points) {
  let [x, y] = [0, 0];
  return points.map((point) => {
    const [right, up] = point.map((value) => Math.round(value * THOUSANDTHS)), step = [right - x, up - y];
    [x, y] = [right, up];
    return step.map((value) => value.toString(36)).join(".");
  }).join("~");
}

function unpacked(text) {
  let [x, y] = [0, 0];
  const points = text.split("~").map((pair) => {
    if (!/^-?[0-9a-z]+\.-?[0-9a-z]+$/.test(pair)) throw new Error("it is cut off or damaged");
    const [right, up] = pair.split(".").map((digits) => parseInt(digits, 36));
    x += right;
    y += up;
    return [x / THOUSANDTHS, y / THOUSANDTHS];
  });
  if (points.length < 2) throw new Error("its path has one point");
  return points;
}

/* Read points as they are: "1.0625,2~3,4". */
function listed(text) {
  const points = text.split("~").map((pair) => pair.split(",").map((value) => number("path", value)));
  if (points.length < 2 || points.some(({ length }) => length !== 2)) throw new Error("it is cut off or damaged");
  return points;
}

/* The states that can be undone and done again. */
class History {
  constructor(state) {
    this.states = [state];
    this.index = 0;
  }

  get state() {
    return this.states[this.index];
  }

  /* Take a new state. Changes with the same `kind`, such as moves of one slider, are one step. */
  change(state, kind = null) {
    if (JSON.stringify(state) === JSON.stringify(this.state)) return false;
    const kept = kind !== null && kind === this.kind ? this.index : this.index + 1;
    this.states = [...this.states.slice(0, kept), state].slice(-MOST_STEPS - 1);
    this.index = this.states.length - 1;
    this.kind = kind;
    return true;
  }

  /* End a change that goes on, so that the next one is a step of its own. */
  settle() {
    this.kind = null;
  }

  /* Whether a step back (-1) or on (1) is possible. */
  has(step) {
    return this.index + step in this.states;
  }

  move(step) {
    if (this.has(step)) this.index += step;
    this.settle();
  }
}

export { FIELDS, OPTIONS, History, addressOf, fromAddress, labValues, onGrid, pointsRefusal, siValues, wishOf };
