/* What was measured: a track over the plan with its errors, and runs beside the look-up table's answers. */
import { chart } from "./charts.js";
import { byId, describe, digits, duration, element, figure, length, say } from "./dom.js";

/* Show a track's errors; `actions` has fit(how), saveTrack() and remove(). Return what draws them over time. */
function showTrack(track, plan, tails, actions) {
  const size = (value) => length(value, plan.tailLength, tails), list = element("dl");
  const { error } = track, [worstX, worstY] = error.worst.place, within = error.largest <= error.stated;
  describe(list, [
    ["Track", `${track.name}${track.shift ? ` (moved: ${track.shift})` : ""}`],
    ...(track.ofFile ? [["Of plan", `${track.ofFile}, with whose plan.json, which is open, it is compared`]] : []),
    ["From the path to follow", `${size(error.rms)} rms, ${size(error.largest)} at most`],
    ["Stated error", `${size(error.stated)}: the track is ${within ? "within" : "above"} it`],
    ["From the drawn path", `${size(error.rawRms)} rms, ${size(error.rawLargest)} at most`],
    ["Largest error", `at ${duration(error.worst.time)}, x ${digits(worstX)} cm, y ${digits(worstY)} cm`],
  ]);
  const about = { width: "100%", height: 90, role: "img", "aria-label": "Distance from the path over time" };
  const picture = figure("svg", about), buttons = element(
    "div", { class: "row" }, button("Begin at time 0", () => actions.fit("time")),
    button("Lay on the plan (rigid motion)", () => actions.fit("rigid")),
    button("As measured", () => actions.fit("none")), button("Save track.csv", actions.saveTrack),
    button("Remove", actions.remove),
  );
  byId("measured").replaceChildren(list, picture, buttons);
  const content = { times: error.times, values: error.distances, words: "distance from the path [cm]", limit: error.stated };
  return () => chart(picture, content);
}

function button(words, click) {
  return element("button", { type: "button", click }, words);
}

const PLAIN = /^[\w@%+=:,./-]+$/; // a word that a shell takes as it is
/* Quantity and unit of a column. */
const WORDS = {
  omega_h_rpm: "spin of the head [rpm]", omega_t_rpm: "spin of the tails [rpm]", omega_yr_rad_s: "yaw rate [rad/s]",
  R_yr_cm: "turn radius [cm]", theta_deg: "slip angle [degrees]", v_cm_s: "speed [cm/s]",
};

/* The runs that are open, if there are any. */
class Runs {
  /* `ask(content, use)` compares runs, `saveRobot()` saves the robot that they are compared with. */
  constructor(ask, saveRobot) {
    this.ask = ask;
    this.saveRobot = saveRobot;
    this.opened = null;
  }

  open(name, table, robot) {
    this.opened = { name, table };
    this.compared = null;
    return this.compare(robot);
  }

  /* Compare the runs with the look-up table's answers for a robot, unless they are compared already. */
  async compare(robot) {
    const key = JSON.stringify(robot);
    if (!this.opened || this.compared === key) return;
    this.compared = key;
    const { name, table } = this.opened;
    await this.ask({ table, name, robot }, ({ answer, refusal }) => {
      if (!this.opened || this.compared !== key) return;
      say(byId("runs-problem"), refusal ?? "", true);
      byId("runs").replaceChildren(...(refusal ? [] : this.parts(name, answer)));
    });
  }

  remove() {
    this.opened = null;
    byId("runs").replaceChildren();
    say(byId("runs-problem"), "", true);
  }

  parts(name, runs) {
    return [
      element("h3", {}, `Runs of ${name}`), element("p", { class: "soft" }, summary(runs)),
      ...(runs.rows.length ? [tableOf(runs)] : []), ...listed("Runs that are still needed", runs.needed),
      ...listed("Rows and columns that are left out", runs.excluded),
      ...listed("Columns that are missing", runs.missing), ...listed("Columns that were converted", runs.converted),
      ...this.commandParts(`softflagella calibrate ${quoted(name)} --robot robot.toml --out calibrated`),
    ];
  }

  commandParts(command) {
    const code = element("code", {}, command), copied = element("span", { role: "status" });
    const copy = async () => {
      try {
        await navigator.clipboard.writeText(command);
        copied.textContent = "Copied.";
      } catch {
        getSelection().selectAllChildren(code);
        copied.textContent = "The browser does not let the page copy: the command is selected, press Ctrl-C.";
      }
    };
    return [
      element("p", {}, "Save robot.toml beside the table. The fit, and the search for copied rows, are made by the command:"),
      element("pre", {}, code),
      element(
        "div", { class: "row" }, button("Copy the command", copy), button("Save robot.toml", this.saveRobot),
        button("Remove the runs", () => this.remove()), copied,
      ),
    ];
  }
}

/* Quote a file's name for a shell. */
function quoted(name) {
  const file = name.startsWith("-") ? `./${name}` : name;
  return PLAIN.test(file) ? file : `'${file.replaceAll("'", `'"'"'`)}'`;
}

function summary({ rows, left, columns, medians }) {
  const known = rows.filter(({ percent }) => percent).length;
  const shown = left ? `the first ${rows.length} of ${rows.length + left} usable runs` : `${rows.length} usable runs`;
  if (!medians) return `The look-up table answers for none of ${shown}.`;
  const differences = columns.map((column, i) => `${WORDS[column].replace(/ \[.*/, "")} ${signed(medians[i])} %`);
  return `The look-up table, with the robot of this page, answers for ${known} of ${shown}. `
    + `Median difference of the measured values: ${differences.join(", ")}.`;
}

/* A difference in per cent: +1.4, −0.3, 0.0. */
function signed(percent) {
  const size = Math.abs(percent).toFixed(1);
  return Number(size) === 0 ? size : `${percent > 0 ? "+" : "−"}${size}`;
}

function tableOf({ columns, rows }) {
  const heads = [
    ...["row", "N", "l [cm]", "motor [rpm]"].map((words) => element("th", { scope: "col", rowspan: 2 }, words)),
    ...columns.map((column) => element("th", { scope: "colgroup", colspan: 3 }, WORDS[column])),
  ];
  const parts = columns.flatMap(() => ["measured", "table", "%"]).map((words) => element("th", { scope: "col" }, words));
  const head = element("thead", {}, element("tr", {}, heads), element("tr", {}, parts));
  const body = element("tbody", {}, rows.map((run) => rowOf(run, columns.length)));
  const about = { class: "wide runs", tabindex: 0, role: "region", "aria-label": "Runs beside the look-up table" };
  return element("div", about, element("table", {}, head, body));
}

function rowOf({ row, inputs, measured, answer, percent, outside }, count) {
  const first = [row, ...inputs].map((value) => element("td", {}, String(value).replace("-", "−")));
  const cells = measured.flatMap((value, i) => {
    const isMeasured = Number.isFinite(value);
    const compared = answer ? [digits(answer[i]), isMeasured ? signed(percent[i]) : "–"] : ["–", "–"];
    return [isMeasured ? digits(value) : "–", ...compared].map((words) => element("td", {}, words));
  });
  if (!outside) return element("tr", {}, ...first, ...cells);
  const why = element("td", { colspan: 3 * count, class: "why" }, `The look-up table has no answer: ${outside}.`);
  return element("tr", {}, ...first, why);
}

function listed(title, sentences) {
  if (!sentences.length) return [];
  const list = element("ul", {}, ...sentences.map((words) => element("li", {}, words)));
  return [element("h4", {}, title), list];
}

export { Runs, showTrack };
