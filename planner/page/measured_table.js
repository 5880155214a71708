/* Measured tables: one run a row, units in the column names.
 *
 * Mirrors calibration/swimmer/measured_table.py, which explains the columns. Where Python refuses a table for the
 * number of its runs, this reader goes on, since it tells what is still needed. */
import { closeMatch } from "./close_match.js";
import { findCopies } from "./copied_rows.js";
import { solveDense } from "./dense.js";
import { general, pythonText } from "./format.js";
import { InputError } from "./input_error.js";
import { convertColumns } from "./quantities.js";
import { splitName, toSi } from "./si_units.js";

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
  try {
    return measurementsOf(given, where);
  } catch (refusal) {
    if (!(refusal instanceof InputError) || refusal.message.includes(where)) throw refusal;
    throw new InputError(`${where}: ${refusal.message}`);
  }
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
    if (near) throw new InputError(`unknown column ${pythonText(name)}: is it '${near}'? rename or drop it`);
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
  const names = usable.map((row) =>
    table.names.includes("session")
      ? table.texts[table.names.indexOf("session")][row]
      : `N = ${columns.N[row]}`,
  );
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

/* Names of columns that have nothing but missing values and blanks. _is_empty */
function emptyColumns({ names, texts }) {
  return names.filter((_, i) => texts[i].every((text) => text.trim() === "" || text === "nan"));
}

function without({ names, columns, texts, lines }, left) {
  const kept = names.flatMap((name, i) => (left.includes(name) ? [] : [i]));
  return {
    names: kept.map((i) => names[i]),
    columns: kept.map((i) => columns[i]),
    texts: kept.map((i) => texts[i]),
    lines,
  };
}

/* Name a row by its number and by its line in the file. row_name */
function rowName({ lines }, row) {
  return `row ${row + 1} (line ${lines[row]})`;
}

/* Give a reason to every usable row that lacks a note, and return the notes that many rows lack. _mark_gaps */
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

/* Give a reason to every usable row that is a copy of an earlier one. _mark_copies */
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

/* Say why each row cannot be used; empty where it can. _reasons */
function reasonsOf(table, columns, outputs) {
  const count = table.columns[0].length, reasons = Array(count).fill("");
  const finite = Object.entries(columns).map(([name, values]) => [
    name, values.map((value) => (Math.abs(value) < LARGEST ? value : NaN)),
  ]);
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

/* Choose outputs that were measured: repeats differ, and not just as other outputs do. _independent */
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
      const refusal =
        `${column} does not differ between repeats; give measured values, unrounded, or leave it out`;
      return { refusal, follows: [] };
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
  return others.reduce((total, j, k) => total + run[i][j] * weights[k][0], 0);
}

/* Estimate the covariance of outputs from their scatter about the mean of each condition.
 *
 * Mirrors `repeat_covariance` of calibration/statistics/statistical_model.py. */
function repeatCovariance(y, conditions) {
  const places = new Map();
  conditions.forEach((words, i) => places.set(words, [...(places.get(words) ?? []), i]));
  const centred = y.map((values) => {
    const away = [...values];
    for (const rows of places.values()) {
      const middle = rows.reduce((total, i) => total + values[i], 0) / rows.length;
      for (const i of rows) away[i] -= middle;
    }
    return away;
  });
  const free = conditions.length - places.size;
  return centred.map((a) => centred.map((b) => a.reduce((total, value, i) => total + value * b[i], 0) / free));
}

/* Say which standard deviation of the way of measuring a calibration refuses; null: none. _sigmas */
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

export { FEWEST_REPEATS, FEWEST_RUNS, INPUTS, NOTED, OUTPUTS, areOfRuns, readMeasurements };
