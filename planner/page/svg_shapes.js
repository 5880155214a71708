/* Segments of a drawing's shapes, from the words of attributes; numbers, lengths, transforms and views.
 *
 * Every shape is read as data of a path. A segment is {kind, points}: its points are those that a transform moves. A
 * line or move has its end; "close" too; a Bézier curve its start and control points; an arc has start, end, centre,
 * and the points of the ellipse at 0 and at a quarter turn, and its sweep [rad]. Matrices are [a, b, c, d, e, f] as in
 * SVG. */
import { CONSTANTS } from "./constants.js";
import { TAU, mod } from "./math.js";
import { InputError, quoted } from "./words.js";

const { NAMES } = CONSTANTS.svg_names;
const N = "[-+]?(?:\\d+\\.?\\d*|\\.\\d+)(?:[eE][-+]?\\d+)?";
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
function transformed(matrix, segment) {
  const points = segment.points.map((point) => moved(matrix, point));
  const mirrored = matrix[0] * matrix[3] - matrix[2] * matrix[1] < 0;
  return segment.kind === "arc" ? { ...segment, points, sweep: mirrored ? -segment.sweep : segment.sweep }
    : { ...segment, points };
}

/* Points of a curve at shares of it. */
function pointsOn(segment, shares) {
  return segment.kind === "arc" ? arcPoints(segment, shares) : shares.map((t) => bezierPoint(segment.points, t));
}

function bezierPoint(points, t) {
  const s = 1 - t;
  return [0, 1].map((axis) => {
    const p = points.map((point) => point[axis]);
    if (p.length === 3) return s * s * p[0] + 2 * s * t * p[1] + t * t * p[2];
    return s * s * s * p[0] + 3 * (s * s * t * p[1] + t * t * s * p[2]) + t * t * t * p[3];
  });
}

function arcPoints({ points: [start, end, centre, first, quarter], sweep }, shares) {
  const [x, y] = centre;
  const a = Math.hypot(first[0] - x, first[1] - y), b = Math.hypot(quarter[0] - x, quarter[1] - y);
  const rotation = Math.atan2(first[1] - y, first[0] - x), c = Math.cos(rotation), s = Math.sin(rotation);
  const angle = Math.atan2(start[1] - y, start[0] - x) - rotation;
  const begin = Math.atan2(a * Math.sin(angle), b * Math.cos(angle));
  return shares.map((share) => {
    if (share === 0) return start;
    if (share === 1) return end;
    const along = a * Math.cos(begin + sweep * share), across = b * Math.sin(begin + sweep * share);
    return [x + along * c - across * s, y + along * s + across * c];
  });
}

