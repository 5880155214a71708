/* robot.toml: a robot in the units of a laboratory, with comments.
 *
 * Mirrors sim/model/robot_toml.py and `load_robot` of sim/inputs.py. A key is a quantity with its unit as suffix.
 * A robot with effects, a correction or a calibration is refused: Python makes its vehicle. */
import { closeMatch } from "./close_match.js";
import { general, pythonNumber, pythonText, repr } from "./format.js";
import { InputError } from "./input_error.js";
import { makeRobot } from "./robot.js";
import { UNITS, fromSi, splitName, toSi, unitsOfKind } from "./si_units.js";
import { isWhole } from "./seals.js";
import { readToml } from "./toml.js";

const ENTRIES = [
  ["tails", "count", "tails"],
  ["tails", "length", "tailLength", "cm"],
  ["tails", "radius", "tailRadius", "mm", "of a tail's section"],
  ["tails", "youngs_modulus", "youngsModulus", "MPa"],
  ["tails", "disc_offset", "discOffset", "mm", "from the axis to a tail's clamp"],
  ["head", "radius", "headRadius", "mm"],
  ["head", "length", "headLength", "mm"],
  ["fluid", "viscosity", "viscosity", "Pa_s"],
  ["motor", "speed", "motorSpeed", "rpm", "tails relative to head; the direction is the control"],
  ["drag", "C_t", "C_t", "", "force against motion: C_t 6π μ R v"],
  ["drag", "C_r", "C_r", "", "couple against spin: C_r 8π μ R³ ω"],
  ["drag", "C_yr", "C_yr", "", "side force of the spinning head, from the surface: C_yr μ R L ω"],
].map(([table, quantity, field, unit = "", comment = ""]) => ({ table, quantity, field, unit, comment }));
const MEASURED = new Set([
  "youngsModulus", "viscosity", "tailRadius", "tailLength", "headRadius", "headLength", "discOffset",
]); // fields whose standard deviation may be stated
const LARGEST_SIGMA = 0.5; // share of the number itself
const LARGEST = 1e100; // of a number, whatever its unit
const SIGMA = "_sigma";
const LOCKED = ["effects", "correction", "learnt_from", "calibration"];
const HEADER = `\
# Units are suffixes: length_cm, length_mm, speed_rpm, speed_rad_s, ... KEY_sigma states one standard deviation of
# a number, in its unit or as "5 %"; only a calibration uses it.
`;
const NOTE = `# Coefficients of the head (radius R, length L). For a new robot, start from 3, 2.8 and 2 as a first
# guess, and let \`softflagella calibrate\` fit them to measured runs.`;
const NO_EFFECTS = `# [effects]                       # their sizes, if there are any
# end_over_end_drag = 5.0`;
const SI = { length: "m", pressure: "Pa", viscosity: "Pa_s", "angular velocity": "rad_s" };

/* Read a robot. where: the file's name, for messages. */
function readRobot(text, where) {
  const tables = readToml(text, where), stem = where.replace(/\.[^.]*$/, "");
  const name = "name" in tables ? tables.name : stem;
  delete tables.name;
  const locked = LOCKED.find((table) => table in tables);
  if (locked) {
    throw new InputError(
      `${where} has [${locked}], and the page has no simulator for it; make a page of this robot: softflagella ` +
        `page --robot ${where} --out page.html`,
    );
  }
  if (!isWhole(text)) throw new InputError(`${where} was edited, damaged or cut short after it was written`);
  const fields = readFields(tables, where);
  try {
    return makeRobot({ name: typeof name === "string" ? name : shown(name), ...fields });
  } catch (refusal) {
    throw refusal instanceof InputError ? new InputError(`${where}: ${refusal.message}`) : refusal;
  }
}

