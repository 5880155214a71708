/* Segments of a drawing's shapes, from the words of attributes; numbers, lengths, transforms and views.
 *
 * Every shape is read as data of a path. A segment is {kind, end, at}: a "move", a "line", a "close" or a "curve", the
 * end [x, y], and the point of a curve at a share of it. Matrices are [a, b, c, d, e, f] as in SVG. */
import { CONSTANTS } from "./constants.js";
import { TAU, mod } from "./math.js";
import { InputError, quoted } from "./words.js";

const { LENGTHS, SIZES, PIXELS, TRANSFORMS } = CONSTANTS.svg_drawing;
const N = "[-+]?(?:\\d+(?:\\.\\d*)?|\\.\\d+)(?:[eE][-+]?\\d+)?";
const [COMMAND, FLOAT, FLAG, END] = ["[MmZzLlHhVvCcSsQqTtAa]", N, "[01]", "$"].map((word) => {
  return new RegExp(`[ ,\\t\\n\\f\\r]*(${word})`, "y");
});
const PLACES = { m: 1, l: 1, t: 1, c: 3, s: 2, q: 2 }; // of a command, after one another

/* Multiply two matrices: the second is applied first. */
function product([a, b, c, d, e, f], [g, h, i, j, k, l]) {
  return [a * g + c * h, b * g + d * h, a * i + c * j, b * i + d * j, a * k + c * l + e, b * k + d * l + f];
}

function moved([a, b, c, d, e, f], [x, y]) {
  return [a * x + c * y + e, b * x + d * y + f];
}

/* Apply a matrix to a segment. */
function transformed(matrix, { kind, end, at }) {
  return { kind, end: moved(matrix, end), at: at && ((share) => moved(matrix, at(share))) };
}

/* A Bézier curve with two or three control points. */
function bezier(points) {
  const [x, y] = [0, 1].map((axis) => points.map((point) => point[axis]));
  return (t) => [x, y].map((p) => {
    const s = 1 - t;
    if (p.length === 3) return s * s * p[0] + 2 * s * t * p[1] + t * t * p[2];
    return s * s * s * p[0] + 3 * (s * s * t * p[1] + t * t * s * p[2]) + t * t * t * p[3];
  });
}

/* An arc as the data of a path give it (SVG 2, B.2.4). */
function arc(start, [rx, ry, degrees, large, clockwise], end) {
  if ((start[0] === end[0] && start[1] === end[1]) || rx === 0 || ry === 0) return (share) => (share === 1 ? end : start);
  const turn = degrees * (Math.PI / 180), c = Math.cos(turn), s = Math.sin(turn);
  const dx = (start[0] - end[0]) / 2, dy = (start[1] - end[1]) / 2, x = c * dx + s * dy, y = c * dy - s * dx;
  const grown = Math.sqrt(Math.max((x * x) / (rx * rx) + (y * y) / (ry * ry), 1)), a = rx * grown, b = ry * grown;
  const left = a * a * (y * y), low = b * b * (x * x); // rounded as svgelements does: half an ellipse amplifies it
  const size = Math.sqrt(Math.abs((a * a * (b * b) - left - low) / (left + low))) * (large === clockwise ? -1 : 1);
  const cx = (size * a * y) / b, cy = (-size * b * x) / a;
  const u = [(x - cx) / a, (y - cy) / b], v = [(-x - cx) / a, (-y - cy) / b], first = Math.atan2(u[1], u[0]);
  const cosine = (u[0] * v[0] + u[1] * v[1]) / Math.sqrt((u[0] ** 2 + u[1] ** 2) * (v[0] ** 2 + v[1] ** 2));
  const between = Math.acos(Math.min(Math.max(cosine, -1), 1)) * (u[0] * v[1] - u[1] * v[0] < 0 ? -1 : 1);
  const sweep = mod(between, TAU) - (clockwise ? 0 : TAU);
  return (share) => {
    if (share === 1) return end;
    const along = cx + a * Math.cos(first + sweep * share), across = cy + b * Math.sin(first + sweep * share);
    return [(start[0] + end[0]) / 2 + c * along - s * across, (start[1] + end[1]) / 2 + s * along + c * across];
  };
}

