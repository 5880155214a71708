/* Units of lengths, times, angles and other quantities; times as people write them; columns in wanted units.
 *
 * A value v in a unit is (v + zero) · times / over in SI units. Of a robot, tailLength [m] and timeScale [s] count. */
import { CONSTANTS } from "./constants.js";
import { smallest } from "./math.js";
import { InputError, fixed, general, quoted, repr, trimmedEnd, whole } from "./words.js";

const { UNITS: KNOWN, TEXTS, SPELLINGS, SIGNS, MOST_PARTS } = CONSTANTS.units;
const UNITS = new Map(Object.entries(KNOWN));
const RPM = (2 * Math.PI) / 60; // rad/s
const CASE_COUNTS = new Set(["l", "r"]); // L and R are the head's
const { CLOCK, EPOCH, LATEST } = CONSTANTS.quantities;
const WHOLE_CLOCK = whole(CLOCK);
const DATE = /^(\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d)?)?)(?:(?<=:\d\d:\d\d)[.,](\d+))?(?:Z|([+-]\d\d):?(\d\d))?$/;

/* Find a unit by its suffix or another spelling ("deg/s", "°", "U/min"); null if it is no known unit. */
function findUnit(text) {
  const bare = unbracketed(text.trim()).trim();
  const word = Array.from(bare, (sign) => SIGNS[sign] ?? sign).join("").replace(/_+/g, "_");
  return UNITS.get(Object.hasOwn(SPELLINGS, word) ? SPELLINGS[word] : word) ?? null;
}

/* A unit without the brackets around it. */
function unbracketed(unit) {
  return trimmedEnd(unit.replace(/^[[\]()]+/, ""), "[]()");
}

/* Split the name of a column or key into {quantity, unit}; unit null if it has none or an unknown one.
 *
 * The unit is a suffix (R_yr_mm) or stands in brackets behind the name ("R_yr [mm]", "X (cm)"). */
function splitName(name) {
  const text = name.trim(), head = text.slice(0, -1), bracket = head.replaceAll("(", "[").lastIndexOf("[");
  const inside = head.slice(bracket + 1);
  if (bracket >= 0 && /[\])]$/.test(text) && !/[\])]/.test(inside)) {
    return { quantity: trimmedEnd(text.slice(0, bracket), "_ \t").trim(), unit: findUnit(inside) };
  }
  const parts = text.split("_");
  for (let first = Math.max(1, parts.length - MOST_PARTS); first < parts.length; first++) {
    const unit = UNITS.get(parts.slice(first).join("_"));
    if (unit && unit.suffix !== "1") return { quantity: parts.slice(0, first).join("_"), unit }; // x_1 is a name
  }
  return { quantity: text, unit: null };
}

/* A unit as people write it: rad/s. */
function unitText({ suffix }) {
  return TEXTS[suffix] ?? suffix;
}

/* List the suffixes of the units of a kind, such as "length". */
function unitsOfKind(kind) {
  return [...UNITS.values()].filter((unit) => unit.kind === kind).map((unit) => unit.suffix);
}

function toSi(value, suffix) {
  const { times, over, zero } = UNITS.get(suffix);
  return ((value + zero) * times) / over;
}

function fromSi(value, suffix) {
  const { times, over, zero } = UNITS.get(suffix);
  return (value * over) / times - zero;
}

/* Convert a number between units of one kind. */
function convertUnit(value, given, wanted) {
  return given === wanted ? value : fromSi(toSi(value, given), wanted);
}

/* Write a duration as people say it: 0.35 s, 48.2 s, 12.5 min, 3 h 20 min, 7.5 days. */
function formatTime(seconds) {
  const size = Math.abs(seconds), minutes = Math.round(seconds / 60);
  if (!Number.isFinite(seconds) || size < 90) return `${general(seconds, 3)} s`;
  if (size < 5400) return `${general(seconds / 60, 3)} min`;
  if (size >= 172800) return `${general(seconds / 86400, 3)} days`;
  const hours = `${Math.floor(minutes / 60)} h`;
  return minutes % 60 ? `${hours} ${minutes % 60} min` : hours;
}

/* Write a length in metres as people say it: 3.2 mm, 12.4 cm, 3.1 m. */
function formatLength(metres) {
  const size = Math.abs(metres);
  if (size && size < 0.01) return `${general(1000 * metres, 3)} mm`;
  return size >= 2 ? `${general(metres, 3)} m` : `${general(100 * metres, 3)} cm`;
}

/* Write a length given in tail lengths: 3.52 cm (0.32 l). */
function inLab(value, robot) {
  return `${formatLength(value * robot.tailLength)} (${inTails(value)} l)`;
}

/* Write a length in tail lengths: 0.32, 12, 1200. */
function inTails(value) {
  return Math.abs(value) < 1000 ? general(value, 3) : fixed(value, 0);
}

/* Write a time given in units of μ0 l⁴/EI: 1.79 s (0.81 time units). */
function timeInLab(value, robot) {
  return `${formatTime(value * robot.timeScale)} (${general(value, 2)} time units)`;
}

/* Write a place given in tail lengths: (3.52, 1.1) cm = (0.32, 0.1) l. */
function placeInLab(x, y, robot) {
  const written = (scale, places) => [x, y].map((value) => fixed(scale * value, places)).join(", ");
  return `(${written(100 * robot.tailLength, 2)}) cm = (${written(1, 3)}) l`;
}