/* Read the fields of a robot in SI units, and `sigmas`, from its tables. read_robot */
function readFields(tables, where) {
  const fields = {}, keys = {}, stated = [];
  for (const [table, content] of Object.entries(tables)) {
    const isTable = typeof content === "object" && !Array.isArray(content);
    for (const [key, value] of isTable ? Object.entries(content) : [["", content]]) {
      const isSigma = key.endsWith(SIGMA), entry = entryOf(table, isSigma ? key.slice(0, -SIGMA.length) : key);
      if (!entry || (isSigma && !MEASURED.has(entry.field))) {
        throw new InputError(`${where}: ${unknown(table, key)}`);
      }
      if (isSigma) stated.push({ entry, key, value });
      else if (entry.field in fields) {
        const both = `${keys[entry.field]} and ${key}`;
        throw new InputError(`${where}: [${table}] ${both} are the same number; drop one`);
      } else {
        fields[entry.field] = numberOf(value, key, `${where}: [${table}] ${key}`);
        keys[entry.field] = key;
      }
    }
  }
  for (const entry of ENTRIES) {
    if (!(entry.field in fields) && entry.field !== "discOffset") {
      throw new InputError(`${where}: missing entry [${entry.table}] ${keyOf(entry)}`);
    }
  }
  const sigmas = {}, scales = { discOffset: fields.headRadius, ...fields };
  for (const { entry, key, value } of stated) {
    sigmas[entry.field] = readSigma(value, scales[entry.field], key, `${where}: [${entry.table}] ${key}`);
  }
  return { ...fields, sigmas };
}

/* The entry that a key holds, in any unit of its kind. */
function entryOf(table, key) {
  const { quantity, unit } = splitName(key);
  return ENTRIES.find((entry) => {
    if (!entry.unit) return table === entry.table && key === entry.quantity;
    const alike = unit !== null && unit.kind === UNITS.get(entry.unit).kind;
    return table === entry.table && quantity === entry.quantity && alike;
  });
}

function keyOf({ quantity, unit }, other = unit) {
  return other ? `${quantity}_${other}` : quantity;
}

/* Say what is wrong with a key: it has no unit, or there is no such number; suggest one. */
function unknown(table, key) {
  const bare = key.endsWith(SIGMA) ? key.slice(0, -SIGMA.length) : key;
  const named = ENTRIES.find((entry) => entry.unit && entry.table === table && entry.quantity === bare);
  if (named) {
    const units = unitsOfKind(UNITS.get(named.unit).kind).map((unit) => keyOf(named, unit));
    return `[${table}] ${key} has no unit; give one of ${units.join(", ")}`;
  }
  const tables = [...new Set(ENTRIES.map((entry) => entry.table))], all = `a robot has [${tables.join("], [")}]`;
  if (!key) return `${table} is in no table; ${all}`;
  if (tables.includes(table)) return `unknown entry [${table}] ${key}; ${suggestion(table, key, bare)}`;
  const near = closeMatch(table, tables);
  return `unknown entry [${table}] ${key}; ${near === null ? all : `is it [${near}]?`}`;
}

/* Suggest a key of a table for one that it does not have, or list those that it has. */
function suggestion(table, key, bare) {
  const { quantity, unit } = splitName(bare), entries = ENTRIES.filter((entry) => entry.table === table);
  const entryNamed = (name) => entries.find((entry) => entry.quantity === name);
  if (entryNamed(quantity) && key !== bare && !MEASURED.has(entryNamed(quantity).field)) {
    return "this number takes no standard deviation";
  }
  const elsewhere = ENTRIES.find((entry) => entry.quantity === quantity && entry.table !== table);
  if (elsewhere) return `is it [${elsewhere.table}] ${key}?`;
  const ofDiameter = quantity.endsWith("diameter") && entryNamed("radius");
  const near = ofDiameter ? "radius" : closeMatch(quantity, entries.map((entry) => entry.quantity));
  if (near === null) return `[${table}] has ${entries.map((entry) => keyOf(entry)).join(", ")}, in any usual unit`;
  const entry = entryNamed(near), fits = unit && entry.unit && UNITS.get(entry.unit).kind === unit.kind;
  const wanted = keyOf(entry, fits ? unit.suffix : entry.unit);
  return ofDiameter ? `give ${wanted}, half of it` : `is it ${wanted}?`;
}