/* An arc as the data of a path give it. */
function arcTo(start, [rx, ry, degrees, large, clockwise], end) {
  if ((start[0] === end[0] && start[1] === end[1]) || rx === 0 || ry === 0) {
    return { kind: "arc", points: [start, end, start, start, start], sweep: 0 };
  }
  const turn = degrees * (Math.PI / 180), c = Math.cos(turn), s = Math.sin(turn);
  const dx = (start[0] - end[0]) / 2, dy = (start[1] - end[1]) / 2, x = c * dx + s * dy, y = c * dy - s * dx;
  const check = (x * x) / (rx * rx) + (y * y) / (ry * ry), grown = check > 1 ? Math.sqrt(check) : 1;
  const a = rx * grown, b = ry * grown, one = a * a * (y * y), two = b * b * (x * x);
  const size = Math.sqrt(Math.abs((a * a * (b * b) - one - two) / (one + two))) * (large === clockwise ? -1 : 1);
  const cx = (size * a * y) / b, cy = (-size * b * x) / a;
  const centre = [c * cx - s * cy + (start[0] + end[0]) / 2, s * cx + c * cy + (start[1] + end[1]) / 2];
  const u = [(x - cx) / a, (y - cy) / b], v = [(-x - cx) / a, (-y - cy) / b];
  const cosine = (u[0] * v[0] + u[1] * v[1]) / Math.sqrt((u[0] ** 2 + u[1] ** 2) * (v[0] ** 2 + v[1] ** 2));
  const between = Math.acos(Math.min(Math.max(cosine, -1), 1)) * (u[0] * v[1] - u[1] * v[0] < 0 ? -1 : 1);
  const sweep = clockwise ? mod(between, TAU) : mod(between, TAU) - TAU;
  const first = [centre[0] + a * c, centre[1] + a * s], quarter = [centre[0] - b * s, centre[1] + b * c];
  return { kind: "arc", points: [start, end, centre, first, quarter], sweep };
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
  const add = (segment, end, turning = null) => {
    segments.push(segment);
    [here, control] = [end, turning];
  };
  while (!comes(END)) {
    const command = take(COMMAND), kind = command.toLowerCase(), relative = kind === command;
    if (!here && kind !== "m") refuse();
    if (kind === "z") add({ kind: "close", points: [first] }, first);
    for (let begins = true; kind !== "z" && (begins || comes(FLOAT)); begins = false) {
      const [x, y] = relative && here ? here : [0, 0], place = () => [x + number(), y + number()];
      if (kind === "a") {
        const radii = [number(), number()].map(Math.abs), turn = number(), flags = [FLAG, FLAG].map(take);
        const end = place();
        add(arcTo(here, [...radii, turn, ...flags.map((flag) => flag === "1")], end), end);
      } else if (kind === "h" || kind === "v") {
        const end = kind === "h" ? [x + number(), here[1]] : [here[0], y + number()];
        add({ kind: "line", points: [end] }, end);
      } else {
        const places = Array.from({ length: PLACES[kind] }, place), end = places[places.length - 1];
        if (kind === "m" && begins) first = end;
        if (kind === "m" || kind === "l") add({ kind: kind === "m" && begins ? "move" : "line", points: places }, end);
        else {
          const smooth = control ? [2 * here[0] - control[0], 2 * here[1] - control[1]] : here;
          const points = [here, ...(kind === "s" || kind === "t" ? [smooth] : []), ...places];
          add({ kind: "curve", points }, end, points[points.length - 2]);
        }
      }
    }
  }
  return segments;
}

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
      throw new InputError(`${name}=${quoted(text)} is not read; ${words}`);
    }
    if (unit !== "" && unit !== "px") {
      if (!this.sized) {
        const words = `in a drawing without a size; give its <svg> a width in ${unit}`;
        throw new InputError(`${name}=${quoted(text)} ${words}`);
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
    throw new InputError(`${name}=${quoted(text.slice(0, 40))} is not read; give numbers`);
  }
  return (text.match(NUMBER) ?? []).map(Number);
}

/* The segments of a shape, before its transform; null: it shows nothing. */
function shapeSegments(kind, own, lengths, view) {
  const data = kind === "path" ? own.d ?? "" : shapeData(kind, own, lengths, view);
  return data === null ? null : pathSegments(data);
}

/* A shape as data of a path; null: it shows nothing. */
function shapeData(kind, own, lengths, view) {
  if (kind === "polyline" || kind === "polygon") {
    const numbers = numbersIn(own, "points");
    if (numbers.length % 2) throw new InputError(`a ${kind} has an odd number of coordinates; correct its points`);
    return numbers.length ? `M${numbers}${kind === "polygon" ? "Z" : ""}` : "";
  }
  const given = Object.keys(NAMES.lengths).map((name) => [name, lengths.read(own, name, view)]);
  const { rx, ry, ...sizes } = Object.fromEntries(given), numbers = Object.values(sizes).map((size) => size ?? 0);
  const [x, y, width, height, cx, cy, r, x1, y1, x2, y2] = numbers;
  if (kind === "line") return `M${x1},${y1}L${x2},${y2}`;
  const [a, b] = kind === "circle" ? [r, r] : [rx ?? ry ?? 0, ry ?? rx ?? 0];
  if (kind === "rect") return rectData(x, y, width, height, Math.min(a, width / 2), Math.min(b, height / 2));
  const quarters = [[cx, cy + b], [cx - a, cy], [cx, cy - b], [cx + a, cy]].map((end) => `A${a},${b},0,0,1,${end}`);
  return Math.min(a, b) > 0 ? `M${cx + a},${cy}${quarters.join("")}Z` : null;
}

