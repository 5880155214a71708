/* Segments of a drawing's paths: moves, lines, Bézier curves and elliptical arcs; from the data of a path.
 *
 * Stands for the library svgelements in planner/paths/svg_drawing.py. A segment is {kind, points}: its points are
 * those that a transform moves. A line or move has its end; "close" too; a Bézier curve its start and control
 * points; an arc has start, end, centre, and the points of the ellipse at 0 and at a quarter turn, and its sweep
 * [rad]. Matrices are [a, b, c, d, e, f] as in SVG. */
import { TAU, mod } from "./arrays.js";
import { pythonText } from "./format.js";
import { InputError } from "./input_error.js";

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
    throw new InputError(`the data of a path are not read, ${pythonText(data.slice(0, 40))}; correct them`);
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

export { product, moved, transformed, pointsOn, pathSegments };
