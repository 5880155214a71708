/* Paths from SVG drawings.
 *
 * Mirrors planner/paths/svg_drawing.py. In SVG y points down; here it points up. */
import { largestSize, differences, unwrap } from "./arrays.js";
import { pythonText } from "./format.js";
import { InputError, naming } from "./input_error.js";
import { pathOf, stepsOf } from "./path.js";
import { pointsOn } from "./svg_segments.js";
import { hides, readTree } from "./svg_tree.js";
import { XmlError, parseXml } from "./xml.js";

const METRES_PER_PIXEL = 0.0254 / 96; // of SVG
const TURN = 2 * (Math.PI / 180); // largest turn of a curve between two points
const PROBES = 64; // places on a curve where its direction is measured
const MOST_TEXT = 16 * 2 ** 20, MOST_POINTS = 200_000;

/* Read one path of a drawing: {path, unit}, and the size of its unit in metres if the drawing has physical units.
 *
 * text: the drawing. where: its name, for messages. shape: name of the path; null: the only one. read_svg */
function readSvg(text, where, closed = null, shape = null) {
  const { paths, physical } = drawingPaths(text, where), names = [...paths.keys()];
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
  const unit = physical ? METRES_PER_PIXEL : null;
  return { path: naming(where, () => pathOf(upright, ends || closed)), unit };
}

/* The names of the paths of a drawing. */
function pathNames(text, where) {
  return [...drawingPaths(text, where).paths.keys()];
}

/* The paths of a drawing by name, {points, ends}: whether a path is closed; and whether pixels have a size. */
function drawingPaths(text, where) {
  if (text.length > MOST_TEXT) throw new InputError(`${where} has more than 16 MiB; such a file is not read`);
  if (text.includes("<?xml-stylesheet")) {
    throw new InputError(`${where}: <?xml-stylesheet> is not read; save the drawing with its style`);
  }
  try {
    return naming(where, () => {
      const { shapes, physical } = readTree(parseXml(text));
      return { paths: namedPaths(shapes), physical };
    });
  } catch (broken) {
    throw broken instanceof XmlError ? new InputError(`${where} is not SVG: ${broken.message}`) : broken;
  }
}

/* Points of every subpath by name. _subpaths */
function namedPaths(shapes) {
  const paths = new Map(), counts = {};
  for (const { kind, id, segments, clips } of shapes) {
    counts[kind] = (counts[kind] ?? 0) + 1;
    const count = counts[kind], name = id || `${kind}${count}`;
    const parts = subpaths(segments).map(sampled).filter(({ points }) => points.length > 1);
    parts.forEach((part, i) => {
      const own = parts.length === 1 ? name : `${name}/${i + 1}`;
      const clip = clips.find((each) => hides(each, part.points));
      if (clip) {
        const words = `cut it off in the drawing, or remove ${clip.name}`;
        throw new InputError(`${clip.name} hides a part of ${own}; ${words}`);
      }
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