/* The segments of the data of a path, all of them. */
function pathSegments(data) {
  const segments = [];
  let at = 0, here = null, first = null, control = null; // ends of the last segment and move; of a curve, its last control
  const refuse = () => {
    throw new InputError(`the data of a path are not read, ${quoted(data.slice(0, 40))}; correct them`);
  };
  const take = (form) => {
    form.lastIndex = at;
    const [, word] = form.exec(data) ?? refuse();
    at = form.lastIndex;
    return word;
  };
  const comes = (form) => {
    form.lastIndex = at;
    return form.test(data);
  };
  const number = () => Number(take(FLOAT));
  const add = (kind, end, at = null, turning = null) => {
    segments.push({ kind, end, at });
    [here, control] = [end, turning];
  };
  while (!comes(END)) {
    const command = take(COMMAND), kind = command.toLowerCase(), relative = kind === command;
    if (!here && kind !== "m") refuse();
    if (kind === "z") add("close", first);
    for (let begins = true; kind !== "z" && (begins || comes(FLOAT)); begins = false) {
      const [x, y] = relative && here ? here : [0, 0], place = () => [x + number(), y + number()];
      if (kind === "a") {
        const radii = [number(), number()].map(Math.abs), turn = number(), flags = [FLAG, FLAG].map(take);
        const end = place();
        add("curve", end, arc(here, [...radii, turn, ...flags.map((flag) => flag === "1")], end));
      } else if (kind === "h" || kind === "v") {
        add("line", kind === "h" ? [x + number(), here[1]] : [here[0], y + number()]);
      } else {
        const places = Array.from({ length: PLACES[kind] }, place), end = places[places.length - 1];
        if (kind === "m" && begins) first = end;
        if (kind === "m" || kind === "l") add(kind === "m" && begins ? "move" : "line", end);
        else {
          const smooth = control ? [2 * here[0] - control[0], 2 * here[1] - control[1]] : here;
          const points = [here, ...(kind === "s" || kind === "t" ? [smooth] : []), ...places];
          add("curve", end, bezier(points), points[points.length - 2]);
        }
      }
    }
  }
  return segments;
}

const NUMBER = new RegExp(N, "g");
const LENGTH = new RegExp(`^(${N})\\s*([a-zA-Z]*)$`);
const FUNCTION = /(?<![a-zA-Z])([a-zA-Z]+)\s*\(([^()]*)\)/g;
const ASPECT = /^(?:none|x(Min|Mid|Max)Y(Min|Mid|Max))(?:\s+(?:meet|(slice)))?$/;
const BASES = ["x", "y", "width", "height", "cx", "cy", "x1", "y1", "x2", "y2"];
const SHARES = { Min: 0, Mid: 0.5, Max: 1 };

/* Refuse an attribute; words: what to do. */
function unread(own, name, words) {
  throw new InputError(`${name}=${quoted((own[name] ?? "").slice(0, 40))} is not read; ${words}`);
}

/* Lengths in pixels, and whether pixels have a size. */
class Lengths {
  constructor() {
    this.physical = false; // a length was given in mm or another unit of the laboratory
    this.sized = true; // the drawing says how large its pixels are
  }

  /* Read an attribute, in pixels; 0: it is not given. */
  read(own, name) {
    const text = own[name] ?? "", found = LENGTH.exec(text || "0"), unit = found?.[2].toLowerCase();
    if (!found || !Object.hasOwn(PIXELS, unit)) unread(own, name, "give a number, with mm, cm, in, pt, pc, px or without");
    if (unit !== "" && unit !== "px") {
      if (!this.sized) {
        const words = `in a drawing without a size; give its <svg> a width in ${unit}`;
        throw new InputError(`${name}=${quoted(text)} ${words}`);
      }
      this.physical = true;
    }
    const value = Number(found[1]) * PIXELS[unit];
    if (value < 0 && SIZES.includes(name)) throw new InputError(`${name}=${quoted(text)} is below 0; correct it`);
    return value;
  }
}

/* Read an attribute that is numbers between blanks and commas. */
function numbersIn(own, name) {
  const text = own[name] ?? "";
  if (/[^,\s]/.test(text.replace(NUMBER, ""))) unread(own, name, "give numbers");
  return (text.match(NUMBER) ?? []).map(Number);
}

/* The segments of a shape, before its transform; none: it shows nothing. */
function shapeSegments(kind, own, lengths) {
  return pathSegments(kind === "path" ? own.d ?? "" : shapeData(kind, own, lengths));
}

/* A shape as data of a path. */
function shapeData(kind, own, lengths) {
  if (kind === "polyline" || kind === "polygon") {
    const numbers = numbersIn(own, "points");
    if (numbers.length % 2) throw new InputError(`a ${kind} has an odd number of coordinates; correct its points`);
    return numbers.length ? `M${numbers}${kind === "polygon" ? "Z" : ""}` : "";
  }
  const size = (name) => ((own[name] ?? "auto") === "auto" ? null : lengths.read(own, name));
  const given = Object.fromEntries(LENGTHS[kind].map((name) => [name, size(name)]));
  const { r, rx = r, ry = r } = given, [a, b] = [rx ?? ry ?? 0, ry ?? rx ?? 0];
  const [x, y, width, height, cx, cy, ...ends] = BASES.map((name) => given[name] ?? 0);
  if (kind === "line") return `M${ends}`;
  if (kind === "rect") return rectData(x, y, width, height, Math.min(a, width / 2), Math.min(b, height / 2));
  const quarters = [[cx, cy + b], [cx - a, cy], [cx, cy - b], [cx + a, cy]].map((end) => `A${a},${b},0,0,1,${end}`);
  return Math.min(a, b) > 0 ? `M${cx + a},${cy}${quarters.join("")}Z` : "";
}