function rectData(x, y, width, height, a, b) {
  if (Math.min(width, height) <= 0) return null;
  const right = x + width, low = y + height, round = (...end) => `A${a},${b},0,0,1,${end}`;
  if (Math.min(a, b) <= 0) return `M${x},${y}H${right}V${low}H${x}Z`;
  return `M${x + a},${y}H${right - a}${round(right, y + b)}V${low - b}${round(right - a, low)}H${x + a}`
    + `${round(x, low - b)}V${y + b}${round(x + a, y)}Z`;
}

/* The matrix of the attribute `transform`. */
function transformOf(text) {
  let matrix = [1, 0, 0, 1, 0, 0];
  if (text.toLowerCase() === "none") return matrix;
  const calls = Array.from(text.matchAll(FUNCTION));
  const functions = calls.map(([, name, inside]) => oneTransform(name.toLowerCase(), inside));
  if (functions.includes(null) || /[^,\s]/.test(text.replace(FUNCTION, ""))) {
    const words = "give matrix, translate, scale, rotate or skew, in px and deg";
    throw new InputError(`transform=${quoted(text.slice(0, 40))} is not read; ${words}`);
  }
  for (const each of functions) matrix = product(matrix, each);
  return matrix;
}

const MATRICES = { // of the functions of a transform; angles in degrees
  matrix: (...matrix) => matrix,
  translate: (x, y = 0) => [1, 0, 0, 1, x, y],
  translatex: (x) => [1, 0, 0, 1, x, 0],
  translatey: (y) => [1, 0, 0, 1, 0, y],
  scale: (x, y = x) => [x, 0, 0, y, 0, 0],
  scalex: (x) => [x, 0, 0, 1, 0, 0],
  scaley: (y) => [1, 0, 0, y, 0, 0],
  skew: (x, y = 0) => [1, Math.tan((y * TAU) / 360), Math.tan((x * TAU) / 360), 1, 0, 0],
  skewx: (x) => MATRICES.skew(x),
  skewy: (y) => MATRICES.skew(0, y),
  rotate: (angle, x = 0, y = 0) => {
    const c = Math.cos((angle * TAU) / 360), s = Math.sin((angle * TAU) / 360);
    return product(product([1, 0, 0, 1, x, y], [c, s, -s, c, 0, 0]), [1, 0, 0, 1, -x, -y]);
  },
};

/* The matrix of one function of a transform; null: it is not known. */
function oneTransform(name, inside) {
  const given = inside.trim().split(/[\s,]+/).map((word) => LENGTH.exec(word));
  const kinds = (NAMES.transforms[name] ?? []).find(({ length }) => length === given.length);
  const unit = (word, i) => NAMES.units[kinds[i]][word[2].toLowerCase()];
  const values = given.map((word, i) => word && kinds && Number(word[1]) * unit(word, i));
  const known = kinds && values.every((value) => typeof value === "number" && !Number.isNaN(value));
  return known ? MATRICES[name](...values) : null;
}

/* Fit the viewBox (left, top, width, height) of an <svg> into its place and size. */
function fitted(aspect, place, size, box) {
  const found = ASPECT.exec(aspect || "xMidYMid");
  if (!found) {
    const words = "give none, or xMidYMid and meet or slice";
    throw new InputError(`preserveAspectRatio=${quoted(aspect)} is not read; ${words}`);
  }
  let scale = [0, 1].map((i) => size[i] / box[2 + i]);
  if (found[1]) scale = Array(2).fill(found[3] ? Math.max(...scale) : Math.min(...scale));
  const at = [0, 1].map((i) => {
    const spare = (SHARES[found[1 + i]] ?? 0) * (size[i] - box[2 + i] * scale[i]);
    return place[i] - box[i] * scale[i] + spare;
  });
  return [scale[0], 0, 0, scale[1], ...at];
}

export { NAMES, product, moved, transformed, pointsOn, Lengths, NUMBER, fitted, numbersIn, shapeSegments, transformOf };
