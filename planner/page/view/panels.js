/* The parts beside the picture: what the plan says, the robot's fields in laboratory units, and what each control
 * changes. */
import { halfTurn } from "../math.js";
import { byId, degrees, describe, digits, duration, element, length, say } from "./dom.js";
import { transformed } from "./editor.js";
import { FIELDS, labValues, OPTIONS } from "./state.js";

/* The sentence that a screen reader is told when a plan is finished. */
function summary({ seconds, dwells, calibrated, stated, offDrawn, missed, unmeasured, size }) {
  const exact = calibrated ? "" : "if the coefficients are exact, ", away = Math.max(offDrawn, missed);
  const off = away > stated ? `, which leaves the drawn one by up to ${length(away)}` : "";
  const lost = unmeasured > size ? "not known, they differ by " : "";
  const guessed = unmeasured === null ? "" : ` With coefficients of another robot: ${lost}${length(unmeasured)}.`;
  return `${duration(seconds)}, ${dwells.length} dwells: ${exact}95 of 100 such robots stay within ${length(stated)} of `
    + `the path to follow${off}.${guessed}`;
}

/* Show the numbers of a plan; with `tails` also in tail lengths and time units. */
function showResults(plan, tails) {
  const size = (value) => length(value, plan.tailLength, tails);
  const time = (value) => duration(value) + (tails ? ` (${digits(value / plan.timeScale)} time units)` : "");
  const [x, y, heading] = plan.start, lost = plan.unmeasured > plan.size ? "not known, they differ by " : "";
  const pairs = [
    ["Start pose", `x ${digits(x)} cm, y ${digits(y)} cm, heading ${degrees(heading)} degrees, at rest`],
    ["Time", `${time(plan.seconds)}, ${plan.dwells.length} dwells`],
    ["Net speed along a straight path", `${digits(60 * plan.netSpeed)} cm/min`],
    ["Shortest dwell", time(plan.minimumDwell)],
    ["Predicted error", `${size(plan.predictedRms)} rms, ${size(plan.predictedMax)} at most`],
    [`Stated error${plan.calibrated ? "" : " if the coefficients are exact"}`, size(plan.stated)],
    ...(plan.unmeasured === null ? [] : [["With coefficients of another robot", lost + size(plan.unmeasured)]]),
    ["With a tracker and a camera", plan.feedback < plan.stated ? size(plan.feedback) : "more than without"],
    ...(plan.goal ? [["Goal", goalWords(plan, size)]] : [
      ["Path to follow from the drawn one", `${size(plan.offDrawn)} at most`],
      ["Drawn points from the path to follow", `${size(plan.missed)} at most`],
    ]),
  ];
  if (plan.margin) pairs.push(["Kept clear", `a margin of ${size(plan.margin)} covers the error, so within that the body touches nothing; as predicted it passes at a distance of ${size(plan.clearance)}`]);
  const exact = "no farther from the path, however long it is, if the robot moves exactly as predicted; no real one does";
  if (plan.guaranteed !== null) pairs.push(["Bound for an exact vehicle", `${size(plan.guaranteed)}: ${exact}`]);
  describe(byId("facts"), pairs);
  byId("warnings").replaceChildren(...plan.warnings.map((words) => element("li", {}, words)));
}

/* Where a plan to a goal ends. */
function goalWords({ goal, motion, way }, size) {
  const [x, y, heading] = motion[motion.length - 1], off = size(Math.hypot(x - goal[0], y - goal[1]));
  const turned = Math.abs(halfTurn(heading - goal[2])), words = degrees(turned < 1e-4 ? 0 : turned);
  return `way of ${size(way)}; predicted end ${off} and ${words} degrees from it`;
}

class RobotForm {
  /* `limits` has the slider's ends of each field that can be changed; `changed(values, key)` takes new values,
   * `settled()` the end. */
  constructor(limits, changed, settled) {
    this.changed = changed;
    this.settled = settled;
    this.inputs = new Map();
    const place = ({ first }) => byId(first ? "first-fields" : "more-fields");
    for (const field of FIELDS.filter(({ key }) => key in limits)) place(field).append(this.field(field, limits[field.key]));
  }

