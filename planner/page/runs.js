/* Measured tables, one run a row: which rows cannot be right, runs beside the look-up table's answers, and what is
 * needed.
 *
 * Where a calibration refuses a table for the number of its runs, this reader goes on. Lengths in cm, spins in rpm. */
import { largest, median, smallest, solveDense, sum } from "./math.js";
import { groupValues, makeRobot } from "./robot.js";
import { query } from "./table.js";
import { convertColumns, labColumns, splitName, toSi } from "./units.js";
import { InputError, closeMatch, general, inPage, naming, quoted, refusing } from "./words.js";

const INPUTS = ["N", "l_cm", "omega_rpm"];
const OUTPUTS = { // output: its column, and its sign relative to the motor's (0: a magnitude)
  omega_h: { column: "omega_h_rpm", unit: "rpm", sign: -1, sense: "the head turns against the motor" },
  omega_t: { column: "omega_t_rpm", unit: "rpm", sign: 1, sense: "the tails turn with the motor" },
  omega_yr: {
    column: "omega_yr_rad_s", unit: "rad_s", sign: 1,
    sense: "a positive motor turns the robot to the left (counter-clockwise) seen from above",
  },
  R_yr: { column: "R_yr_cm", unit: "cm", sign: 0 },
  theta: { column: "theta_deg", unit: "deg", sign: 0 },
  v: { column: "v_cm_s", unit: "cm_s", sign: 0 },
};
const PLANAR = ["omega_yr", "R_yr", "theta", "v"]; // outputs beyond the spins
const POSITIVE = ["N", "l_cm", "R_yr_cm", "theta_deg", "v_cm_s"];
const SYNONYMS = new Map(
  Object.entries({
    rpm: "omega", motor: "omega", motor_speed: "omega", length: "l", tail_length: "l", tails: "N",
    heading: "course",
  }),
);
const NOTED = ["elapsed_min", "temperature_C", "tank_diameter_cm", "course_deg"];
const SIGMAS = { // column: its factor to a share or to rad
  camera_scale_sigma_percent: 0.01, heading_zero_sigma_deg: Math.PI / 180, tachometer_sigma_percent: 0.01,
};
const ERRORS = [
  "omega_yr_error", "R_yr_error", "theta_error", "v_error", "drift_x_cm_s", "drift_y_cm_s", "drift_error",
];
const KNOWN = [
  ...INPUTS, ...Object.values(OUTPUTS).map(({ column }) => column), "run", "trial", "session", ...NOTED,
  ...ERRORS, ...Object.keys(SIGMAS),
];
const LARGEST = 1e9; // of a value
const GAPS = 0.1; // share of the usable rows that may lack a note
const OWN = 1e-3; // share of an output's scatter that must be independent of the other outputs
const LARGEST_SIGMA = 0.5;
const FEWEST_RUNS = 24;
const FEWEST_REPEATS = 8;

/* Read the runs of a table {names, columns, texts}. where: its name, for messages.
 *
 * The answer has `outputs` (names), `columns` (numbers of inputs and outputs by their column), `names` (of all
 * columns), `usable` (places of rows), `sessions` (names, of usable runs), `repeats`, `converted` and `excluded`
 * (in words), and `refusal`, why a calibration refuses runs that are enough. */
function readMeasurements(given, where) {
  return naming(where, () => measurementsOf(given, where));
}

