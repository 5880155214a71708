/* The robot in SI units, its dimensionless groups, and robot.toml: a robot in the units of a laboratory, with
 * comments.
 *
 * A robot is {name, tails, tailLength, tailRadius, youngsModulus, headRadius, headLength, viscosity, motorSpeed, C_t,
 * C_r, C_yr, discOffset, sigmas} and what follows from them: timeScale [s] and omegaBar. Lengths in m, modulus in Pa,
 * viscosity in Pa s, speed in rad/s. A robot whose groups Python has written, with its effects, has them
 * as `groups`; a file with effects or a calibration is refused: Python makes its vehicle. A vehicle of which Python has
 * written its `outline` has no robot (measured_vehicle.js). */
import { CONSTANTS } from "./constants.js";
import { isWhole } from "./seals.js";
import { UNITS, fromSi, splitName, toSi } from "./units.js";
import { InputError, closeMatch, general, naming, quoted, repr } from "./words.js";

const { MOST_TAILS, LEAST_SLENDERNESS } = CONSTANTS.groups;
const { ENTRIES, MEASURED, LARGEST, LARGEST_SIGMA, SIGMA, HEADER, NOTES, NO_EFFECTS, SI } = CONSTANTS.robot_toml;
const POSITIVE = {
  tail_length: "tailLength", tail_radius: "tailRadius", youngs_modulus: "youngsModulus", head_radius: "headRadius",
  head_length: "headLength", viscosity: "viscosity", motor_speed: "motorSpeed", C_t: "C_t", C_r: "C_r",
};
const LOCKED = ["effects", "learnt_from", "calibration"];
const WORDS = /"(?:[^"\\\n]|\\.)*"?|'[^'\n]*'?|[^\s,[\]"'#]+/g; // of a value
const DECIMAL = /^[+-]?(?:0|[1-9](?:_?\d)*)(?:\.\d(?:_?\d)*)?(?:[eE][+-]?\d(?:_?\d)*)?$/;
const DECIMAL_COMMA = /^[ \t]*[\w-]+[ \t]*=[ \t]*([+-]?\d{1,20}),(\d{1,20})[ \t]*(?:#.*)?$/m;

/* Make a robot of its numbers; refuse numbers that no robot has. */
function makeRobot(fields) {
  const robot = { discOffset: null, sigmas: {}, ...fields }, ratio = robot.tailLength / robot.tailRadius;
  if (!(Number.isInteger(robot.tails) && robot.tails >= 1 && robot.tails <= MOST_TAILS)) {
    throw new InputError(`N = ${general(robot.tails)}; the number of tails is an integer from 1 to ${MOST_TAILS}`);
  }
  for (const [name, field] of Object.entries({ ...POSITIVE, disc_offset: "discOffset", C_yr: "C_yr" })) {
    const value = robot[field];
    if (name === "disc_offset" && value === null) continue;
    if (!(Math.abs(value) < Number.MAX_VALUE)) throw new InputError(`${name} = ${repr(value)}; it must be a finite number`);
    if (name !== "C_yr" && value <= 0) throw new InputError(`${name} = ${general(value)}; it must be above 0`);
  }
  if (!(ratio > LEAST_SLENDERNESS)) {
    throw new InputError(
      `l/r0 = ${general(ratio)}; resistive force theory needs slender tails: above ${LEAST_SLENDERNESS}`,
    );
  }
  const stiffness = (robot.youngsModulus * Math.PI * robot.tailRadius ** 4) / 4;
  robot.timeScale = (robot.viscosity * robot.tailLength ** 4) / stiffness;
  robot.omegaBar = robot.motorSpeed * robot.timeScale;
  const numbers = [robot.timeScale, ...Object.values(groupValues(robot))];
  if (!numbers.every(Number.isFinite) || !(robot.omegaBar > 0)) {
    throw new InputError("lengths, stiffness and viscosity give no finite unit of time; check their units");
  }
  return robot;
}

/* The dimensionless groups by column name, for the positive direction of the motor. */
function groupValues(robot) {
  if (robot.groups) return robot.groups;
  return {
    C_t: robot.C_t,
    C_r: robot.C_r,
    C_yr: robot.C_yr,
    l_over_R: robot.tailLength / robot.headRadius,
    L_over_R: robot.headLength / robot.headRadius,
    l_over_r0: robot.tailLength / robot.tailRadius,
    omega_bar: robot.omegaBar,
    N: robot.tails,
    a_over_R: (robot.discOffset || robot.headRadius) / robot.headRadius,
  };
}

/* Front and back of the body, forward from the point whose poses count, and half of its width [l]. */
function outlineOf({ outline, headLength, headRadius, discOffset, tailRadius, tailLength }) {
  if (outline) return outline;
  const front = headLength / 2 / tailLength;
  return [front, -front - 1, Math.max(headRadius, (discOffset || headRadius) + tailRadius) / tailLength];
}

/* Read a robot. where: the file's name, for messages. */
function readRobot(text, where) {
  const { name = where.replace(/\.[^.]*$/, ""), ...tables } = readToml(text.replace(/^\ufeff/, ""), where);
  if ("correction" in tables) {
    throw new InputError(`${where}: [correction] is no longer read; calibrate the robot as it was given again`);
  }
  if (Object.keys(tables).some((key) => splitName(key).quantity === "speed")) {
    throw new InputError(
      `${where} is a measured vehicle; make a page of it: softflagella page --robot ${where} --out page.html`,
    );
  }
  const locked = LOCKED.find((table) => table in tables);
  if (locked) {
    throw new InputError(
      `${where} has [${locked}], and the page has no simulator for it; make a page of this robot: softflagella `
      + `page --robot ${where} --out page.html`,
    );
  }
  if (!isWhole(text)) throw new InputError(`${where} was edited, damaged or cut short after it was written`);
  return naming(where, () => makeRobot({ name: String(name), ...readFields(tables) }));
}

/* Read TOML as robots are written in it: tables, and keys with numbers, texts of one line, truth values and arrays. */
function readToml(text, where) {
  const root = {}, lines = text.split(/\r?\n/);
  let table = root, pending = null;
  const broken = (line, reason) => {
    const comma = DECIMAL_COMMA.exec(text);
    const advice = comma ? `; write ${comma[1]}.${comma[2]} for ${comma[1]},${comma[2]}` : "";
    return new InputError(`${where} is not TOML: ${reason} (at line ${line + 1})${advice}`);
  };
  lines.forEach((whole, i) => {
    const content = whole.replace(/^((?:[^#"']|"(?:[^"\\]|\\.)*"|'[^']*')*)#.*$/, "$1").trim();
    const header = /^\[\s*([\w-]+)\s*\]$/.exec(content), pair = /^("[^"]*"|[\w-]+)\s*=\s*(.*)$/.exec(content);
    if (!content) return;
    if (pending) pending.text += ` ${content}`;
    else if (header) {
      if (Object.hasOwn(root, header[1])) throw broken(i, `a second [${header[1]}]`);
      table = root[header[1]] = {};
    } else if (pair) pending = { key: pair[1].replaceAll('"', ""), text: pair[2] };
    else throw broken(i, "a table or key = value is expected");
    if (!pending || unclosed(pending.text)) return;
    const value = valueOf(pending.text);
    if (value === undefined) throw broken(i, `invalid value of ${pending.key}`);
    if (Object.hasOwn(table, pending.key)) throw broken(i, `a second ${pending.key}`);
    table[pending.key] = value;
    pending = null;
  });
  if (pending) throw broken(lines.length - 1, `unclosed value of ${pending.key}`);
  return root;
}

/* Whether an array goes on in the next line. */
function unclosed(text) {
  const bare = text.replace(/"(?:[^"\\]|\\.)*"?|'[^']*'?/g, "");
  return bare.split("[").length > bare.split("]").length;
}

/* A value of TOML, read as JSON; undefined: it is none. */
function valueOf(text) {
  const wide = (_, hex) => JSON.stringify(String.fromCodePoint(Math.min(parseInt(hex, 16), 0x10ffff))).slice(1, -1);
  const json = text.replace(WORDS, (word) => {
    if (word[0] === '"') return word.replace(/\\U([\da-fA-F]{8})/g, wide);
    if (word[0] === "'") return JSON.stringify(word.slice(1, -1));
    return word === "true" || word === "false" || !DECIMAL.test(word) ? word : String(Number(word.replaceAll("_", "")));
  });
  try {
    return JSON.parse(json.replace(/,\s*\]$/, "]")) ?? undefined;
  } catch {
    return undefined;
  }
}

/* Read the fields of a robot in SI units, and `sigmas`, from its tables. */
function readFields(tables) {
  const fields = {}, keys = {}, stated = [];
  for (const [table, content] of Object.entries(tables)) {
    const isTable = typeof content === "object" && !Array.isArray(content);
    for (const [key, value] of isTable ? Object.entries(content) : [["", content]]) {
      const isSigma = key.endsWith(SIGMA), entry = entryOf(table, isSigma ? key.slice(0, -SIGMA.length) : key);
      if (!entry || (isSigma && !MEASURED.includes(entry.field))) throw new InputError(unknown(table, key));
      if (isSigma) stated.push({ entry, key, value });
      else if (entry.field in fields) {
        throw new InputError(`[${table}] ${keys[entry.field]} and ${key} are the same number; drop one`);
      } else {
        fields[entry.field] = numberOf(value, key, `[${table}] ${key}`);
        keys[entry.field] = key;
        if (!["tails", "C_yr"].includes(entry.field) && value <= 0) {
          throw new InputError(`[${table}] ${key} = ${general(value)}; it must be above 0`);
        }
      }
    }
  }
  const lacking = ENTRIES.find(({ field, optional }) => !(field in fields) && !optional);
  if (lacking) throw new InputError(`missing entry [${lacking.table}] ${keyOf(lacking)}`);
  const sigmas = {}, scales = { discOffset: fields.headRadius, ...fields };
  for (const { entry, key, value } of stated) {
    sigmas[entry.field] = readSigma(value, scales[entry.field], key, `[${entry.table}] ${key}`);
  }
  return { ...fields, sigmas };
}

/* The entry that a key holds, in any unit of its kind. */
function entryOf(table, key) {
  const { quantity, unit } = splitName(key);
  return ENTRIES.find((entry) => {
    if (table !== entry.table) return false;
    if (!entry.unit) return key === entry.quantity;
    return quantity === entry.quantity && unit?.kind === UNITS.get(entry.unit).kind;
  });
}

function keyOf({ quantity, unit }, other = unit) {
  return other ? `${quantity}_${other}` : quantity;
}

/* Say what is wrong with a key, and name what may be meant. */
function unknown(table, key) {
  const known = ENTRIES.map((entry) => `[${entry.table}] ${keyOf(entry)}`), tables = new Set(ENTRIES.map((entry) => entry.table));
  const near = closeMatch(`[${table}] ${key.replace("diameter", "radius")}`, known), half = key.includes("diameter");
  const hint = near ? `is it ${near}${half ? ", half of it" : ""}?` : `a robot has [${[...tables].join("], [")}]`;
  return `unknown entry [${table}] ${key}; ${hint}`;
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
  const { unit } = splitName(key.slice(0, -SIGMA.length)), words = String(given).trim();
  const share = words.length > 1 && words.endsWith("%") ? words.slice(0, -1).trim() : undefined;
  const number = typeof given === "number" ? given : Number(share ?? NaN);
  if (Number.isNaN(number)) {
    throw new InputError(`${entry} = ${shown(given)}; give a number in the unit of its key, or a text like "10 %"`);
  }
  const size = share !== undefined ? number / 100 : unit ? toSi(number, unit.suffix) : number;
  const sigma = share !== undefined ? size * Math.abs(value) : size;
  if (!(Number.isFinite(size) && sigma >= 0 && sigma <= LARGEST_SIGMA * Math.abs(value))) {
    throw new InputError(`${entry} = ${shown(given)}; a standard deviation lies from 0 to half of the number itself`);
  }
  return { size, relative: share !== undefined };
}

function shown(value) {
  if (typeof value === "string") return quoted(value);
  return typeof value === "number" ? general(value, 12) : JSON.stringify(value);
}

/* Write the text of a robot.toml that is read back to the same robot, to the last bit. */
function robotToml(robot) {
  const tables = new Map();
  for (const entry of ENTRIES) {
    if (!tables.has(entry.table)) tables.set(entry.table, entry.table in NOTES ? [NOTES[entry.table]] : []);
    const value = robot[entry.field], sigma = robot.sigmas[entry.field];
    const { unit, number } = written(value ?? robot.headRadius, entry);
    const line = `${value === null ? "# " : ""}${keyOf(entry, unit)} = ${number}`;
    const comment = value === null ? `${entry.comment}; without it R` : entry.comment, lines = tables.get(entry.table);
    lines.push(comment ? `${line.padEnd(33)} # ${comment}` : line);
    if (sigma?.relative) lines.push(`${keyOf(entry, unit)}${SIGMA} = "${general(100 * sigma.size, 12)} %"`);
    else if (sigma) {
      const own = written(sigma.size, entry);
      lines.push(`${keyOf(entry, own.unit)}${SIGMA} = ${own.number}`);
    }
  }
  const blocks = Array.from(tables, ([table, lines]) => [`[${table}]`, ...lines].join("\n"));
  const name = JSON.stringify(robot.name).replaceAll("\x7f", "\\u007f");
  return `${[`${HEADER}name = ${name}`, ...blocks, NO_EFFECTS].join("\n\n")}\n`;
}

/* Write a number in its entry's unit, as short as it can be so that it is read back to the last bit; in SI units
 * where no number in that unit is read back exactly. */
function written(value, { unit, field }) {
  if (!unit) return { unit, number: field === "tails" ? String(value) : repr(value) };
  const guess = fromSi(value, unit), digits = Array.from({ length: 17 }, (_, i) => Number(guess.toPrecision(i + 1)));
  const number = digits.find((short) => toSi(short, unit) === value);
  if (number !== undefined) return { unit, number: repr(number).replace(/\.0$/, "") };
  return { unit: SI[UNITS.get(unit).kind], number: repr(value) };
}

export { makeRobot, groupValues, outlineOf, readRobot, robotToml };
