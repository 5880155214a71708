/* What was measured: tracks beside the plan, and tables of runs, one run a row, beside the look-up table's answers.
 *
 * The error of a track is the distance of the tracked point from the declared path, weighted by time; tracks are in cm
 * and s. Of runs it is said which rows cannot be right, and what is needed; where a calibration refuses a table for the
 * number of its runs, this reader goes on; copied rows, gaps of the notes and outputs that follow from others are left
 * to the calibration. Lengths in cm, spins in rpm. */
import { CONSTANTS } from "./constants.js";
import { largest, median, smallest, sum } from "./math.js";
import { distanceTo } from "./reference.js";
import { groupValues, makeRobot } from "./robot.js";
import { query } from "./table.js";
import { convertColumns, labColumns, splitName, toSi } from "./units.js";
import { InputError, closeMatch, general, inPage, naming, quoted, refusing, repr } from "./words.js";

const { RUN: INPUTS, MEASURED: OUTPUTS, RUN_SYNONYMS, RUN_NOTES, RUN_SIGMAS, RUN_COLUMNS } = CONSTANTS.run_columns;
const PLANAR = ["omega_yr", "R_yr", "theta", "v"]; // outputs beyond the spins
const POSITIVE = ["N", "l_cm", "R_yr_cm", "theta_deg", "v_cm_s"];
const SYNONYMS = new Map(Object.entries(RUN_SYNONYMS));
const MEASURED = Object.values(OUTPUTS).map(({ column }) => column);
const LARGEST = 1e9; // of a value
const LISTED = 3; // rows without an output
const FEWEST_RUNS = 24;
const FEWEST_REPEATS = 8;

/* Read the runs of a table {names, columns, texts}. where: its name, for messages.
 *
 * The answer has `outputs` (names), `columns` (numbers of inputs and outputs by their column), `names` (of all
 * columns), `usable` (places of rows), `sessions` (names, of usable runs), `repeats`, `converted` and `excluded`
 * (in words). */
function readMeasurements(given, where) {
  return naming(where, () => measurementsOf(given, where));
}

function measurementsOf(given, where) {
  const first = convertColumns(given, INPUTS, where, SYNONYMS);
  const lacking = INPUTS.find((name) => !first.table.names.includes(name));
  if (lacking) throw new InputError(`the table has no column '${lacking}'; it needs ${INPUTS.join(", ")}`);
  const others = [...MEASURED, ...RUN_NOTES, ...RUN_SIGMAS];
  const { table: whole, notes } = convertColumns(first.table, others, where, SYNONYMS);
  const unknown = whole.names.filter((name) => !RUN_COLUMNS.includes(name));
  for (const name of unknown) {
    const near = closeMatch(name, RUN_COLUMNS.filter((column) => !whole.names.includes(column)));
    if (near) throw new InputError(`unknown column ${quoted(name)}: is it '${near}'? rename or drop it`);
  }
  const hasNone = (i) => whole.texts[i].every(isGap);
  const empty = whole.names.filter((name, i) => hasNone(i) && ![...INPUTS, ...unknown].includes(name));
  const kept = (values) => values.filter((_, i) => !empty.includes(whole.names[i]));
  const table = { names: kept(whole.names), columns: kept(whole.columns), texts: kept(whole.texts), lines: whole.lines };
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
  const usable = reasons.flatMap((reason, row) => (reason ? [] : [row]));
  if (!usable.length) {
    const first = `${rowName(table, 0)}: ${reasons[0]}`;
    throw new InputError(`0 usable runs (${first}); a calibration needs at least ${FEWEST_RUNS}`);
  }
  const [session, robot] = ["session", "robot"].map((name) => table.texts[table.names.indexOf(name)]);
  const names = usable.map((row) => session?.[row] ?? `N = ${columns.N[row]}`);
  const conditions = usable.map((row) => [...INPUTS.map((name) => columns[name][row]), robot?.[row]].join());
  const repeats = usable.length - new Set(conditions).size;
  const excluded = [
    ...reasons.flatMap((reason, row) => (reason ? [`${rowName(table, row)}: ${reason}`] : [])),
    ...outputs.flatMap((name) => gapsInWords(table, OUTPUTS[name].column, usable)),
    ...empty.map((name) => `column ${name}: without any value, left out`),
    ...unknown.map((name) => `column ${name}: not known, left out`),
  ];
  return {
    outputs, columns, usable, repeats, names: table.names, sessions: [...new Set(names)].sort(),
    converted: [...first.notes, ...notes], excluded,
  };
}

function isGap(text) {
  return ["", "nan"].includes(text.trim());
}

/* Name the usable rows that lack an output, in a line at most. */
function gapsInWords(table, column, usable) {
  const texts = table.texts[table.names.indexOf(column)];
  const rows = usable.filter((row) => isGap(texts[row])).map((row) => rowName(table, row));
  if (!rows.length) return [];
  const more = rows.length > LISTED ? ` and ${rows.length - LISTED} more` : "";
  return [`column ${column}: no value in ${rows.slice(0, LISTED).join(", ")}${more}; the other outputs there count`];
}