function rectData(x, y, width, height, a, b) {
  if (Math.min(width, height) <= 0) return "";
  const right = x + width, low = y + height, round = (...end) => `A${a},${b},0,0,1,${end}`;
  if (Math.min(a, b) <= 0) return `M${x},${y}H${right}V${low}H${x}Z`;
  return `M${x + a},${y}H${right - a}${round(right, y + b)}V${low - b}${round(right - a, low)}H${x + a}`
    + `${round(x, low - b)}V${y + b}${round(x + a, y)}Z`;
}

/* The matrix of the attribute `transform`. */
function transformOf(own) {
  const text = (own.transform ?? "").replace(/^none$/i, ""), calls = Array.from(text.matchAll(FUNCTION));
  const functions = calls.map(([, name, inside]) => oneTransform(name.toLowerCase(), inside));
  if (functions.includes(null) || /[^,\s]/.test(text.replace(FUNCTION, ""))) {
    unread(own, "transform", "give matrix, translate, scale, rotate or skewX, in px, deg");
  }
  return functions.reduce(product, [1, 0, 0, 1, 0, 0]);
}

const MATRICES = { // of the functions of a transform; angles in degrees
  matrix: (...matrix) => matrix,
  translate: (x, y = 0) => [1, 0, 0, 1, x, y],
  translatex: (x) => [1, 0, 0, 1, x, 0],
  translatey: (y) => [1, 0, 0, 1, 0, y],
  scale: (x, y = x) => [x, 0, 0, y, 0, 0],
  scalex: (x) => [x, 0, 0, 1, 0, 0],
  scaley: (y) => [1, 0, 0, y, 0, 0],
  skewx: (x) => [1, 0, Math.tan((x * TAU) / 360), 1, 0, 0],
  skewy: (y) => [1, Math.tan((y * TAU) / 360), 0, 1, 0, 0],
  rotate: (angle, x = 0, y = 0) => {
    const c = Math.cos((angle * TAU) / 360), s = Math.sin((angle * TAU) / 360);
    return product(product([1, 0, 0, 1, x, y], [c, s, -s, c, 0, 0]), [1, 0, 0, 1, -x, -y]);
  },
};

const UNITS = { // of arguments: numbers, lengths, angles
  1: { "": 1 },
  x: { "": 1, px: 1 },
  a: { "": 1, deg: 1, grad: 0.9, rad: 360 / TAU, turn: 360 },
};

/* The matrix of one function of a transform; null: it is not known. */
function oneTransform(name, inside) {
  const given = inside.trim().split(/[\s,]+/).map((word) => LENGTH.exec(word));
  const kinds = (Object.hasOwn(TRANSFORMS, name) ? TRANSFORMS[name] : []).find(({ length }) => length === given.length);
  const unit = (word, i) => UNITS[kinds[i]][word[2].toLowerCase()];
  const values = given.map((word, i) => word && kinds && Number(word[1]) * unit(word, i));
  const known = kinds && values.every((value) => typeof value === "number" && !Number.isNaN(value));
  return known ? MATRICES[name](...values) : null;
}

/* Fit the viewBox into the size of the drawing; a side that is missing, or in per cent, follows from it. */
function fitted(own, lengths) {
  const sides = ["width", "height"].map((name) => {
    return /(?:auto|%)$/.test(own[name] ?? "auto") ? null : lengths.read(own, name);
  });
  const box = numbersIn(own, "viewBox"), whole = box.slice(2);
  const found = ASPECT.exec(own.preserveAspectRatio || "xMidYMid");
  if (sides.includes(0)) throw new InputError("the width or height of the <svg> is 0; correct it");
  if (!box.length) return [1, 0, 0, 1, 0, 0];
  if (!found) unread(own, "preserveAspectRatio", "give none, or xMidYMid, meet or slice");
  if (box.length !== 4 || Math.min(...whole) <= 0) unread(own, "viewBox", "give left, top, and sizes above 0");
  lengths.sized = sides.some((side) => side !== null);
  const scales = sides.map((side, i) => side && side / whole[i]), only = scales[0] ?? scales[1] ?? 1;
  let scale = scales.map((each) => each ?? only);
  if (found[1]) scale = Array(2).fill(found[3] ? Math.max(...scale) : Math.min(...scale));
  const at = sides.map((side, i) => {
    const spare = side === null ? 0 : side - whole[i] * scale[i];
    return (SHARES[found[1 + i]] ?? 0) * spare - box[i] * scale[i];
  });
  return [scale[0], 0, 0, scale[1], ...at];
}

export { Lengths, NUMBER, fitted, product, shapeSegments, transformed, transformOf };
