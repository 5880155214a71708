/* The corners of the path as a table of numbers that can be typed. Lengths in cm. */

import { element } from "./dom.js";
import { HANDLES } from "./path_editor.js";

/* Fill `host` with the corners; `changed(points)` takes new ones. Focus stays where it is. */
function showCorners(host, points, changed) {
  if (points.length > HANDLES) {
    host.replaceChildren(
      element("p", { class: "soft" }, `The path has ${points.length} points: more than can be typed or moved.`),
    );
    return;
  }
  const focused = host.contains(document.activeElement) ? document.activeElement.getAttribute("aria-label") : null;
  const rows = points.map((point, i) => row(points, i, changed));
  const add = () => changed([...points, after(points)]);
  host.replaceChildren(
    element(
      "div",
      { class: "wide" },
      element(
        "table",
        {},
        element(
          "thead",
          {},
          element(
            "tr", {}, ...["corner", "x [cm]", "y [cm]", ""].map((words) => element("th", { scope: "col" }, words)),
          ),
        ),
        element("tbody", {}, ...rows),
      ),
    ),
    element("button", { type: "button", click: add }, "Add a corner"),
  );
  if (focused)
    [...host.querySelectorAll("[aria-label]")].find((node) => node.getAttribute("aria-label") === focused)?.focus();
}

function row(points, i, changed) {
  const cells = [0, 1].map((axis) => {
    const set = (event) => {
      const value = event.target.valueAsNumber;
      if (!Number.isFinite(value)) event.target.value = points[i][axis];
      else
        changed(points.map((point, k) => (k === i ? point.map((old, a) => (a === axis ? value : old)) : point)));
    };
    const name = `corner ${i + 1}, ${"xy"[axis]} in cm`;
    return element(
      "td", {},
      element("input", { type: "number", step: "any", value: points[i][axis], change: set, "aria-label": name }),
    );
  });
  const remove = () => changed(points.filter((_, k) => k !== i));
  const button = element(
    "button",
    { type: "button", click: remove, disabled: points.length < 3, "aria-label": `remove corner ${i + 1}` }, "×",
  );
  return element("tr", {}, element("th", { scope: "row" }, String(i + 1)), ...cells, element("td", {}, button));
}

/* The next corner: as far from the last one as that is from the one before. */
function after(points) {
  const [before, last] = points.slice(-2);
  return [2 * last[0] - before[0], 2 * last[1] - before[1]].map((value) => Math.round(value * 1000) / 1000);
}

/* Move, scale and turn points about their middle. */
function transformed(points, { right, up, scale, turn }) {
  const middle = [0, 1].map((axis) => {
    const values = points.map((point) => point[axis]);
    return (
      (values.reduce((low, value) => Math.min(low, value)) +
        values.reduce((high, value) => Math.max(high, value))) /
      2
    );
  });
  const angle = (turn * Math.PI) / 180;
  const [cos, sin] = [scale * Math.cos(angle), scale * Math.sin(angle)];
  return points.map(([x, y]) => {
    const [dx, dy] = [x - middle[0], y - middle[1]];
    return [middle[0] + right + cos * dx - sin * dy, middle[1] + up + sin * dx + cos * dy];
  });
}

export { showCorners, transformed };