  field({ key, words, unit, step, optional }, [low, high]) {
    const name = unit ? `${words} in ${unit}` : words, set = ({ target }) => this.set(key, target.value, optional);
    const common = { input: set, change: this.settled };
    const inputs = [
      { type: "number", step: "any", "aria-label": name, "aria-describedby": "robot-problem" },
      { type: "range", min: low, max: high, step, "aria-label": `${name}, slider` },
    ].map((own) => element("input", { ...common, ...own }));
    const [number, slider] = inputs, unitWords = element("span", { "aria-hidden": "true" }, unit);
    this.inputs.set(key, inputs);
    return element("label", {}, words, element("span", { class: "field" }, number, unitWords, slider));
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

const DEGREES = 180 / Math.PI;
const NUMBERS = [ // of a measured vehicle: key, words, unit, number of the unit in one SI unit
  ["speed_m_s", "Speed on its circle", "cm/s", 100], ["turn_left_rad_s", "Turn to the left", "degrees/s", DEGREES],
  ["turn_right_rad_s", "Turn to the right", "degrees/s", DEGREES], ["slip_rad", "Slip angle", "degrees", DEGREES],
  ["lag_s", "Lag", "s", 1],
];

/* Show the numbers of a measured vehicle, and say of it what the page says of robots otherwise. */
function showMeasured({ measured, name }) {
  for (const node of document.querySelectorAll("[data-vehicle]")) node.textContent = node.dataset.vehicle;
  const lines = Object.fromEntries(measured), { length_m: long, width_m: wide } = lines, cm = (size) => sixDigits(100 * size);
  describe(byId("motion"), [
    ["Name", name],
    ...NUMBERS.map(([key, words, unit, perSi]) => {
      const [value, spread] = lines[key].map((number) => number * perSi);
      return [words, `${sixDigits(value)}${spread ? ` ± ${Number(spread.toPrecision(3))}` : ""} ${unit}`];
    }),
    ...(long || wide ? [["Body", `${cm(long)} × ${cm(wide)} cm`]] : []),
  ]);
}

/* Fill the lists, and connect every control to the page. */
function connect(page) {
  const { data } = page, choice = (value, words) => element("option", { value }, words);
  const none = (words) => element("option", { value: "", disabled: true }, words);
  byId("robot-name").append(none("changed"), ...data.robots.map(({ name }) => choice(name, name)));
  byId("shape").append(none("own path"), ...data.shapes.map(({ name, words }) => choice(name, words ?? name)));
  byId("saves").addEventListener("click", ({ target }) => {
    if (target.matches("button:enabled")) page.saveFile(target.textContent);
  });
  if (data.locked) {
    byId("robot-fields").hidden = byId("or-runs").hidden = true;
    byId("open").title = "A path (CSV, SVG, plan.json) or a track";
    say(byId("locked"), data.locked.why);
  }
  connectButtons(page);
  connectFields(page);
  connectWindow(page);
  page.mode("move");
}

/* Let elements, given by their ids, listen to a kind of event. */
function listen(kind, listeners) {
  for (const [id, listener] of Object.entries(listeners)) byId(id).addEventListener(kind, listener);
}

function connectButtons(page) {
  const points = () => page.editor.path.points;
  listen("click", {
    next: () => (page.saves ? page.saveFile("schedule.h") : byId("draw").click()),
    undo: () => page.step(-1),
    redo: () => page.step(1),
    open: () => byId("pick").click(),
    new: () => {
      document.querySelector("[value=corners]").checked = true;
      page.mode("corners", true);
    },
    close: () => page.setPoints(points(), !page.drawn.closed),
    reverse: () => page.setPoints(points().toReversed(), page.drawn.closed),
    "smooth-path": () => page.smooth(points(), page.drawn.closed, page.state.path.name),
    all: () => page.view.fit(),
    stop: () => {
      page.client.stop();
      page.ended();
      say(byId("message"), "Stopped. The picture shows the last plan that was made.");
    },
    link: async () => {
      page.writeAddress();
      byId("address").textContent = location.href;
      await navigator.clipboard?.writeText(location.href).catch(() => {});
    },
    print: () => print(),
  });
  byId("rigid").addEventListener("submit", (event) => {
    event.preventDefault();
    const names = ["right", "up", "scale", "turn"], { elements } = event.target;
    const numbers = Object.fromEntries(names.map((name) => [name, elements[name].valueAsNumber]));
    if (Object.values(numbers).every(Number.isFinite) && numbers.scale > 0) {
      page.view.moved = false;
      page.setPoints(transformed(points(), numbers), page.drawn.closed);
    } else say(byId("path-problem"), "Give numbers, and a scale above 0.", true);
  });
}

function connectFields(page) {
  const option = ({ target: { id, type, value, valueAsNumber } }) => {
    const none = id === "timeWeight" ? 0 : null;
    page.setOption(id, type !== "number" ? value : value.trim() === "" ? none : valueAsNumber);
  };
  listen("change", Object.fromEntries(Object.keys(OPTIONS).map((key) => [key, option])));
  listen("change", {
    "robot-name": ({ target: { value: name } }) => {
      page.change({ robot: { name, values: labValues(page.robots.get(name).fields) } });
    },
    shape: ({ target: { value } }) => {
      page.view.moved = false;
      page.change({ path: page.ofShape(value) });
    },
    size: () => page.history.settle(),
    snap: ({ target }) => (page.editor.snaps = target.checked),
    tails: ({ target }) => page.plan && showResults(page.plan, target.checked),
    pick: async ({ target }) => {
      const files = [...target.files];
      target.value = "";
      await page.openFiles(files);
    },
  });
  byId("size").addEventListener("input", ({ target: { valueAsNumber: size } }) => {
    page.view.moved = false;
    if (size > 0) page.change({ path: { ...page.state.path, size } }, "size");
    else say(byId("path-problem"), "Give a size above 0.", true);
  });
  for (const input of document.querySelectorAll("[name=mode]")) {
    input.addEventListener("change", () => page.mode(input.value));
  }
  byId("view").addEventListener("dblclick", (event) => page.editor.remove(page.view.placeOf(event)));
  byId("trade").addEventListener("toggle", () => byId("trade").open && page.tradeOff());
}

function connectWindow(page) {
  const broken = (words) => page.problem(`The page has made an error: ${words}`);
  addEventListener("error", (event) => broken(event.message));
  addEventListener("unhandledrejection", ({ reason }) => broken(reason?.message ?? reason));
  addEventListener("resize", () => page.charts.forEach((draw) => draw()));
  addEventListener("hashchange", () => page.newAddress());
  addEventListener("beforeprint", () => (byId("address").textContent = location.href));
  document.addEventListener("change", () => page.writeAddress());
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
    event.preventDefault();
    page.step(event.shiftKey ? 1 : -1);
  });
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    page.openFiles([...event.dataTransfer.files]);
  });
}

export { connect, RobotForm, showMeasured, showMotion, showResults, summary };
