/* The page's controls: what is in their lists, and what each of them changes. */

import { byId, element, say } from "./dom.js";
import { showResults } from "./results.js";
import { transformed } from "./corner_table.js";
import { labValues } from "./state.js";

const SAVES = {
  "schedule.h": "the dwells, for a microcontroller", "tracker.h": "the plan with feedback, for a microcontroller",
  "plan.csv": "the dwells as a table", "plan.json": "all of the plan, for softflagella", "path.csv": "the path in cm",
  "robot.toml": "the robot, for softflagella", "plan.svg": "this picture",
};

/* Fill the lists, and connect every control to the page. */
function connect(page) {
  const { data } = page;
  byId("robot-name").append(
    element("option", { value: "", disabled: true }, "changed"),
    ...data.robots.map(({ name }) => element("option", { value: name }, name)),
  );
  byId("shape").append(
    element("option", { value: "", disabled: true }, "own path"),
    ...data.shapes.map(({ name, words }) => element("option", { value: name }, words ?? name)),
  );
  if (data.locked) {
    byId("robot-fields").hidden = true;
    say(byId("locked"), data.locked.why);
  }
  connectRobot(page);
  connectPath(page);
  connectOptions(page);
  connectSaves(page);
  connectFiles(page);
  addEventListener("error", (event) => page.problem(`The page has made an error: ${event.message}`));
  addEventListener("unhandledrejection", (event) =>
    page.problem(`The page has made an error: ${event.reason?.message ?? event.reason}`),
  );
  document.addEventListener("change", () => page.writeAddress());
  addEventListener("hashchange", () => page.newAddress());
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z") return;
    event.preventDefault();
    page.step(event.shiftKey ? "redo" : "undo");
  });
}

function connectRobot(page) {
  byId("robot-name").addEventListener("change", (event) => {
    const { fields } = page.robots.get(event.target.value);
    page.change({ robot: { name: event.target.value, values: labValues(fields) } });
  });
}

function connectPath(page) {
  byId("shape").addEventListener("change", (event) => {
    page.view.moved = false;
    const preset = page.data.shapes.find((shape) => shape.name === event.target.value);
    page.change({ path: page.ofShape(preset) });
  });
  byId("size").addEventListener("input", (event) => {
    const size = event.target.valueAsNumber;
    page.view.moved = false;
    if (size > 0) page.change({ path: { ...page.state.path, size } }, "size");
    else say(byId("path-problem"), "Give a size above 0.", true);
  });
  byId("size").addEventListener("change", () => page.history.settle());
  for (const input of document.querySelectorAll("[name=mode]"))
    input.addEventListener("change", () => page.mode(input.value));
  page.mode("move");
  byId("new").addEventListener("click", () => {
    document.querySelector("[value=corners]").checked = true;
    page.mode("corners", true);
  });
  byId("next").addEventListener("click", () => {
    if (page.state.path.points) page.saveFile("schedule.h");
    else byId("draw").click();
  });
  byId("undo").addEventListener("click", () => page.step("undo"));
  byId("redo").addEventListener("click", () => page.step("redo"));
  byId("close").addEventListener("click", () => page.setPoints(page.editor.path.points, !page.drawn.closed));
  byId("reverse").addEventListener("click", () =>
    page.setPoints([...page.editor.path.points].reverse(), page.drawn.closed),
  );
  byId("smooth-path").addEventListener("click", () =>
    page.smooth(page.editor.path.points, page.drawn.closed, page.state.path.name),
  );
  byId("snap").addEventListener("change", (event) => (page.editor.snaps = event.target.checked));
  byId("view").addEventListener("dblclick", (event) => page.editor.remove(page.view.placeOf(event)));
  byId("rigid").addEventListener("submit", (event) => {
    event.preventDefault();
    const numbers = Object.fromEntries(
      ["right", "up", "scale", "turn"].map((name) => [name, event.target.elements[name].valueAsNumber]),
    );
    if (Object.values(numbers).every(Number.isFinite) && numbers.scale > 0) {
      page.view.moved = false;
      page.setPoints(transformed(page.editor.path.points, numbers), page.drawn.closed);
    } else say(byId("path-problem"), "Give numbers, and a scale above 0.", true);
  });
  byId("all").addEventListener("click", () => page.view.fit());
}

function connectOptions(page) {
  for (const key of ["objective", "corner", "point"])
    byId(key).addEventListener("change", (event) => page.setOption(key, event.target.value));
  for (const key of ["minimumSeconds", "tolerance", "timeWeight", "smooth"]) {
    byId(key).addEventListener("change", (event) => {
      const value =
        event.target.value.trim() === "" ? (key === "timeWeight" ? 0 : null) : event.target.valueAsNumber;
      page.setOption(key, value);
    });
  }
  byId("tails").addEventListener("change", (event) => page.plan && showResults(page.plan, event.target.checked));
  byId("trade").addEventListener("toggle", () => byId("trade").open && page.tradeOff());
  byId("stop").addEventListener("click", () => {
    page.client.stop();
    page.ended();
    say(byId("message"), "Stopped. The picture shows the last plan that was made.");
  });
}

function connectSaves(page) {
  byId("saves").append(
    ...Object.entries(SAVES).map(([name, title]) => {
      return element("button", { type: "button", title, click: () => page.saveFile(name) }, name);
    }),
  );
  byId("link").addEventListener("click", async () => {
    page.writeAddress();
    byId("address").textContent = location.href;
    await navigator.clipboard?.writeText(location.href).catch(() => {});
  });
  byId("print").addEventListener("click", () => print());
  addEventListener("beforeprint", () => (byId("address").textContent = location.href));
}

function connectFiles(page) {
  byId("open").addEventListener("click", () => byId("pick").click());
  byId("pick").addEventListener("change", async (event) => {
    const files = [...event.target.files];
    event.target.value = "";
    await page.openFiles(files);
  });
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    page.openFiles([...event.dataTransfer.files]);
  });
}

export { connect };
