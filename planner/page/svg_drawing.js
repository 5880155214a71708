/* Paths from SVG drawings: the shapes that a drawing shows, each where it is seen.
 *
 * What the elements around an element do to it is {matrix, visible, unread}: unread names what moves, scales or hides,
 * and is not read. A shape is {kind, id, segments}; a rule of a style sheet {selector, given}. */
import { CONSTANTS } from "./constants.js";
import { differences, largestSize, unwrap } from "./math.js";
import { pathOf, stepsOf } from "./path.js";
import { Lengths, NUMBER, fitted, product, shapeSegments, transformed, transformOf } from "./svg_shapes.js";
import { InputError, naming, quoted } from "./words.js";

const { LENGTHS, GROUPS, UNDRAWN, MOVING, READ, UNREAD, HARMLESS } = CONSTANTS.svg_drawing;
const COMMENT = /\/\*[^]*?(?:\*\/|$)|<!--|-->/g;
const NO_RULE = /@(?:charset|namespace)[^;{}@]*;|@font-face\s*\{[^{}]*\}/gi;
const RULE = /(?<![^{}])([^{}]*)\{([^{}]*)\}/g;
const SELECTOR = /^[.#]?[\p{L}\p{N}_-]+$/u;
const IMPORTANT = /!\s*important$/i;

/* Read selectors and what they declare of the properties that matter, the weakest first. */
function styleRules(text) {
  const bare = text.replace(COMMENT, "").replace(NO_RULE, ""), rest = bare.replace(RULE, "").trim(), rules = [];
  const known = new Set([...READ, ...UNREAD, ...Object.values(LENGTHS).flat()]);
  if (rest) throw new InputError(`<style> is not read from ${quoted(rest.slice(0, 30))} on; write attributes instead`);
  for (const [, selectors, body] of bare.matchAll(RULE)) {
    const given = Object.fromEntries(Object.entries(declarations(body)).filter(([name]) => known.has(name)));
    if (!Object.keys(given).length) continue;
    for (const selector of selectors.split(",").map((word) => word.trim())) {
      if (!SELECTOR.test(selector) || body.includes("!")) {
        throw new InputError(
          `<style> sets ${Object.keys(given).join(", ")} of ${quoted(selector)}; read are a kind, a class or an id, `
          + "without !important; write attributes instead",
        );
      }
      rules.push({ selector, given });
    }
  }
  return rules.sort((a, b) => ".#".indexOf(a.selector[0]) - ".#".indexOf(b.selector[0]));
}

/* Read the declarations of a rule, or of the attribute style. */
function declarations(text) {
  const found = {};
  for (const part of text.replace(COMMENT, "").split(";")) {
    const at = part.indexOf(":");
    if (at >= 0) found[part.slice(0, at).trim().toLowerCase()] = part.slice(at + 1).trim().replace(IMPORTANT, "").trimEnd();
  }
  return found;
}

const MOST_NUMBERS = 50_000, DEEPEST = 100;
const SVG = "{http://www.w3.org/2000/svg}", XLINK = "{http://www.w3.org/1999/xlink}href";
const VISIBLE = new Map(Object.entries({ visible: true, hidden: false, collapse: false }));
const TRANSPARENT = /^(?:(?:0+(?:\.0+)?|\.0+)%?|-.*)$/;

/* The shapes of a drawing, and the lengths that it was read with, which tell whether its pixels have a size. */
class Drawing {
  constructor(root) {
    const styles = [];
    this.lengths = new Lengths();
    this.named = new Map();
    this.count = 0;
    this.open = [];
    this.shapes = [];
    for (const stack = [root]; stack.length; ) {
      const element = stack.pop();
      if (element.attributes.id) this.named.set(`#${element.attributes.id}`, element);
      if (kindOf(element) === "style") styles.push(element.text);
      stack.push(...element.children.toReversed());
    }
    this.rules = styleRules(styles.join("\n"));
    this.walk(root, { matrix: [1, 0, 0, 1, 0, 0], visible: true, unread: "" });
  }

  /* Find the shapes of an element. */
  walk(element, outer) {
    const kind = kindOf(element);
    if (kind.startsWith("{") || UNDRAWN.includes(kind)) return;
    if (MOVING.includes(kind)) throw new InputError(`<${kind}> is not read; remove it`);
    this.enter(element);
    const own = this.properties(element);
    if (own.display?.toLowerCase() !== "none" && !TRANSPARENT.test(own.opacity ?? "")) {
      const around = {
        matrix: product(outer.matrix, transformOf(own)),
        visible: VISIBLE.get(own.visibility?.toLowerCase()) ?? outer.visible,
        unread: outer.unread || this.unread(kind, own),
      };
      if (this.open.length === 1) around.matrix = product(around.matrix, fitted(own, this.lengths));
      if (Object.hasOwn(LENGTHS, kind) && around.visible) {
        const segments = shapeSegments(kind, own, this.lengths);
        if (around.unread && segments.length) {
          throw new InputError(`${around.unread} is not read; apply it in the drawing, or remove it`);
        }
        const moved = segments.map((segment) => transformed(around.matrix, segment));
        this.shapes.push({ kind, id: own.id, segments: moved });
      }
      if (kind === "use") {
        const [x, y] = ["x", "y"].map((name) => this.lengths.read(own, name));
        this.walk(this.shown(own), { ...around, matrix: product(around.matrix, [1, 0, 0, 1, x, y]) });
      }
      for (const part of element.children) this.walk(part, around);
    }
    this.open.pop();
  }

  /* Count an element and its numbers, and remember that it is open. */
  enter(element) {
    if (this.open.includes(element)) throw new InputError("a <use> shows a group that it belongs to; remove it");
    this.open.push(element);
    this.count += 1;
    for (const key of ["d", "points"]) this.count += element.attributes[key]?.match(NUMBER)?.length ?? 0;
    if (this.count > MOST_NUMBERS || this.open.length > DEEPEST) {
      throw new InputError(
        `the drawing has more than ${MOST_NUMBERS} shapes and coordinates, or groups in more than ${DEEPEST} levels; `
        + "simplify it",
      );
    }
  }

  /* An element's attributes; style sheets are stronger, and the attribute style is strongest. */
  properties(element) {
    const own = {};
    for (const [key, value] of Object.entries(element.attributes)) own[key] = value.trim();
    const classes = (own.class ?? "").split(/\s+/).map((name) => `.${name}`);
    const selectors = [kindOf(element), `#${own.id}`, ...classes];
    const given = this.rules.filter(({ selector }) => selectors.includes(selector)).map((rule) => rule.given);
    return Object.assign(own, ...given, declarations(own.style ?? ""));
  }

  /* Name what is not read of an element. */
  unread(kind, own) {
    if (kind === "svg" && this.open.length > 1) return "an <svg> in another";
    if (!(Object.hasOwn(LENGTHS, kind) || GROUPS.includes(kind))) return `<${kind}>`;
    const turned = UNREAD.filter((name) => "transform" in own || !name.startsWith("transform-"));
    return turned.find((name) => !HARMLESS.includes((own[name] ?? "").toLowerCase())) ?? "";
  }

  /* What a <use> shows. */
  shown(own) {
    const link = own.href ?? own[XLINK] ?? "", element = this.named.get(link);
    if (!element || kindOf(element) === "symbol") {
      throw new InputError(`a <use> shows ${quoted(link)}, which is no shape or group of the drawing; remove it`);
    }
    return element;
  }
}

/* The name of an element, with its namespace if that is another than SVG's. */
function kindOf({ tag }) {
  return tag.startsWith(SVG) ? tag.slice(SVG.length) : tag;
}

const METRES_PER_PIXEL = 0.0254 / 96; // of SVG
const TURN = 2 * (Math.PI / 180); // largest turn of a curve between two points
const PROBES = 64; // places on a curve where its direction is measured
const MOST_POINTS = 200_000;

/* Read the paths of a drawing: {paths: [{points, closed, name}], unit}, with the size of its unit in metres if the
 * drawing has physical units. In SVG y points down; here it points up.
 *
 * root: {tag, attributes, children, text} of its elements, with "{namespace}name" where they have one. where: its
 * name. */
function readDrawing(root, where) {
  if (kindOf(root) !== "svg") throw new InputError(`${where} is not SVG: it begins with <${kindOf(root)}>`);
  const { shapes, lengths } = naming(where, () => new Drawing(root)), paths = naming(where, () => namedPaths(shapes));
  if (!paths.size) {
    throw new InputError(`${where} has no path, line, polyline, polygon, rectangle, circle or ellipse; draw one`);
  }
  const upright = Array.from(paths, ([name, { points, ends }]) => {
    return { ...naming(where, () => pathOf(points.map(([x, y]) => [x + 0, -y + 0]), ends || null)), name };
  });
  return { paths: upright, unit: lengths.physical ? METRES_PER_PIXEL : null };
}

/* Points of every subpath by name. */
function namedPaths(shapes) {
  const paths = new Map(), counts = {};
  for (const { kind, id, segments } of shapes) {
    counts[kind] = (counts[kind] ?? 0) + 1;
    const count = counts[kind], name = id || `${kind}${count}`;
    const parts = subpaths(segments).filter(({ points }) => points.length > 1);
    parts.forEach((part, i) => {
      const own = parts.length === 1 ? name : `${name}/${i + 1}`;
      paths.set(paths.has(own) ? `${own}-${kind}${count}` : own, part);
    });
  }
  return paths;
}

/* Sample the points of each subpath, curves as polylines, and tell whether it is closed: [{points, ends}, …]. */
function subpaths(segments) {
  const parts = [];
  let part = { ends: true };
  for (const { kind, end, at } of segments) {
    if (kind === "move" || part.ends) parts.push((part = { points: [], ends: false }));
    part.ends = kind === "close";
    if (at === null) part.points.push(end);
    else for (let i = 1, count = enough(at); i <= count; i++) part.points.push(at(i / count));
    if (part.points.length > MOST_POINTS) {
      throw new InputError(`a curve of the drawing needs more than ${MOST_POINTS} points; simplify the drawing`);
    }
  }
  return parts;
}

/* The number of segments of a curve such that none turns by more than TURN. */
function enough(at) {
  const probes = Array.from({ length: PROBES + 1 }, (_, i) => at(i / PROBES)), angles = [];
  for (let i = 0; i < PROBES; i++) {
    const x = probes[i + 1][0] - probes[i][0], y = probes[i + 1][1] - probes[i][1];
    if (Math.hypot(x, y) > 0) angles.push(Math.atan2(y, x));
  }
  return Math.max(PROBES, stepsOf(PROBES * largestSize(differences(unwrap(angles))), TURN));
}

export { readDrawing };