/* Name a row by its number and by its line in the file. */
function rowName({ lines }, row) {
  return `row ${row + 1} (line ${lines[row]})`;
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
  const given = (name, row) => table.texts[table.names.indexOf(name)][row];
  const text = (name, row) => `${name} = ${given(name, row)}`;
  const missing = (name, row) => isGap(given(name, row)), measured = outputs.map((name) => OUTPUTS[name].column);
  mark((row) => Object.keys(columns).every((name) => given(name, row).trim() === name), () => "the header again");
  mark((row) => measured.every((name) => missing(name, row)), () => "no output has a value");
  for (const [name, numbers] of finite) {
    mark(
      (row) => Number.isNaN(numbers[row]) && !(measured.includes(name) && missing(name, row)),
      (row) => (missing(name, row) ? `${name} has no value` : `${text(name, row)} is not a finite number`),
    );
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

/* Whether columns of these names are those of runs, if not of all that a table of runs needs. */
function areOfRuns(names) {
  const quantities = new Set([...INPUTS, ...MEASURED].map((name) => splitName(name).quantity.toLowerCase()));
  return names.some((name) => {
    const quantity = splitName(name).quantity.toLowerCase();
    return quantities.has(quantity) || (SYNONYMS.has(quantity) && quantity !== "heading");
  });
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
 * differences in per cent, and lists in words: `excluded`, `converted`, `missing`, `needed`. */
function comparedRuns(table, name, fields, lookup) {
  if (!lookup) {
    throw new InputError(
      "runs can only be compared with the trained look-up table, and this page has one vehicle alone",
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
    medians: answered.length ? columns.map((_, i) => median(answered.map(({ percent }) => percent[i]).filter(Number.isFinite))) : null,
    excluded: runs.excluded,
    converted: runs.converted,
    missing: missingColumns(runs),
    needed: neededRuns(runs),
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
  for (const name of ["session", ...RUN_NOTES]) if (!names.includes(name)) missing.push(`${name}: ${USES[name]}`);
  return missing;
}

/* Runs that are still needed; the more, the further from the rules. */
function neededRuns({ columns, usable, repeats, sessions }) {
  const [tails, lengths, speeds] = INPUTS.map((name) => usable.map((row) => columns[name][row]));
  const spread = (values) => largest(values) - smallest(values), sizes = speeds.map(Math.abs);
  const more = (count, fewest, words, why) => [count < fewest, `${fewest - count} more${words}: the table has ${count}${why}`];
  const isLast = sessions.length === FEWEST_SESSIONS - 1, sign = speeds[0] > 0 ? "positive" : "negative";
  const needed = [
    more(usable.length, FEWEST_RUNS, "", ` usable runs, and a calibration needs ${FEWEST_RUNS}`),
    [spread(tails) === 0, `runs with another N: all have N = ${tails[0]}`],
    [spread(lengths) === 0, `runs with another tail length: all have l = ${lengths[0]} cm`],
    [spread(sizes) < SAME_SPEED * largest(sizes), `runs at another motor speed: all are at ${sizes[0]} rpm`],
    [spread(speeds.map(Math.sign)) === 0, `runs with the motor reversed: all have a ${sign} omega_rpm`],
    more(repeats, FEWEST_REPEATS, " repeated under equal conditions", `, and the noise is estimated from ${FEWEST_REPEATS}`),
    more(sessions.length, FEWEST_SESSIONS, isLast ? " session" : " sessions",
      `, and with fewer than ${FEWEST_SESSIONS} the verdict is weaker`),
  ];
  return needed.flatMap(([isLacking, words]) => (isLacking ? [words] : []));
}

const FARTHEST = 1e6; // l, of a place; time units, of a time
const COLUMNS = ["time_bar", "x_over_l", "y_over_l", "heading_rad"];
const LAB = ["time_s", "x_cm", "y_cm", "heading_deg"]; // or in other units
const ALIKE = 1e-3; // of a place and of the tail length, largest difference of the same place in cm and in l
const HOW = { none: "", time: "its first time is 0", rigid: "its first pose is that of the plan, its first time 0" };

/* Compare a track with a plan, as measured ("none"), from time 0 ("time"), or laid on the plan's start ("rigid").
 *
 * plan: content of plan.json. table: {names, columns} of the head's centre, as replays or labs have them, and
 * `plans`, the ids in it. */
function comparedTrack(plan, table, how) {
  const [other] = (table.plans ?? []).filter((id) => id !== plan.id).sort();
  if (other !== undefined) {
    throw new InputError(`the track is of plan ${other}, not of ${plan.id}; compare it with its own plan.json`);
  }
  const moved = movedTrack(columnsInTails(table, plan.robot), plan, how), [time, x, y, heading] = moved;
  checkTrack(moved);
  const { tail_length_m: tail, time_scale_s: second } = plan.robot, cm = 100 * tail, offset = plan.offset_over_l ?? 0;
  const track = Array.from(x, (value, i) => [
    value + Math.cos(heading[i]) * offset, y[i] + Math.sin(heading[i]) * offset,
  ]);
  const declared = distanceTo(plan.reference, track), raw = distanceTo(plan.raw_path, track), last = x.length - 1;
  const weights = time.map((_, i) => {
    const early = time[Math.max(i - 1, 0)], late = time[Math.min(i + 1, last)];
    return Math.max((late - early) / (i > 0 && i < last ? 2 : 1), 0);
  });
  const total = Math.max(sum(weights), 1e-300);
  const rms = (away) => cm * Math.sqrt(sum(away.map((value, i) => (weights[i] / total) * value ** 2)));
  const worst = declared.indexOf(largest(declared)), place = ([atX, atY]) => [atX * cm, atY * cm];
  return {
    points: track.map(place),
    shift: HOW[how],
    csv: trackTable(moved, cm, second),
    error: {
      rms: rms(declared), largest: cm * largest(declared), rawRms: rms(raw), rawLargest: cm * largest(raw),
      stated: cm * plan.stated_error_over_l,
      times: Array.from(time, (value) => value * second),
      distances: Array.from(declared, (value) => value * cm),
      worst: { time: time[worst] * second, place: place(track[worst]) },
    },
  };
}

function checkTrack([time, ...others]) {
  const bad = time.findIndex((_, row) => ![time, ...others].every((values) => Math.abs(values[row]) < FARTHEST));
  if (bad >= 0) {
    throw new InputError(`row ${bad + 1} of the track has a value that is not a finite number; correct the file`);
  }
  if (time.length < 2 || !(largest(time) - smallest(time) > 0)) {
    throw new InputError("the track has no two times; give a row for each time, in order");
  }
  const back = time.findIndex((value, i) => i > 0 && value < time[i - 1]);
  if (back < 0) return;
  throw new InputError(`the track's time goes back at row ${back + 1}; give a row for each time, in order`);
}

/* Time, x, y and heading in the units of a replay. */
function columnsInTails(table, robot) {
  const replayed = COLUMNS.every((name) => table.names.includes(name)), cm = 100 * robot.tail_length_m;
  const kept = (values) => values.filter((_, i) => !replayed || !COLUMNS.includes(table.names[i]));
  const lab = convertColumns({ names: kept(table.names), columns: kept(table.columns) }, LAB, "the track").table;
  const inLab = (name) => lab.columns[lab.names.indexOf(name)];
  if (replayed) {
    const [time, ...pose] = COLUMNS.map((name) => table.columns[table.names.indexOf(name)]);
    for (const [i, axis] of ["x", "y"].entries()) {
      const inCm = inLab(`${axis}_cm`);
      if (inCm && !pose[i].every((value, k) => Math.abs(value * cm - inCm[k]) <= ALIKE * (cm + Math.abs(inCm[k])))) {
        throw new InputError(
          `${axis}_over_l and ${axis}_cm of the track disagree with the plan's tail length, ${general(cm)} cm: it is the `
          + "track of another robot",
        );
      }
    }
    return [time, ...pose];
  }
  const missing = LAB.find((name) => !lab.names.includes(name));
  if (missing) {
    throw new InputError(
      `the track has no column '${missing}'; it needs time_s, x_cm, y_cm and heading_deg, or in other units`,
    );
  }
  const scales = [robot.time_scale_s, cm, cm, 180 / Math.PI];
  return LAB.map((name, i) => inLab(name).map((value) => value / scales[i]));
}

/* Move a track in time; with "rigid" in the plane, too, so that it begins with the pose of the plan. */
function movedTrack([time, x, y, heading], plan, how) {
  if (!(how in HOW)) throw new InputError(`a track cannot be moved by ${how}`);
  if (how === "none") return [time, x, y, heading];
  const times = time.map((value) => value - time[0]);
  if (how === "time") return [times, x, y, heading];
  const { x_over_l: startX, y_over_l: startY, heading_rad: start } = plan.start, turn = start - heading[0];
  const cos = Math.cos(turn), sin = Math.sin(turn);
  return [
    times,
    x.map((value, i) => startX + cos * (value - x[0]) - sin * (y[i] - y[0])),
    x.map((value, i) => startY + sin * (value - x[0]) + cos * (y[i] - y[0])),
    heading.map((value) => value + turn),
  ];
}

/* The track in the columns that `softflagella check` reads. */
function trackTable([time, x, y, heading], cm, second) {
  const rows = Array.from(time, (value, i) => {
    return [value * second, x[i] * cm, y[i] * cm, (heading[i] * 180) / Math.PI].map(repr).join(",");
  });
  return `time_s,x_cm,y_cm,heading_deg\n${rows.join("\n")}\n`;
}

export { readMeasurements, areOfRuns, comparedRuns, comparedTrack };