function measurementsOf(given, where) {
  const first = convertColumns(given, INPUTS, where, SYNONYMS), outputColumns = Object.values(OUTPUTS);
  const lacking = INPUTS.find((name) => !first.table.names.includes(name));
  if (lacking) throw new InputError(`the table has no column '${lacking}'; it needs ${INPUTS.join(", ")}`);
  const others = [...outputColumns.map(({ column }) => column), ...NOTED, ...Object.keys(SIGMAS)];
  const { table: whole, notes } = convertColumns(first.table, others, where, SYNONYMS);
  const unknown = whole.names.filter((name) => !KNOWN.includes(name));
  for (const name of unknown) {
    const near = closeMatch(name, KNOWN);
    if (near) throw new InputError(`unknown column ${quoted(name)}: is it '${near}'? rename or drop it`);
  }
  const empty = emptyColumns(whole).filter((name) => ![...INPUTS, ...unknown].includes(name));
  const table = without(whole, empty);
  const outputs = Object.keys(OUTPUTS).filter((name) => table.names.includes(OUTPUTS[name].column));
  if (outputs.length < 2 || !outputs.some((name) => PLANAR.includes(name))) {
    throw new InputError(
      "the table needs at least two outputs, one of them omega_yr_rad_s, R_yr_cm, theta_deg or v_cm_s: " +
        "the spins alone do not tell the coefficients apart" +
        (empty.length ? ` (without any value: ${empty.join(", ")})` : ""),
    );
  }
  const column = (name) => table.columns[table.names.indexOf(name)];
  const used = [...INPUTS, ...outputs.map((name) => OUTPUTS[name].column)];
  const columns = Object.fromEntries(used.map((name) => [name, column(name)]));
  const reasons = reasonsOf(table, columns, outputs);
  const sparse = markGaps(reasons, table);
  markCopies(reasons, columns);
  const usable = reasons.flatMap((reason, row) => (reason ? [] : [row]));
  if (!usable.length) {
    const first = `${rowName(table, 0)}: ${reasons[0]}`;
    throw new InputError(`0 usable runs (${first}); a calibration needs at least ${FEWEST_RUNS}`);
  }
  const session = table.texts[table.names.indexOf("session")];
  const names = usable.map((row) => session?.[row] ?? `N = ${columns.N[row]}`);
  const conditions = usable.map((row) => INPUTS.map((name) => columns[name][row]).join());
  const repeats = usable.length - new Set(conditions).size;
  const runs = {
    outputs, columns, usable, repeats, names: table.names, sessions: [...new Set(names)].sort(),
    converted: [...first.notes, ...notes],
    excluded: reasons.flatMap((reason, row) => (reason ? [`${rowName(table, row)}: ${reason}`] : [])),
    refusal: null,
  };
  if (usable.length >= FEWEST_RUNS && repeats >= FEWEST_REPEATS) {
    const { refusal, follows } = independent(runs, conditions);
    runs.excluded.push(...follows);
    runs.refusal = refusal ?? sigmaRefusal(table, usable);
  }
  runs.excluded.push(...empty.map((name) => `column ${name}: without any value, left out`));
  const many = `without a value in more than ${100 * GAPS} % of the rows, left out`;
  runs.excluded.push(...sparse.map((name) => `column ${name}: ${many}`));
  runs.excluded.push(...unknown.map((name) => `column ${name}: not known, left out`));
  return runs;
}

/* Names of columns that have nothing but missing values and blanks. */
function emptyColumns({ names, texts }) {
  return names.filter((_, i) => texts[i].every((text) => text.trim() === "" || text === "nan"));
}

function without({ names, columns, texts, lines }, left) {
  const kept = (values) => values.filter((_, i) => !left.includes(names[i]));
  return { names: kept(names), columns: kept(columns), texts: kept(texts), lines };
}

/* Name a row by its number and by its line in the file. */
function rowName({ lines }, row) {
  return `row ${row + 1} (line ${lines[row]})`;
}

/* Give a reason to every usable row that lacks a note, and return the notes that many rows lack. */
function markGaps(reasons, table) {
  const usable = reasons.flatMap((reason, row) => (reason ? [] : [row]));
  return NOTED.filter((name) => {
    const at = table.names.indexOf(name);
    const gaps = usable.filter((row) => !Number.isFinite(table.columns[at]?.[row]));
    if (at < 0 || gaps.length > GAPS * usable.length) return at >= 0;
    for (const row of gaps) reasons[row] ||= `${name} = ${table.texts[at][row]} is not a finite number`;
    return false;
  });
}

/* Give a reason to every usable row that is a copy of an earlier one. */
function markCopies(reasons, columns) {
  const usable = reasons.flatMap((reason, row) => (reason ? [] : [row]));
  const used = (names) => names.map((name) => usable.map((row) => columns[name][row]));
  const outputs = Object.keys(columns).filter((name) => !INPUTS.includes(name));
  if (!usable.length) return;
  for (const [place, earlier] of findCopies(used(INPUTS), used(outputs))) {
    reasons[usable[place]] =
      `a copy of an earlier row, equal in all inputs and outputs (row ${usable[earlier] + 1})`;
  }
}