/* Convert the steady motion of a robot to the columns of a measured table. lengthCm: tail length [cm]. timeScale:
 * unit of time [s]. */
function labColumns(motion, lengthCm, timeScale) {
  return {
    omega_h_rpm: motion.omega_h_bar / (timeScale * RPM),
    omega_t_rpm: motion.omega_t_bar / (timeScale * RPM),
    omega_yr_rad_s: motion.omega_yr_bar / timeScale,
    R_yr_cm: motion.R_yr_over_l * lengthCm,
    theta_deg: motion.theta_deg,
    v_cm_s: (Math.hypot(motion.v_x, motion.v_z) * lengthCm) / timeScale,
  };
}

/* Convert a column of times, words and the numbers where they are, to numbers in a unit; NaN for what is none. */
function timesOf(words, numbers, unit) {
  if (numbers.some(Number.isNaN)) {
    for (const kind of [dateOf, clockOf]) {
      const seconds = Float64Array.from(words, (word) => (word === null ? NaN : kind(word)));
      if (seconds.every(Number.isNaN)) continue;
      const from = kind === dateOf ? earliest(seconds) : 0;
      return seconds.map((value) => convertUnit(value - from, "s", unit));
    }
  }
  const times = numbers.map((value) => (convertUnit(Math.abs(value), unit, "s") < LATEST ? value : NaN));
  const first = earliest(times), size = convertUnit(first, unit, "s");
  return EPOCH < size && size < LATEST ? times.map((value) => value - first) : times;
}

function earliest(values) {
  return smallest(values.filter((value) => !Number.isNaN(value)));
}

function clockOf(word) {
  const match = WHOLE_CLOCK.exec(word);
  if (!match) return NaN;
  const [days, hours, minutes, seconds] = match.slice(1).map((part) => Number((part ?? "0").replace(",", ".")));
  return 86400 * days + 3600 * hours + 60 * minutes + seconds;
}

function dateOf(word) {
  const [, text = "", part = "0", hours = "+00", minutes = "00"] = DATE.exec(word) ?? [], given = text.replace(" ", "T");
  const date = new Date(given.length > 10 ? `${given}Z` : given), zone = new Date(`1970-01-01T00:00${hours}:${minutes}`);
  const isDay = !Number.isNaN(date.getTime()) && date.toISOString().startsWith(given);
  return isDay ? (date.getTime() + zone.getTime()) / 1000 + Number(`0.${part}`) : NaN;
}

/* Rename and convert columns to those that are wanted: {table, notes}; all others stay as they are.
 *
 * A table is {names, columns}; it may have `texts`, values as they are shown. where: the table's name, for messages.
 * synonyms: a map of other names of a quantity, in lower case, to its name without unit; a name may be a unit. */
function convertColumns(table, wanted, where, synonyms = new Map()) {
  const names = table.names.map(String), columns = [...table.columns], texts = table.texts && [...table.texts];
  const notes = [];
  for (const name of wanted) {
    const candidates = names.filter((column) => column === name || isAlike(column, name, synonyms));
    if (candidates.length > 1) {
      throw new InputError(`${where}: ${candidates.join(" and ")} are the same quantity; drop all but one`);
    }
    if (!candidates.length) checkBare(names, name, where, synonyms);
    if (!candidates.length || candidates[0] === name) continue;
    const [column] = candidates, at = names.indexOf(column);
    const given = unitOf(column, synonyms), target = splitName(name).unit;
    if (given === null || target === null || given.suffix === target.suffix) {
      notes.push(`column ${column} read as ${name}`);
    } else {
      columns[at] = columns[at].map((value) => convertUnit(value, given.suffix, target.suffix));
      if (texts) texts[at] = Array.from(columns[at], repr);
      notes.push(`column ${column} converted from ${unitText(given)} to ${unitText(target)} (${name})`);
    }
    names[at] = name;
  }
  return { table: { ...table, names, columns, ...(texts && { texts }) }, notes };
}

/* Whether a column of another name holds a quantity, in any unit of its kind. */
function isAlike(column, wanted, synonyms) {
  const { quantity, unit: target } = splitName(wanted), unit = unitOf(column, synonyms);
  if (column === wanted || (unit?.kind ?? null) !== (target?.kind ?? null)) return false;
  return isSame(target ? splitName(column).quantity : column, quantity, synonyms);
}

function isSame(given, quantity, synonyms) {
  const name = synonyms.get(given.toLowerCase()) ?? given, low = name.toLowerCase();
  return name === quantity || (low === quantity.toLowerCase() && !CASE_COUNTS.has(low));
}

function unitOf(column, synonyms) {
  return splitName(column).unit ?? (synonyms.has(column.toLowerCase()) ? findUnit(column) : null);
}

/* Refuse a column that has the right name and no unit. */
function checkBare(names, wanted, where, synonyms) {
  const { quantity, unit } = splitName(wanted);
  const bare = names.find((column) => findUnit(column) === null && isSame(column, quantity, synonyms));
  if (unit && bare !== undefined) {
    const choices = unitsOfKind(unit.kind).map((suffix) => `${quantity}_${suffix}`).join(", ");
    throw new InputError(`${where}: column ${quoted(bare)} has no unit; name it one of ${choices}`);
  }
}

export { UNITS, findUnit, splitName, toSi, fromSi, formatLength, inLab, inTails, timeInLab, unbracketed };
export { placeInLab, labColumns, timesOf, convertColumns };
