/* Basic shapes and transforms of drawings.
 *
 * Stands for the library svgelements in planner/paths/svg_drawing.py. Segments are those of svg_segments.js. */
import { TAU } from "./arrays.js";
import { pathSegments, product } from "./svg_segments.js";

const FLOAT = /[-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?/g;
const TRANSFORM = /(matrix|translate[xy]?|scale[xy]?|rotate|skew[xy]?)\s*\(([^)]+)\)/g;
const PARAMETER = /([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)\s*(deg|grad|rad|turn|px|pt|pc|%)?/g;
const ANGLES = { deg: TAU / 360, grad: TAU / 400, rad: 1, turn: TAU };

/* The segments of a shape, before its transform; null: the element is none, or shows nothing.
 *
 * values: its attributes. size(name, axis, missing): a length among them in pixels, of which percentages belong to
 * the view's "width" or "height". */
function shapeSegments(kind, values, size) {
  if (kind === "path") return pathSegments(values.d ?? "");
  if (kind === "line") {
    const [start, end] = ["1", "2"].map((n) => [size(`x${n}`, "width", 0), size(`y${n}`, "height", 0)]);
    return [{ kind: "move", points: [start] }, { kind: "line", points: [end] }];
  }
  if (kind === "polyline" || kind === "polygon") return polySegments(values.points ?? "", kind === "polygon");
  if (kind === "rect") return rectSegments(size);
  return kind === "circle" || kind === "ellipse" ? roundSegments(values, size) : null;
}

function polySegments(text, closed) {
  const numbers = (text.match(FLOAT) ?? []).map(Number), segments = [];
  for (let i = 0; i + 1 < numbers.length; i += 2) {
    segments.push({ kind: i ? "line" : "move", points: [[numbers[i], numbers[i + 1]]] });
  }
  if (closed && segments.length) segments.push({ kind: "close", points: segments[0].points });
  return segments;
}

function rectSegments(size) {
  const x = size("x", "width", 0), y = size("y", "height", 0), width = size("width", "width", 1);
  const height = size("height", "height", 1), given = [size("rx", "width", null), size("ry", "height", null)];
  if (!width || !height) return null;
  const [rx, ry] = [given[0] ?? given[1] ?? 0, given[1] ?? given[0] ?? 0];
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
function roundSegments(values, size) {
  const x = size("cx", "width", 0), y = size("cy", "height", 0), radius = size("r", "width", null);
  const a = radius ?? size("rx", "width", 1), b = radius ?? size("ry", "height", 1);
  if (!a || !b) return null;
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
  for (const [, name, inside] of text.toLowerCase().matchAll(TRANSFORM)) {
    const given = Array.from(inside.matchAll(PARAMETER), ([, number, unit]) => ({ number: Number(number), unit }));
    matrix = product(matrix, oneTransform(name, given));
  }
  return matrix;
}

function oneTransform(name, given) {
  const [p, q, r] = given.map(({ number }) => number), none = [1, 0, 0, 1, 0, 0];
  if (name === "matrix") {
    if (given.length < 6) throw new TypeError("tuple index out of range");
    return given.slice(0, 6).map(({ number }) => number);
  }
  if (name === "translate") return given.length ? [1, 0, 0, 1, p, q ?? 0] : none;
  if (name === "scale") return given.length ? [p, 0, 0, q ?? p, 0, 0] : none;
  if (!given.length) throw new TypeError("list index out of range");
  if (name === "translatex") return [1, 0, 0, 1, p, 0];
  if (name === "translatey") return [1, 0, 0, 1, 0, p];
  if (name === "scalex") return [p, 0, 0, 1, 0, 0];
  if (name === "scaley") return [1, 0, 0, p, 0, 0];
  const angles = given.map(({ number, unit }) => number * (ANGLES[unit ?? "deg"] ?? ANGLES.deg));
  if (name === "rotate") {
    const c = Math.cos(angles[0]), s = Math.sin(angles[0]);
    return about([c, s, -s, c, 0, 0], q ?? 0, r ?? 0);
  }
  if (name === "skewx") return about([1, 0, Math.tan(angles[0]), 1, 0, 0], q ?? 0, r ?? 0);
  if (name === "skewy") return about([1, Math.tan(angles[0]), 0, 1, 0, 0], q ?? 0, r ?? 0);
  if (given.length < 2) return none;
  return about([1, Math.tan(angles[1]), Math.tan(angles[0]), 1, 0, 0], r ?? 0, given[3]?.number ?? 0);
}

/* A matrix about another point than the origin. */
function about(matrix, x, y) {
  return product(product([1, 0, 0, 1, x, y], matrix), [1, 0, 0, 1, -x, -y]);
}

export { shapeSegments, transformOf };
