/* The question for the unit of a path that does not say it, and for one of several paths of a drawing. */

import { byId, element } from "./dom.js";
import { digits } from "./words.js";

const UNITS = { mm: 0.1, cm: 1, m: 100, in: 2.54 };

/* Ask; the promise resolves with {points [cm], closed, name}, or null if the user takes none. */
function askUnit({ paths, unit }, tailLength) {
  if (unit !== null && paths.length === 1) return Promise.resolve(inUnit(paths[0], unit));
  const dialog = byId("unit-dialog");
  const scales = unit === null ? { ...UNITS, "tail lengths": tailLength } : { "as the file says": unit };
  const choice = (group, value, words, checked) =>
    element("label", { class: "choice" }, element("input", { type: "radio", name: group, value, checked }), words);
  const size = (scale) => {
    const [width, height] = extent(paths[0].points).map((value) => digits(value * scale));
    return `${width} × ${height} cm`;
  };
  const units = Object.entries(scales).map(([name, scale], i) =>
    choice("unit", scale, `${name}: ${size(scale)}`, i === (unit === null ? 1 : 0)),
  );
  const names =
    paths.length > 1 ? paths.map((path, i) => choice("path", i, path.name || `path ${i + 1}`, i === 0)) : [];
  byId("unit-title").textContent = unit === null ? "Which unit has this file?" : "Which path of this file?";
  byId("unit-words").textContent =
    unit === null ? "The file does not say its unit. Width and height would be:" : "";
  byId("unit-choices").replaceChildren(...units, ...names);
  dialog.showModal();
  return new Promise((resolve) => {
    dialog.addEventListener(
      "close",
      () => {
        const chosen = (name) => dialog.querySelector(`[name=${name}]:checked`)?.value;
        const path = paths[Number(chosen("path") ?? 0)];
        resolve(dialog.returnValue === "take" ? inUnit(path, Number(chosen("unit"))) : null);
      },
      { once: true },
    );
  });
}

function inUnit({ points, closed, name }, scale) {
  return { points: points.map((point) => point.map((value) => value * scale)), closed, name };
}

/* Width and height of points. */
function extent(points) {
  return [0, 1].map((axis) => {
    let [low, high] = [Infinity, -Infinity];
    for (const point of points) {
      low = Math.min(low, point[axis]);
      high = Math.max(high, point[axis]);
    }
    return high - low;
  });
}

export { askUnit };
