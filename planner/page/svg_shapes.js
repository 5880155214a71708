/* Numbers, lengths, transforms, views and outlines of SVG drawings, from the words of their attributes.
 *
 * Mirrors planner/paths/svg_shapes.py; stands for the library svgelements there, too. Segments are those of
 * svg_segments.js. */
import { TAU } from "./arrays.js";
import { pythonText } from "./format.js";
import { InputError } from "./input_error.js";
import { NAMES } from "./svg_names.js";
import { pathSegments, product } from "./svg_segments.js";

const N = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d+)?";
const NUMBER = new RegExp(N, "g");
const LENGTH = new RegExp(`^(${N})\\s*([a-zA-Z]*|%)$`);
const FUNCTION = /[\s,]*([a-zA-Z]+)\s*\(([^()]*)\)/g;
const ASPECT = /^(?:none|x(Min|Mid|Max)Y(Min|Mid|Max))(?:\s+(?:meet|(slice)))?$/;
const SHARES = { Min: 0, Mid: 0.5, Max: 1 };

/* Lengths in pixels, and whether pixels have a size. */
class Lengths {
  constructor() {
    this.physical = false; // a length was given in mm or another unit of the laboratory
    this.sized = true; // the drawing says how large its pixels are
  }

  /* Read an attribute, in pixels; missing: where it is not given. view: width and height for percentages. */
  read(own, name, view, missing = null) {
    const text = own[name] ?? "", found = LENGTH.exec(text);
    if (["", "auto"].includes(text.toLowerCase())) return missing;
    const unit = found?.[2].toLowerCase();
    if (unit === "%" && !view.includes(null)) {
      return (Number(found[1]) * [...view, Math.hypot(...view) / Math.SQRT2][NAMES.lengths[name]]) / 100;
    }
    if (!found || !(unit in NAMES.pixels)) {
      const words = "give a number, with mm, cm, in, pt, pc, px or without";
      throw new InputError(`${name}=${pythonText(text)} is not read; ${words}`);
    }
    if (unit !== "" && unit !== "px") {
      if (!this.sized) {
        const words = `in a drawing without a size; give its <svg> a width in ${unit}`;
        throw new InputError(`${name}=${pythonText(text)} ${words}`);
      }
      this.physical = true;
    }
    return Number(found[1]) * NAMES.pixels[unit];
  }
}

/* Read an attribute that is numbers between blanks and commas. */
function numbersIn(own, name) {
  const text = own[name] ?? "";
  if (/[^,\s]/.test(text.replace(NUMBER, ""))) {
    throw new InputError(`${name}=${pythonText(text.slice(0, 40))} is not read; give numbers`);
  }
  return (text.match(NUMBER) ?? []).map(Number);
}

/* The segments of a shape, before its transform; null: it shows nothing. */
function shapeSegments(kind, own, lengths, view) {
  if (kind === "path") return pathSegments(own.d ?? "");
  if (kind === "polyline" || kind === "polygon") return polySegments(kind, numbersIn(own, "points"));
  const names = Object.keys(NAMES.lengths);
  const given = Object.fromEntries(names.map((name) => [name, lengths.read(own, name, view)]));
  const { x, y, width, height, cx, cy, r, x1, y1, x2, y2 } = given, rx = given.rx ?? given.ry, ry = given.ry ?? rx;
  if (kind === "line") {
    return [{ kind: "move", points: [[x1 ?? 0, y1 ?? 0]] }, { kind: "line", points: [[x2 ?? 0, y2 ?? 0]] }];
  }
  if (kind === "rect") return rectSegments(x ?? 0, y ?? 0, width ?? 0, height ?? 0, rx ?? 0, ry ?? 0);
  return kind === "circle" ? roundSegments(cx ?? 0, cy ?? 0, r ?? 0, r ?? 0)
    : roundSegments(cx ?? 0, cy ?? 0, rx ?? 0, ry ?? 0);
}

function polySegments(kind, numbers) {
  const segments = [];
  if (numbers.length % 2) throw new InputError(`a ${kind} has an odd number of coordinates; correct its points`);
  for (let i = 0; i < numbers.length; i += 2) {
    segments.push({ kind: i ? "line" : "move", points: [[numbers[i], numbers[i + 1]]] });
  }
  if (kind === "polygon" && segments.length) segments.push({ kind: "close", points: segments[0].points });
  return segments;
}

