/* Paths from SVG drawings: transforms, viewBox, curves, basic shapes and <use>; <defs> is ignored.
 *
 * Mirrors planner/paths/svg_drawing.py. In SVG y points down; here it points up. Of style sheets, only the
 * attribute `style` counts. */
import { largestSize, differences, unwrap } from "./arrays.js";
import { fixed, pythonText } from "./format.js";
import { InputError } from "./input_error.js";
import { pathOf, stepsOf } from "./path.js";
import { shapeSegments, transformOf } from "./svg_shapes.js";
import { pointsOn, product, transformed } from "./svg_segments.js";
import { XmlError, parseXml } from "./xml.js";

const METRES_PER_PIXEL = 0.0254 / 96; // of SVG
const PHYSICAL = /^\s*[0-9.eE+-]+\s*(mm|cm|in|pt|pc)\s*$/;
const TURN = 2 * (Math.PI / 180); // largest turn of a curve between two points
const PROBES = 64; // places on a curve where its direction is measured
const MOST_TEXT = 16 * 2 ** 20, MOST_NUMBERS = 50_000, MOST_POINTS = 200_000, DEEPEST = 100;
const SVG = "{http://www.w3.org/2000/svg}", XLINK = "{http://www.w3.org/1999/xlink}href";
const HIDDEN = new Set(["defs", "clipPath", "pattern"]);
const OWN = ["preserveAspectRatio", "viewBox", "id", "class", "clip-path"]; // attributes that parts do not inherit
const PIXELS = { "": 1, px: 1, pt: 4 / 3, pc: 16, in: 96, mm: 96 * 0.0393701, cm: 96 * 0.393701 };

/* Read one path of a drawing: {path, unit}, and the size of its unit in metres if the drawing has physical units.
 *
 * text: the drawing. where: its name, for messages. shape: name of the path; null: the only one. read_svg */
function readSvg(text, where, closed = null, shape = null) {
  const { paths, width } = drawingPaths(text, where), names = [...paths.keys()];
  if (!names.length) {
    throw new InputError(`${where} has no path, line, polyline, polygon, rectangle, circle or ellipse; draw one`);
  }
  if (shape === null && names.length > 1) {
    throw new InputError(
      `${where} has ${names.length} paths (${names.join(", ")}); choose one with --shape, or remove the others`,
    );
  }
  const name = shape ?? names[0];
  if (!paths.has(name)) {
    throw new InputError(`${where} has no shape ${pythonText(name)}; there are ${names.join(", ")}`);
  }
  const { points, ends } = paths.get(name), upright = points.map(([x, y]) => [x + 0, -y + 0]);
  try {
    return { path: pathOf(upright, ends || closed), unit: PHYSICAL.test(width) ? METRES_PER_PIXEL : null };
  } catch (refusal) {
    throw refusal instanceof InputError ? new InputError(`${where}: ${refusal.message}`) : refusal;
  }
}

/* The names of the paths of a drawing. */
function pathNames(text, where) {
  return [...drawingPaths(text, where).paths.keys()];
}

/* The paths of a drawing by name, {points, ends}: whether the path is closed; and the width of the drawing. */
function drawingPaths(text, where) {
  if (text.length > MOST_TEXT) throw new InputError(`${where} has more than 16 MiB; such a file is not read`);
  let root;
  try {
    root = parseXml(text);
  } catch (broken) {
    throw broken instanceof XmlError ? new InputError(`${where} is not SVG: ${broken.message}`) : broken;
  }
  const named = elementsById(root), shapes = [];
  checkSize(where, root, named);
  try {
    collect(root, {}, { width: null, height: null }, named, shapes);
  } catch (broken) {
    throw broken instanceof TypeError ? new InputError(`${where} is not SVG: ${broken.message}`) : broken;
  }
  return { paths: namedPaths(shapes), width: root.attributes.width ?? "" };
}