/* Convert a number of the file to SI units. */
function numberOf(value, key, entry) {
  if (typeof value !== "number") throw new InputError(`${entry} = ${shown(value)}; give a number`);
  if (!(Math.abs(value) < LARGEST)) throw new InputError(`${entry} = ${shown(value)}; give a finite number`);
  const { unit } = splitName(key);
  return unit ? toSi(value, unit.suffix) : value;
}

/* Read a standard deviation: {size, relative}, a number in the unit of its key, or a text like "10 %". */
function readSigma(given, value, key, entry) {
  const { unit } = splitName(key.slice(0, -SIGMA.length));
  const share = typeof given === "string" && given.trim().endsWith("%");
  const number = share ? pythonNumber(given.trim().slice(0, -1)) : typeof given === "number" ? given : null;
  if (number === null) {
    throw new InputError(
      `${entry} = ${shown(given)}; give a number in the unit of its key, or a text like "10 %"`,
    );
  }
  const size = share ? number / 100 : unit ? toSi(number, unit.suffix) : number;
  const sigma = share ? size * Math.abs(value) : size;
  if (!(Number.isFinite(size) && sigma >= 0 && sigma <= LARGEST_SIGMA * Math.abs(value))) {
    throw new InputError(
      `${entry} = ${shown(given)}; a standard deviation lies from 0 to half of the number itself`,
    );
  }
  return { size, relative: share };
}

/* A value as Python's repr writes it. */
function shown(value) {
  if (typeof value === "string") return pythonText(value);
  if (typeof value === "boolean") return value ? "True" : "False";
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : repr(value);
  if (Array.isArray(value)) return `[${value.map(shown).join(", ")}]`;
  return `{${Object.entries(value).map(([key, entry]) => `${pythonText(key)}: ${shown(entry)}`).join(", ")}}`;
}

/* Write the text of a robot.toml that is read back to the same robot, to the last bit. */
function robotToml(robot) {
  const tables = new Map();
  for (const entry of ENTRIES) {
    if (!tables.has(entry.table)) tables.set(entry.table, entry.table === "drag" ? [NOTE] : []);
    const lines = tables.get(entry.table), value = robot[entry.field], sigma = robot.sigmas[entry.field];
    const { unit, number } = written(value ?? robot.headRadius, entry), line = `${keyOf(entry, unit)} = ${number}`;
    lines.push(value === null ? withComment(`# ${line}`, `${entry.comment}; without it R`)
      : withComment(line, entry.comment));
    if (sigma) lines.push(sigmaLine(sigma, unit, entry));
  }
  const blocks = Array.from(tables, ([table, lines]) => [`[${table}]`, ...lines].join("\n"));
  const name = JSON.stringify(robot.name).replaceAll("\x7f", "\\u007f");
  return `${[`${HEADER}name = ${name}`, ...blocks, NO_EFFECTS].join("\n\n")}\n`;
}

function sigmaLine({ size, relative }, unit, entry) {
  if (relative) return `${keyOf(entry, unit)}${SIGMA} = "${general(100 * size, 12)} %"`;
  const own = written(size, entry);
  return `${keyOf(entry, own.unit)}${SIGMA} = ${own.number}`;
}

/* Write a number in its entry's unit, as short as it can be so that it is read back to the last bit; in SI units
 * where no number in that unit is read back exactly. */
function written(value, { unit, field }) {
  if (!unit) return { unit, number: field === "tails" ? String(value) : repr(value) };
  const guess = fromSi(value, unit), rounded = Array.from({ length: 17 }, (_, i) => Number(general(guess, i + 1)));
  for (const number of [...rounded, ...neighbours(guess)]) {
    if (toSi(number, unit) === value) return { unit, number: repr(number).replace(/\.0$/, "") };
  }
  return { unit: SI[UNITS.get(unit).kind], number: repr(value) };
}

/* The next larger and the next smaller number, of a number above 0. */
function neighbours(value) {
  const bits = new BigInt64Array(Float64Array.of(value).buffer);
  return [1n, -1n].map((step) => new Float64Array(BigInt64Array.of(bits[0] + step).buffer)[0]);
}

function withComment(text, comment) {
  return comment ? `${text.padEnd(33)} # ${comment}` : text;
}

export { readRobot, robotToml };
