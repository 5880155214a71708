/* The files of a plan: plan.json, plan.csv, and schedule.h and tracker.h for a microcontroller.
 *
 * Mirrors planner/files/plan_files.py, which explains schedule.h. */
import { differences, linspace, runningSum } from "./arrays.js";
import { fixed, general, roundHalfEven } from "./format.js";
import { InputError } from "./input_error.js";
import { planColumns, planRecord, planSeconds } from "./planned.js";
import { trackerHeader } from "./tracker_header.js";
import { inLab } from "./units.js";

const MOST_MS = 65_535;
const CHECKPOINTS = 32;
const A_LINE = 12; // entries

/* The files by name. parts: {codeVersion, directions, flash, schedule, tracker}, the version of the program, parts
 * of schedule.h that the planner's C code gives, and the template of tracker.h. write_plan_files */
function planFiles(plan, parts) {
  const { id, text } = planRecord(plan, parts.codeVersion);
  return {
    "plan.json": `${text}\n`,
    "plan.csv": planTable(plan, id),
    "schedule.h": controllerHeader(plan, id, parts),
    "tracker.h": trackerHeader(plan, id, safeName(plan.tracked.robot), parts.tracker),
  };
}

/* plan.csv: eight digits, and the identity of the plan in each row. */
function planTable(plan, id) {
  const columns = planColumns(plan), names = Object.keys(columns), { dwells } = plan.switches;
  const written = (name, row) => {
    const value = columns[name][row];
    return name === "direction" ? String(value) : general(value, 8);
  };
  const rows = Array.from(dwells, (_, row) => [...names.map((name) => written(name, row)), id].join(","));
  return `${[[...names, "plan_id"].join(","), ...rows].join("\n")}\n`;
}

/* Round dwells [s] to whole ms, carry rounding errors over, and split long dwells by zeros. */
function milliseconds(seconds) {
  const edges = runningSum(seconds).map((time) => roundHalfEven(1000 * time)), entries = [];
  differences(edges).forEach((length, i) => {
    let count = length;
    if (count < 1) {
      throw new InputError(
        `dwell ${i + 1} is ${general(1000 * seconds[i], 3)} ms; the header counts whole milliseconds: use a ` +
          "longer minimum dwell",
      );
    }
    for (; count > MOST_MS; count -= MOST_MS) entries.push(MOST_MS, 0);
    entries.push(count);
  });
  return entries;
}

/* Write schedule.h as text. */
function controllerHeader(plan, id, { directions, flash, schedule }) {
  const { robot, model } = plan.tracked, seconds = planSeconds(plan), entries = milliseconds(seconds), lines = [];
  for (let i = 0; i < entries.length; i += A_LINE) lines.push(entries.slice(i, i + A_LINE).join(", "));
  const [x, y, heading] = plan.switches.poses[0], cm = 100 * robot.tailLength;
  const places = checkpoints(plan, seconds), total = entries.reduce((some, entry) => some + entry, 0);
  return `/* Plan ${id}.
 * Motor schedule for robot "${safeName(robot)}": turn in FIRST_DIRECTION for the first entry,
 * flip, turn for the next, and so on. Milliseconds; an entry of 0 flips twice at once, which
 * lengthens the dwell before it. Stop after the last entry. Look-up table ${model}.
${statedWithin(plan)}
${directions}
 * Put the head's centre at START_X_CM, START_Y_CM with heading START_HEADING_DEG, at rest: in cm and degrees,
 * counter-clockwise from the x axis, seen from above. START_X and START_Y are the same in tail lengths,
 * START_HEADING in rad. Checkpoints say where it should be later, in tail lengths and rad.
 * C99 or C++11. Include it in one file only, since it holds the tables. */
#ifndef SCHEDULE_H
#define SCHEDULE_H
#include <stdint.h>
#define SCHEDULE_FIRST_DIRECTION (${plan.switches.firstDirection})
#define SCHEDULE_COUNT ${entries.length}
#define SCHEDULE_TOTAL_MS ${total}UL
#define SCHEDULE_MOTOR_RPM ${fixed((robot.motorSpeed * 30) / Math.PI, 3)}
#define SCHEDULE_START_X_CM ${fixed(cm * x, 4)}
#define SCHEDULE_START_Y_CM ${fixed(cm * y, 4)}
#define SCHEDULE_START_HEADING_DEG ${fixed((180 / Math.PI) * heading, 3)}
#define SCHEDULE_START_X ${fixed(x, 6)}
#define SCHEDULE_START_Y ${fixed(y, 6)}
#define SCHEDULE_START_HEADING ${fixed(heading, 6)}
#define SCHEDULE_CHECKPOINTS ${places.length}

${flash}
static const uint16_t SCHEDULE_TABLE(schedule_ms)[SCHEDULE_COUNT] SCHEDULE_FLASH = {
    ${lines.join(",\n    ")}
};
typedef struct { uint32_t ms; float x, y, heading; } schedule_checkpoint;
static const schedule_checkpoint SCHEDULE_TABLE(schedule_checkpoints)[SCHEDULE_CHECKPOINTS] SCHEDULE_FLASH = {
    ${places.join(",\n    ")}
};
${schedule}#endif
`;
}

/* Say how far from the path the robot may get. */
function statedWithin({ tracked: { robot, calibrated }, errors, unmeasured }) {
  const exact = calibrated ? "" : ", if its coefficients are exact";
  const lines = [`Of 100 such robots 95 stay within ${inLab(errors.stated, robot)} of the path${exact}.`];
  if (unmeasured !== null) lines.push(`With the coefficients of another robot it is ${inLab(unmeasured, robot)}.`);
  return lines.map((line) => ` * ${line}`).join("\n");
}

/* Write time in ms and predicted pose of some flips and of the end, as C. */
function checkpoints(plan, seconds) {
  const ends = runningSum(seconds), count = ends.length;
  const places = new Set(Array.from(linspace(0, count - 1, Math.min(count, CHECKPOINTS)), Math.trunc));
  return Array.from(places, (i) => {
    const pose = plan.switches.poses[i].map((value) => `${fixed(value, 5)}f`);
    return `{${roundHalfEven(1000 * ends[i])}UL, ${pose.join(", ")}}`;
  });
}

/* The robot's name without characters that could end a comment in C. */
function safeName({ name }) {
  return Array.from(name).filter((sign) => /[\p{L}\p{N} \-_.]/u.test(sign)).join("");
}

export { planFiles, milliseconds };