/* Say why each row cannot be used; empty where it can. */
function reasonsOf(table, columns, outputs) {
  const count = table.columns[0].length, reasons = Array(count).fill("");
  const known = (value) => (Math.abs(value) < LARGEST ? value : NaN);
  const finite = Object.entries(columns).map(([name, values]) => [name, values.map(known)]);
  const values = Object.fromEntries(finite);
  const mark = (isBad, words) => {
    for (let row = 0; row < count; row++) if (!reasons[row] && isBad(row)) reasons[row] = words(row);
  };
  const text = (name, row) => `${name} = ${table.texts[table.names.indexOf(name)][row]}`;
  for (const [name, numbers] of finite) {
    mark((row) => Number.isNaN(numbers[row]), (row) => `${text(name, row)} is not a finite number`);
  }
  mark((row) => values.N[row] % 1 !== 0, (row) => `${text("N", row)} is not a whole number`);
  for (const name of POSITIVE.filter((each) => each in values)) {
    mark((row) => values[name][row] <= 0, (row) => `${text(name, row)} is not above 0`);
  }
  mark((row) => values.omega_rpm[row] === 0, () => "omega_rpm = 0");
  for (const { column, sign, sense } of outputs.map((name) => OUTPUTS[name])) {
    if (!sign) continue;
    mark(
      (row) => values[column][row] * Math.sign(values.omega_rpm[row]) * sign <= 0,
      (row) => `${column} = ${general(values[column][row])} has the wrong sign for its omega_rpm: ${sense}`,
    );
  }
  return reasons;
}

/* Choose outputs that were measured: repeats differ, and not just as other outputs do. */
function independent({ outputs, columns, usable }, conditions) {
  const y = outputs.map((name) => {
    const { column, unit } = OUTPUTS[name], factor = toSi(1, unit);
    return usable.map((row) => {
      const value = columns[column][row] * factor;
      return name === "theta" ? value : Math.log(Math.abs(value));
    });
  });
  const run = repeatCovariance(y, conditions), kept = [], follows = [];
  for (const [i, name] of outputs.entries()) {
    const { column } = OUTPUTS[name];
    if (!(run[i][i] > 1e-12)) {
      const words = `${column} does not differ between repeats; give measured values, unrounded, or leave it out`;
      return { refusal: words, follows: [] };
    }
    if (run[i][i] - explained(run, kept, i) < OWN * run[i][i]) {
      const others = kept.map((j) => OUTPUTS[outputs[j]].column).join(", ");
      follows.push(`column ${column}: follows from ${others}, so it is not counted twice`);
    } else kept.push(i);
  }
  return { refusal: null, follows };
}

/* The part of the variance of output i that other outputs explain. */
function explained(run, others, i) {
  if (!others.length) return 0;
  const weights = others.map((j) => [run[j][i]]);
  solveDense(others.map((j) => others.map((k) => run[j][k])), weights);
  return sum(others.map((j, k) => run[i][j] * weights[k][0]));
}

/* Estimate the covariance of outputs from their scatter about the mean of each condition. */
function repeatCovariance(y, conditions) {
  const away = y.map((values) => centred(values, conditions)), free = conditions.length - new Set(conditions).size;
  return away.map((a) => away.map((b) => sum(a.map((value, i) => value * b[i])) / free));
}

/* Subtract from values the mean of those of the same condition. */
function centred(values, conditions) {
  const totals = new Map(), add = ([count, total], value) => [count + 1, total + value];
  conditions.forEach((name, i) => totals.set(name, add(totals.get(name) ?? [0, 0], values[i])));
  return values.map((value, i) => value - totals.get(conditions[i])[1] / totals.get(conditions[i])[0]);
}

