/* What the plan says, in words and numbers. */

import { byId, describe, element } from "./dom.js";
import { degrees, digits, duration, length } from "./words.js";

/* The sentence that a screen reader is told when a plan is finished. */
function summary(plan) {
  const time = duration(plan.seconds);
  const within = (size) => `95 of 100 such robots stay within ${length(size)} of the path to follow`;
  const exact = plan.calibrated ? "" : "if the coefficients are exact, ";
  const guessed = plan.unmeasured === null ? "" : ` With coefficients of another robot: ${length(plan.unmeasured)}.`;
  return `${time}, ${plan.dwells.length} dwells: ${exact}${within(plan.stated)}.${guessed}`;
}

/* Show the numbers of a plan; with `tails` also in tail lengths and time units. */
function showResults(plan, tails) {
  const size = (value) => length(value, plan.tailLength, tails);
  const time = (value) => duration(value) + (tails ? ` (${digits(value / plan.timeScale)} time units)` : "");
  const [x, y, heading] = plan.start;
  const pairs = [
    ["Start pose", `x ${digits(x)} cm, y ${digits(y)} cm, heading ${degrees(heading)} degrees, at rest`],
    ["Time", `${time(plan.seconds)}, ${plan.dwells.length} dwells`],
    ["Net speed along a straight path", `${digits(60 * plan.netSpeed)} cm/min`],
    ["Shortest dwell", time(plan.minimumDwell)],
    ["Predicted error", `${size(plan.predictedRms)} rms, ${size(plan.predictedMax)} at most`],
    [`Stated error${plan.calibrated ? "" : " if the coefficients are exact"}`, size(plan.stated)],
    ...(plan.unmeasured === null ? [] : [["With coefficients of another robot", size(plan.unmeasured)]]),
    ["With a tracker and a camera", size(plan.feedback)],
    ["Path to follow from the drawn one", `${size(plan.offDrawn)} at most`],
    ["Drawn points from the path to follow", `${size(plan.missed)} at most`],
  ];
  if (plan.guaranteed !== null) pairs.push(["Bound for an exact vehicle", size(plan.guaranteed)]);
  describe(byId("facts"), pairs);
  byId("warnings").replaceChildren(...plan.warnings.map((words) => element("li", {}, words)));
}

export { showResults, summary };