function elementsById(root) {
  const named = new Map();
  for (const stack = [root]; stack.length; ) {
    const element = stack.pop();
    if (element.attributes.id) named.set(element.attributes.id, element);
    stack.push(...element.children);
  }
  return named;
}

function shownBy(element, named) {
  const link = element.attributes.href ?? element.attributes[XLINK] ?? "";
  return localName(element) === "use" && link.startsWith("#") ? named.get(link.slice(1)) : undefined;
}

function localName({ tag }) {
  return tag.startsWith(SVG) ? tag.slice(SVG.length) : tag;
}

/* Count what a drawing holds when every <use> has been replaced by what it shows. _check_size */
function checkSize(where, root, named) {
  const sizes = new Map(), open = new Set();
  const visit = (element) => {
    if (sizes.has(element)) return sizes.get(element);
    if (open.has(element)) throw new InputError(`${where}: a <use> shows a group that it belongs to; remove it`);
    open.add(element);
    const shown = shownBy(element, named), parts = shown ? [...element.children, shown] : element.children;
    let size = 1, depth = 0;
    if (open.size <= 2 * DEEPEST) {
      for (const key of ["d", "points"]) size += element.attributes[key]?.match(/[0-9.eE+-]+/g)?.length ?? 0;
      for (const part of parts) {
        const inner = visit(part);
        size += inner.size;
        depth = Math.max(depth, inner.depth);
      }
    } else depth = DEEPEST;
    if (size > MOST_NUMBERS || depth + 1 > DEEPEST) {
      throw new InputError(
        `${where} has more than ${MOST_NUMBERS} shapes and coordinates, or groups in more than ${DEEPEST} ` +
          "levels; simplify the drawing",
      );
    }
    open.delete(element);
    sizes.set(element, { size, depth: depth + 1 });
    return sizes.get(element);
  };
  visit(root);
}

/* Collect the shapes of an element, {kind, id, segments}; inherited: attributes of the elements around it. view:
 * size of the part of the drawing to which percentages belong. */
function collect(element, inherited, view, named, shapes) {
  const kind = localName(element), own = { ...element.attributes };
  for (const part of (own.style ?? "").split(";")) {
    const words = part.split(":");
    if (words.length === 2) own[words[0].trim()] = words[1].trim();
  }
  const values = { ...inherited };
  for (const name of OWN) delete values[name];
  Object.assign(values, own);
  values.matrix = product(inherited.matrix ?? [1, 0, 0, 1, 0, 0], transformOf(own.transform ?? ""));
  if (String(values.display ?? "").toLowerCase() === "none" || HIDDEN.has(kind)) return;
  let inner = view;
  if (kind === "svg") {
    inner = openView(values, view);
    if (inner === null) return;
  } else if (kind === "use") {
    const [x, y] = ["x", "y"].map((name) => lengthOf(values[name], 0, 0));
    values.matrix = product(values.matrix, [1, 0, 0, 1, x, y]);
    for (const name of ["x", "y", "width", "height"]) delete values[name];
  }
  const size = (name, axis, missing) => lengthOf(values[name], view[axis], missing);
  const segments = shapeSegments(kind, values, size);
  if (segments) shapes.push({ kind, id: values.id, segments: segments.map((s) => transformed(values.matrix, s)) });
  for (const child of element.children) collect(child, values, inner, named, shapes);
  const shown = shownBy(element, named);
  if (shown) collect(shown, values, inner, named, shapes);
}

/* Apply the view of an <svg> to its matrix, and return the size of the view; null: it has none, and shows nothing.
 * */