/* Say which standard deviation of the way of measuring a calibration refuses; null: none. */
function sigmaRefusal(table, usable) {
  const bad = Object.entries(SIGMAS).find(([name, factor]) => {
    if (!table.names.includes(name)) return false;
    const values = new Set(usable.map((row) => table.columns[table.names.indexOf(name)][row])), [value] = values;
    return values.size !== 1 || !(0 <= value * factor && value * factor <= LARGEST_SIGMA);
  });
  return bad ? `${bad[0]} must be one number, the same in all rows, at least 0 and not large` : null;
}

/* Whether columns of these names are those of runs, if not of all that a table of runs needs. */
function areOfRuns(names) {
  const wanted = [...INPUTS, ...Object.values(OUTPUTS).map(({ column }) => column)];
  const quantities = new Set(wanted.map((name) => splitName(name).quantity.toLowerCase()));
  return names.some((name) => {
    const quantity = splitName(name).quantity.toLowerCase();
    return quantities.has(quantity) || (SYNONYMS.has(quantity) && quantity !== "heading");
  });
}

const CHANCE = 0.01; // equal pairs that are expected by chance
const ROUNDING = 1e-9; // relative difference below which two numbers are one
const TYPICAL = 0.01; // relative standard deviation where no repeats but copies are left

/* Find copied rows: pairs of a place and the place of the row that it repeats.
 *
 * inputs, outputs: lists of columns. */
function findCopies(inputs, outputs) {
  const count = inputs[0].length, first = new Map(), copies = new Map();
  const words = (columns, place) => columns.map((column) => column[place]).join();
  for (let place = 0; place < count; place++) {
    const row = words([...inputs, ...outputs], place);
    if (first.has(row)) copies.set(place, first.get(row));
    else first.set(row, place);
  }
  if (!copies.size) return [];
  const condition = Array.from({ length: count }, (_, place) => words(inputs, place));
  const seen = new Map(), pairs = sum(condition.map((name) => {
    seen.set(name, (seen.get(name) ?? 0) + 1);
    return seen.get(name) - 1;
  }));
  const kept = condition.map((_, place) => place).filter((place) => !copies.has(place));
  const places = kept.map((place) => condition[place]);
  const chances = outputs.map((column) => equal(kept.map((place) => column[place]), places));
  return pairs * chances.reduce((product, chance) => product * chance, 1) < CHANCE ? [...copies] : [];
}

/* Estimate the probability that two repeats of an output are equal. */
function equal(values, condition) {
  const distinct = [...new Set(values)].sort((a, b) => a - b);
  const gaps = distinct.slice(1).flatMap((value, i) => {
    const gap = value - distinct[i];
    return gap > ROUNDING * Math.abs(value) ? [gap] : [];
  });
  if (!gaps.length) return 1;
  const [[variance]] = repeatCovariance([values], condition); // NaN without repeats
  const scatter = variance >= 0 ? Math.sqrt(variance) : TYPICAL * median(values.map(Math.abs));
  return scatter ? Math.min(1, smallest(gaps) / (2 * Math.sqrt(Math.PI) * scatter)) : 1;
}

const FEWEST_SESSIONS = 3;
const SAME_SPEED = 0.01; // share of a motor speed below which speeds are one
const MOST_RUNS = 1000; // that are compared
const USES = { // columns that may be left out, and what they are good for
  session: "tells differences between sessions from noise; without it all runs of one N are one session",
  elapsed_min: "tests a drift of the viscosity",
  temperature_C: "tests a drift of the viscosity",
  tank_diameter_cm: "tests the wall of the tank",
  course_deg: "tests a current, where runs cover a part of a circle",
};

/* Compare runs with a look-up table.
 *
 * table: {names, columns, texts} of the file. name: of the file. fields: the robot, of which the table of runs
 * replaces tails, tail length and motor speed. lookup: as readTable gives it; null: there is none.
 * The answer has `columns` (names of the outputs' columns), `rows` ({row, inputs, measured, answer, percent,
 * outside}: of usable runs, answer null and outside in words where the look-up table has none), `medians` of the
 * differences in per cent, and lists in words: `excluded`, `converted`, `missing`, `needed`, `refused`. */
