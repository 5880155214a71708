/* The robot's fields: a number and a slider for each, in laboratory units. */

import { byId, describe, element, say } from "./dom.js";
import { FIELDS } from "./state.js";
import { degrees, digits, length } from "./words.js";

class RobotForm {
  /* `limits` has the slider's ends of each field; `changed(values, key)` takes new values, `settled()` the end. */
  constructor(limits, changed, settled) {
    this.changed = changed;
    this.settled = settled;
    this.inputs = new Map();
    for (const field of FIELDS)
      byId(field.first ? "first-fields" : "more-fields").append(this.field(field, limits[field.key]));
  }

  field({ key, words, unit, step, optional }, [low, high]) {
    const name = unit ? `${words} in ${unit}` : words;
    const common = { "aria-describedby": "robot-problem" };
    const set = (event) => this.set(key, event.target.value, optional);
    const number = element("input", {
      type: "number", step: "any", input: set, change: this.settled, "aria-label": name, ...common,
    });
    const slider = element("input", {
      type: "range", min: low, max: high, step, input: set, change: this.settled, "aria-label": `${name}, slider`,
    });
    this.inputs.set(key, [number, slider]);
    return element(
      "div",
      {},
      element(
        "label", {}, words,
        element("span", { class: "field" }, number, element("span", { "aria-hidden": "true" }, unit), slider),
      ),
    );
  }

  set(key, text, optional) {
    const value = text.trim() === "" ? null : Number(text);
    if (value === null && !optional) return;
    this.values = { ...this.values, [key]: value };
    this.changed(this.values, key);
  }

  /* Show values; the field in which somebody types keeps its text. */
  show(values) {
    this.values = values;
    for (const [key, inputs] of this.inputs) {
      for (const input of inputs)
        if (input !== document.activeElement || input.type === "range") input.value = sixDigits(values[key]);
    }
  }
}

/* What a field shows of a value; the plan has all its digits. */
function sixDigits(value) {
  return value === null || value === undefined ? "" : Number(value.toPrecision(6));
}

/* Show the motion of the robot [cm, s, rad], or why there is none. */
function showMotion(answer) {
  say(byId("robot-problem"), answer.refusal ?? "", true);
  if (answer.refusal) {
    byId("motion").replaceChildren();
    return;
  }
  const { turnRadius, slip, yawRate, speed, tailGap, omegaBar } = answer.answer;
  describe(byId("motion"), [
    ["Turn radius", length(turnRadius)], ["Yaw rate", `${digits(yawRate)} rad/s`],
    ["Speed round the circle", `${digits(60 * speed)} cm/min`], ["Slip angle", `${degrees(slip)} degrees`],
    ["Gap of the tails", `${digits(tailGap)} tail diameters`], ["Motor speed ω̄", digits(omegaBar)],
  ]);
}

export { RobotForm, showMotion };