function rectSegments(x, y, width, height, rx, ry) {
  if (Math.min(width, height) <= 0) return null;
  const a = rx && ry ? Math.min(rx, width / 2) : 0, b = rx && ry ? Math.min(ry, height / 2) : 0;
  const right = x + width, low = y + height, segments = [];
  if (!(a > 0 && b > 0)) {
    const corners = [[x, y], [right, y], [right, low], [x, low]];
    corners.forEach((point, i) => segments.push({ kind: i ? "line" : "move", points: [point] }));
    return [...segments, { kind: "close", points: [[x, y]] }];
  }
  const round = (start, end, centre) => segments.push({
    kind: "arc", sweep: TAU / 4,
    points: [start, end, centre, [centre[0] + a, centre[1]], [centre[0], centre[1] + b]],
  });
  segments.push({ kind: "move", points: [[x + a, y]] }, { kind: "line", points: [[right - a, y]] });
  round([right - a, y], [right, y + b], [right - a, y + b]);
  segments.push({ kind: "line", points: [[right, low - b]] });
  round([right, low - b], [right - a, low], [right - a, low - b]);
  segments.push({ kind: "line", points: [[x + a, low]] });
  round([x + a, low], [x, low - b], [x + a, low - b]);
  segments.push({ kind: "line", points: [[x, y + b]] });
  round([x, y + b], [x + a, y], [x + a, y + b]);
  return [...segments, { kind: "close", points: [[x + a, y]] }];
}

/* Four quarters of an ellipse. */
function roundSegments(x, y, a, b) {
  if (Math.min(a, b) <= 0) return null;
  const at = (turn) => [x + a * Math.cos(turn), y + b * Math.sin(turn)];
  const segments = [{ kind: "move", points: [at(0)] }];
  for (let i = 0; i < 4; i++) {
    const points = [at((i * TAU) / 4), at(((i + 1) * TAU) / 4), [x, y], [x + a, y], [x, y + b]];
    segments.push({ kind: "arc", points, sweep: TAU / 4 });
  }
  return [...segments, { kind: "close", points: [at(0)] }];
}

/* The matrix of the attribute `transform`. */
function transformOf(text) {
  let matrix = [1, 0, 0, 1, 0, 0];
  if (text.toLowerCase() === "none") return matrix;
  const calls = Array.from(text.matchAll(FUNCTION));
  const functions = calls.map(([, name, inside]) => oneTransform(name.toLowerCase(), inside));
  if (functions.includes(null) || /[^,\s]/.test(text.replace(FUNCTION, ""))) {
    const words = "give matrix, translate, scale, rotate or skew, in px and deg";
    throw new InputError(`transform=${pythonText(text.slice(0, 40))} is not read; ${words}`);
  }
  for (const each of functions) matrix = product(matrix, each);
  return matrix;
}

/* The matrix of one function of a transform; null: it is not known. */
function oneTransform(name, inside) {
  const given = inside.trim().split(/[\s,]+/).map((word) => LENGTH.exec(word));
  const kinds = (NAMES.transforms[name] ?? []).find(({ length }) => length === given.length);
  const unit = (word, i) => NAMES.units[kinds[i]][word[2].toLowerCase()];
  const values = given.map((word, i) => word && kinds && Number(word[1]) * unit(word, i));
  if (!kinds || !values.every((value) => typeof value === "number" && !Number.isNaN(value))) return null;
  const [p, q, r] = values, [tan, tan2] = [p, q ?? 0].map((degrees) => Math.tan((degrees * TAU) / 360));
  if (name === "matrix") return values;
  if (name === "translate") return [1, 0, 0, 1, p, q ?? 0];
  if (name === "scale") return [p, 0, 0, q ?? p, 0, 0];
  if (name === "translatex") return [1, 0, 0, 1, p, 0];
  if (name === "translatey") return [1, 0, 0, 1, 0, p];
  if (name === "scalex") return [p, 0, 0, 1, 0, 0];
  if (name === "scaley") return [1, 0, 0, p, 0, 0];
  if (name === "skewx") return [1, 0, tan, 1, 0, 0];
  if (name === "skewy") return [1, tan, 0, 1, 0, 0];
  if (name === "skew") return [1, tan2, tan, 1, 0, 0];
  const c = Math.cos((p * TAU) / 360), s = Math.sin((p * TAU) / 360);
  return about([c, s, -s, c, 0, 0], q ?? 0, r ?? 0);
}

/* A matrix about another point than the origin. */
function about(matrix, x, y) {
  return product(product([1, 0, 0, 1, x, y], matrix), [1, 0, 0, 1, -x, -y]);
}

/* Fit the viewBox (left, top, width, height) of an <svg> into its place and size. */
function fitted(aspect, place, size, box) {
  const found = ASPECT.exec(aspect || "xMidYMid");
  if (!found) {
    const words = "give none, or xMidYMid and meet or slice";
    throw new InputError(`preserveAspectRatio=${pythonText(aspect)} is not read; ${words}`);
  }
  let scale = [0, 1].map((i) => size[i] / box[2 + i]);
  if (found[1]) scale = Array(2).fill(found[3] ? Math.max(...scale) : Math.min(...scale));
  const at = [0, 1].map((i) => {
    const spare = (SHARES[found[1 + i]] ?? 0) * (size[i] - box[2 + i] * scale[i]);
    return place[i] - box[i] * scale[i] + spare;
  });
  return [scale[0], 0, 0, scale[1], ...at];
}

export { Lengths, NUMBER, fitted, numbersIn, shapeSegments, transformOf };