function comparedRuns(table, name, fields, lookup) {
  if (!lookup) {
    throw new InputError(
      "runs can only be compared with the trained look-up table, and this page has the vehicle of one robot alone",
    );
  }
  const runs = readMeasurements(table, name), columns = runs.outputs.map((output) => OUTPUTS[output].column);
  const rows = runs.usable.slice(0, MOST_RUNS).map((row) => {
    const inputs = INPUTS.map((column) => runs.columns[column][row]);
    const measured = columns.map((column) => runs.columns[column][row]);
    const { answer, outside } = answerTo(inputs, fields, lookup);
    const values = answer && columns.map((column) => answer[column]);
    const percent = values && measured.map((value, i) => 100 * (value / values[i] - 1));
    return { row: row + 1, inputs, measured, answer: values, percent, outside };
  });
  const answered = rows.filter(({ percent }) => percent);
  return {
    columns,
    rows,
    left: runs.usable.length - rows.length,
    medians: answered.length ? columns.map((_, i) => median(answered.map(({ percent }) => percent[i]))) : null,
    excluded: runs.excluded,
    converted: runs.converted,
    missing: missingColumns(runs),
    needed: neededRuns(runs),
    refused: runs.refusal,
  };
}

/* The look-up table's answer to a run [N, l_cm, omega_rpm], or why there is none. */
function answerTo([tails, length, speed], fields, lookup) {
  const answered = () => {
    const motorSpeed = toSi(Math.abs(speed), "rpm");
    const robot = makeRobot({ ...fields, tails, tailLength: toSi(length, "cm"), motorSpeed });
    const groups = groupValues(robot);
    const motion = query(lookup, { ...groups, omega_bar: Math.sign(speed) * groups.omega_bar });
    return { answer: labColumns(motion, length, robot.timeScale), outside: "" };
  };
  return refusing(answered, ({ message }) => ({ answer: null, outside: inPage(message, fields) }));
}

/* Columns that the table of runs lacks, and what they would be good for. */
function missingColumns({ names, outputs }) {
  const unmeasured = Object.keys(OUTPUTS).filter((output) => !outputs.includes(output));
  const missing = unmeasured.map((output) => `${OUTPUTS[output].column}: one more measured quantity`);
  for (const name of ["session", ...NOTED]) if (!names.includes(name)) missing.push(`${name}: ${USES[name]}`);
  return missing;
}

/* Runs that are still needed; the more, the further from the rules. */
function neededRuns({ columns, usable, repeats, sessions }) {
  const needed = [], column = (name) => usable.map((row) => columns[name][row]);
  if (usable.length < FEWEST_RUNS) {
    const more = FEWEST_RUNS - usable.length;
    needed.push(`${more} more: the table has ${usable.length} usable runs, and a calibration needs ${FEWEST_RUNS}`);
  }
  const [tails, lengths, speeds] = INPUTS.map(column), sizes = speeds.map(Math.abs);
  if (isOne(tails)) needed.push(`runs with another N: all have N = ${tails[0]}`);
  if (isOne(lengths)) needed.push(`runs with another tail length: all have l = ${lengths[0]} cm`);
  if (largest(sizes) - smallest(sizes) < SAME_SPEED * largest(sizes)) {
    needed.push(`runs at another motor speed: all are at ${sizes[0]} rpm`);
  }
  const forward = speeds.some((speed) => speed > 0), backward = speeds.some((speed) => speed < 0);
  if (!(forward && backward)) {
    needed.push(`runs with the motor reversed: all have a ${forward ? "positive" : "negative"} omega_rpm`);
  }
  if (repeats < FEWEST_REPEATS) {
    const more = FEWEST_REPEATS - repeats;
    needed.push(
      `${more} more repeated under equal conditions: the table has ${repeats}, and the noise is estimated from ` +
        `${FEWEST_REPEATS}`,
    );
  }
  if (sessions.length < FEWEST_SESSIONS) {
    const more = FEWEST_SESSIONS - sessions.length, word = more === 1 ? "session" : "sessions";
    needed.push(
      `${more} more ${word}: the table has ${sessions.length}, and with fewer than ${FEWEST_SESSIONS} the ` +
        "verdict is weaker",
    );
  }
  return needed;
}

function isOne(values) {
  return largest(values) === smallest(values);
}

export { findCopies, readMeasurements, areOfRuns, comparedRuns };
