/* Segments of a drawing's paths, from the words of attributes; numbers, lengths, transforms and views.
 *
 * A segment is {kind, points}: its points are those that a transform moves. A line or move has its end; "close" too;
 * a Bézier curve its start and control points; an arc has start, end, centre, and the points of the ellipse at 0 and
 * at a quarter turn, and its sweep [rad]. Matrices are [a, b, c, d, e, f] as in SVG. */
import { TAU, mod } from "./math.js";
import { NAMES } from "./svg_names.js";
import { InputError, quoted } from "./words.js";

const COMMAND = /[MmZzLlHhVvCcSsQqTtAa]/y;
const BLANK = /[ ,\t\n\f\r]+/y;
const FLOAT = /[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?/y;
const COORDINATES = { l: 1, t: 1, c: 3, s: 2, q: 2 }; // of a command, after one another

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
  const reader = new Reader(data), segments = [];
  let command = reader.command();
  while (command !== null && reader.take(command, segments)) command = reader.command();
  if (command !== null || reader.left()) {
    throw new InputError(`the data of a path are not read, ${quoted(data.slice(0, 40))}; correct them`);
  }
  return segments;
}

class Reader {
  constructor(data) {
    this.data = data;
    this.at = 0;
    this.here = null; // end of the last segment
    this.first = null; // end of the last move
    this.control = null; // last control point of a curve
  }

  match(pattern) {
    for (const form of [BLANK, pattern]) {
      form.lastIndex = this.at;
      const found = form.exec(this.data);
      if (found && form === pattern) {
        this.at += found[0].length;
        return found[0];
      }
      if (found) this.at += found[0].length;
    }
    return null;
  }

  command() {
    return this.match(COMMAND);
  }

  /* Tell whether something is left that is no blank. */
  left() {
    this.match(/$/y);
    return this.at < this.data.length;
  }

  more() {
    const before = this.at, number = this.match(FLOAT);
    this.at = before;
    return number !== null;
  }

  number() {
    const text = this.match(FLOAT);
    return text === null ? null : Number(text);
  }

  /* Some coordinate pairs; null where one is missing. */
  places(count, relative) {
    const places = [];
    for (let i = 0; i < count; i++) {
      const x = this.number(), y = this.number();
      if (x === null || y === null) return null;
      places.push(relative && this.here ? [x + this.here[0], y + this.here[1]] : [x, y]);
    }
    return places;
  }

  add(segments, kind, points, control = null) {
    segments.push({ kind, points });
    this.here = points[points.length - 1];
    this.control = control;
  }

  /* Read what follows a command; false where the data are broken. */
  take(command, segments) {
    const kind = command.toLowerCase(), relative = kind === command;
    if (kind === "z") {
      if (this.more()) return false;
      if (this.first) this.add(segments, "close", [this.first]);
      return true;
    }
    if (kind === "m") return this.takeMove(segments, relative);
    if (this.here === null) return false;
    if (kind === "a") return this.takeArcs(segments, relative);
    do {
      if (!(kind === "h" || kind === "v" ? this.takeAxis(segments, kind, relative)
        : this.takeCurve(segments, kind, relative))) return false;
    } while (this.more());
    return true;
  }

  takeMove(segments, relative) {
    for (let kind = "move"; kind === "move" || this.more(); kind = "line") {
      const places = this.places(1, relative);
      if (places === null) return false;
      this.add(segments, kind, places);
      if (kind === "move") [this.first] = places;
    }
    return true;
  }

  takeAxis(segments, kind, relative) {
    const value = this.number(), axis = kind === "h" ? 0 : 1;
    if (value === null) return false;
    const end = [...this.here];
    end[axis] = relative ? end[axis] + value : value;
    this.add(segments, "line", [end]);
    return true;
  }

  takeCurve(segments, kind, relative) {
    const places = this.places(COORDINATES[kind], relative), { here, control } = this;
    if (places === null) return false;
    if (kind === "l") {
      this.add(segments, "line", places);
      return true;
    }
    const smooth = control ? [2 * here[0] - control[0], 2 * here[1] - control[1]] : here;
    const points = [here, ...(kind === "s" || kind === "t" ? [smooth] : []), ...places];
    this.add(segments, "curve", points, points[points.length - 2]);
    return true;
  }

  takeArcs(segments, relative) {
    do {
      const numbers = [this.number(), this.number(), this.number()];
      const flags = [this.match(/[01]/y), this.match(/[01]/y)];
      const places = this.places(1, relative);
      if (places === null || numbers.includes(null) || flags.includes(null)) return false;
      const [rx, ry, turn] = numbers, [large, clockwise] = flags.map((flag) => flag === "1");
      segments.push(arcTo(this.here, [Math.abs(rx), Math.abs(ry), turn, large, clockwise], places[0]));
      [this.here] = places;
      this.control = null;
    } while (this.more());
    return true;
  }
}

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
    throw new InputError(`transform=${quoted(text.slice(0, 40))} is not read; ${words}`);
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

export { product, moved, transformed, pointsOn, Lengths, NUMBER, fitted, numbersIn, shapeSegments, transformOf };
