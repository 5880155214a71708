/* What the plan says, in words and numbers. */

import { byId, describe, element } from "./dom.js";
import { degrees, digits, duration, length } from "./words.js";

/* The sentence that a screen reader is told when a plan is finished. */
function summary(plan) {
  const time = duration(plan.seconds);
  const stated = length(plan.stated);
  return `${time}, ${plan.dwells.length} dwells. 95 of 100 such robots stay within ${stated} of the path to follow.`;
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
    ["Stated error, without feedback", size(plan.stated)],
    ["With a camera every 20 flips", size(plan.feedback)],
    ["Path to follow from the drawn one", `${size(plan.offDrawn)} at most`],
    ["Drawn points from the path to follow", `${size(plan.missed)} at most`],
  ];
  if (plan.guaranteed !== null) pairs.push(["Bound for an exact vehicle", size(plan.guaranteed)]);
  describe(byId("facts"), pairs);
  byId("warnings").replaceChildren(...plan.warnings.map((words) => element("li", {}, words)));
}

export { showResults, summary };