function openView(values, outer) {
  const box = (values.viewBox ?? "").match(/[-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?/g)?.map(Number);
  const known = box && box.length >= 4, around = {
    width: outer.width ?? (known ? box[2] : 1000), height: outer.height ?? (known ? box[3] : 1000),
  };
  const width = lengthOf(values.width ?? "100%", around.width);
  const height = lengthOf(values.height ?? "100%", around.height);
  if (!known) return { width, height };
  if (!width || !height || !box[2] || !box[3]) return null;
  const [align, fit = "meet"] = (values.preserveAspectRatio ?? "xMidYMid").split(" "), low = align.toLowerCase();
  let sx = width / box[2], sy = height / box[3];
  if (align !== "none" && fit === "meet") sx = sy = Math.min(sx, sy);
  else if (align !== "none" && fit === "slice") sx = sy = Math.max(sx, sy);
  const spare = [width - box[2] * sx, height - box[3] * sy];
  const shift = (axis, free) => (low.includes(`${axis}mid`) ? free / 2 : low.includes(`${axis}max`) ? free : 0);
  const x = lengthOf(values.x, around.width, 0) - box[0] * sx + shift("x", spare[0]);
  const y = lengthOf(values.y, around.height, 0) - box[1] * sy + shift("y", spare[1]);
  const view = [sx, 0, 0, sy, x, y].map((value) => Number(fixed(value, 12))); // as the library hands it on
  values.matrix = product(values.matrix, view);
  return { width: box[2], height: box[3] };
}

/* A length in pixels; relative: what percentages belong to; missing: where there is none. */
function lengthOf(text, relative, missing = null) {
  const found = /([-+]?[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?)([A-Za-z%]*)/.exec(text ?? "");
  if (!found) return text === undefined ? missing : 0;
  return Number(found[1]) * (found[2] === "%" ? relative / 100 : (PIXELS[found[2]] ?? 1));
}

/* Points of every subpath by name. _subpaths */
function namedPaths(shapes) {
  const paths = new Map(), counts = {};
  for (const { kind, id, segments } of shapes) {
    counts[kind] = (counts[kind] ?? 0) + 1;
    const count = counts[kind], name = id || `${kind}${count}`;
    const parts = subpaths(segments).map(sampled).filter(({ points }) => points.length > 1);
    parts.forEach((part, i) => {
      const own = parts.length === 1 ? name : `${name}/${i + 1}`;
      paths.set(paths.has(own) ? `${own}-${kind}${count}` : own, part);
    });
  }
  return paths;
}

/* Split segments at moves and after closed ends. */
function subpaths(segments) {
  const parts = [];
  let part = [];
  const end = () => {
    if (part.length) parts.push(part);
    part = [];
  };
  for (const segment of segments) {
    if (segment.kind === "move") end();
    part.push(segment);
    if (segment.kind === "close") end();
  }
  end();
  return parts;
}

/* Sample the points of one subpath, curves as polylines, and tell whether it is closed. _points */
function sampled(segments) {
  let points = [], ends = false;
  for (const segment of segments) {
    const [end] = segment.points;
    ends ||= segment.kind === "close";
    if (segment.kind === "move") points = [end];
    else if (segment.kind === "line" || segment.kind === "close") points.push(end);
    else {
      const count = enough(segment);
      points.push(...pointsOn(segment, Array.from({ length: count }, (_, i) => (i + 1) / count)));
    }
    if (points.length > MOST_POINTS) {
      throw new InputError(`a curve of the drawing needs more than ${MOST_POINTS} points; simplify the drawing`);
    }
  }
  return { points, ends };
}

/* The number of segments of a curve such that none turns by more than TURN. */
function enough(curve) {
  const probes = pointsOn(curve, Array.from({ length: PROBES + 1 }, (_, i) => i / PROBES)), angles = [];
  for (let i = 0; i < PROBES; i++) {
    const x = probes[i + 1][0] - probes[i][0], y = probes[i + 1][1] - probes[i][1];
    if (Math.hypot(x, y) > 0) angles.push(Math.atan2(y, x));
  }
  return Math.max(PROBES, stepsOf(PROBES * largestSize(differences(unwrap(angles))), TURN));
}

export { readSvg, pathNames };
