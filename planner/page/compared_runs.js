/* Measured runs beside the look-up table's answers, what the table of runs lacks, and which runs are still needed.
 *
 * Lengths in cm, spins in rpm, as in the table of runs. The rules for the runs are those of
 * docs/howto/tank.md. */
import { inPage } from "./advice.js";
import { largest, median, smallest } from "./arrays.js";
import { InputError } from "./input_error.js";
import { labColumns } from "./lab_units.js";
import { OutsideError, query } from "./lookup.js";
import { FEWEST_REPEATS, FEWEST_RUNS, INPUTS, NOTED, OUTPUTS, readMeasurements } from "./measured_table.js";
import { groupValues, makeRobot } from "./robot.js";
import { toSi } from "./si_units.js";

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
  try {
    const motorSpeed = toSi(Math.abs(speed), "rpm");
    const robot = makeRobot({ ...fields, tails, tailLength: toSi(length, "cm"), motorSpeed });
    const groups = groupValues(robot), omegaBar = Math.sign(speed) * groups.omega_bar;
    const motion = query(lookup, { ...groups, omega_bar: omegaBar });
    return { answer: labColumns(motion, length, robot.timeScale), outside: "" };
  } catch (refusal) {
    if (!(refusal instanceof InputError)) throw refusal;
    const outside = refusal instanceof OutsideError ? refusal.reason : inPage(refusal.message, fields);
    return { answer: null, outside };
  }
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
    needed.push(
      `${more} more: the table has ${usable.length} usable runs, and a calibration needs ${FEWEST_RUNS}`,
    );
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

export { comparedRuns };
