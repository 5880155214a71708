/* Paths from SVG drawings: the shapes that a drawing shows, each where it is seen.
 *
 * What the elements around an element do to it is {matrix, view, visible, unread, clips}; a clip is {name, matrix,
 * low, high}; a shape is {kind, id, segments, clips}; a rule of a style sheet {kind, names, given, weight}. */
import { differences, largestSize, unwrap } from "./math.js";
import { pathOf, stepsOf } from "./path.js";
import { NAMES, NUMBER, Lengths, fitted, moved, numbersIn, product, shapeSegments } from "./svg_shapes.js";
import { transformed, transformOf, unread } from "./svg_shapes.js";
import { InputError, naming, quoted, trimmedEnd } from "./words.js";

const COMMENT = /\/\*[^]*?(?:\*\/|$)|<!--|-->/g;
const NO_RULE = /@(?:charset|namespace)[^;{}@]*;|@font-face\s*\{[^{}]*\}/gi;
const RULE = /(?<![^{}])([^{}]*)\{([^{}]*)\}/g;
const SELECTOR = /^(\*|[\p{L}\p{N}_-]*)((?:[.#][\p{L}\p{N}_-]+)*)$/u;
const IMPORTANT = /!\s*important$/i;

/* Read the rules that declare one of the `known` properties, the weakest first. */
function readStyleSheet(text, known) {
  const bare = text.replace(COMMENT, "").replace(NO_RULE, ""), rest = bare.replace(RULE, "").trim(), rules = [];
  if (rest) throw new InputError(`<style> is not read from ${quoted(rest.slice(0, 30))} on; write attributes instead`);
  for (const [, selectors, body] of bare.matchAll(RULE)) {
    const given = Object.fromEntries(Object.entries(declarations(body)).filter(([name]) => known.has(name)));
    if (!Object.keys(given).length) continue;
    for (const selector of selectors.split(",").map((word) => word.trim())) {
      const found = SELECTOR.exec(selector);
      if (!found || IMPORTANT.test(trimmedEnd(body.trim(), ";"))) {
        throw new InputError(
          `<style> sets ${Object.keys(given).join(", ")} of ${quoted(selector)}; read are kinds, classes and ids, without `
          + "!important; write attributes instead",
        );
      }
      const names = found[2].match(/[.#][^.#]+/g) ?? [], ids = names.filter((name) => name.startsWith("#")).length;
      const weight = 1e6 * ids + 10 * (names.length - ids) + (found[1] && found[1] !== "*" ? 1 : 0);
      rules.push({ kind: found[1], names, given, weight });
    }
  }
  return rules.sort((a, b) => a.weight - b.weight);
}

/* What rules declare for an element. */
function declared(rules, kind, attributes) {
  const classes = (attributes.class ?? "").split(/\s+/).map((name) => `.${name}`);
  const own = new Set([...classes, `#${attributes.id}`]), found = {};
  for (const rule of rules) {
    const applies = ["", "*", kind].includes(rule.kind) && rule.names.every((name) => own.has(name));
    if (applies) Object.assign(found, rule.given);
  }
  return found;
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
const LINK = /^url\(\s*["']?(#[^"')\s]+)["']?\s*\)$/;
const VISIBLE = { visible: true, hidden: false, collapse: false };
const SIZE = ["width", "height"];
const AROUND = { matrix: [1, 0, 0, 1, 0, 0], view: [null, null], visible: true, unread: "", clips: [] };

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
    const known = [...NAMES.read, ...Object.keys(NAMES.lengths), ...Object.keys(NAMES.unread)];
    this.rules = readStyleSheet(styles.join("\n"), new Set(known));
    this.walk(root, AROUND, null);
  }

  /* Find the shapes of an element; used: width and height of the <use> that shows it. */
  walk(element, outer, used) {
    const kind = kindOf(element), isShape = NAMES.shapes.includes(kind);
    if (kind.startsWith("{") || NAMES.undrawn.includes(kind) || (kind === "symbol" && used === null)) return;
    if (!isShape && !NAMES.groups.includes(kind)) throw new InputError(`<${kind}> is not read; remove it`);
    this.enter(element);
    const own = this.properties(element);
    if (!hidden(own)) {
      let around = this.inside(own, outer);
      if (isShape) {
        const drawn = shapeSegments(kind, own, this.lengths, around.view);
        if (drawn !== null && around.visible) {
          if (around.unread) {
            throw new InputError(`${around.unread} is not read; apply it in the drawing, or remove it`);
          }
          const segments = drawn.map((segment) => transformed(around.matrix, segment));
          this.shapes.push({ kind, id: own.id, segments, clips: around.clips });
        }
      } else if (kind === "svg" || kind === "symbol") {
        around = this.inView({ ...own, ...used }, around);
      } else if (kind === "use") {
        const [x, y] = ["x", "y"].map((name) => this.lengths.read(own, name, around.view, 0));
        const size = Object.fromEntries(SIZE.filter((name) => name in own).map((name) => [name, own[name]]));
        this.walk(this.shown(own), { ...around, matrix: product(around.matrix, [1, 0, 0, 1, x, y]) }, size);
      }
      if (!around.view.includes(0)) for (const part of partsOf(element)) this.walk(part, around, null);
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
    return { ...own, ...declared(this.rules, kindOf(element), own), ...declarations(own.style ?? "") };
  }

  /* What a <use> shows. */
  shown(own) {
    const link = own.href ?? own[XLINK] ?? "", element = this.named.get(link);
    if (!element) throw new InputError(`a <use> shows ${quoted(link)}, which is not in the drawing; remove it`);
    return element;
  }

  /* Apply an element's transform, visibility and clip path. */
  inside(own, around) {
    const unread = Object.keys(NAMES.unread).filter(
      (name) => !["", ...NAMES.unread[name]].includes((own[name] ?? "").toLowerCase()) &&
        ("transform" in own || !name.startsWith("transform-")),
    );
    const inner = {
      ...around,
      matrix: product(around.matrix, transformOf(own)),
      visible: VISIBLE[(own.visibility ?? "").toLowerCase()] ?? around.visible,
      unread: around.unread || (unread[0] ?? ""),
    };
    if ((own["clip-path"] ?? "none") === "none") return inner;
    const clip = this.clip(own["clip-path"], inner);
    return clip ? { ...inner, clips: [...inner.clips, clip] } : { ...inner, unread: "clip-path" };
  }

  /* Read a clip path that is an upright rectangle; null: it is another. */
  clip(words, around) {
    const element = this.named.get(LINK.exec(words)?.[1]), [part, ...others] = element?.children ?? [];
    if (!part || others.length || !NAMES.shapes.includes(kindOf(part))) return null;
    const group = this.properties(element), own = this.properties(part);
    if (["clip-path", "clipPathUnits", "display", "visibility"].some((name) => name in group || name in own)) {
      return null;
    }
    const inner = this.inside(own, this.inside(group, around));
    const segments = shapeSegments(kindOf(part), own, this.lengths, around.view) ?? [];
    const corners = segments.map(({ end }) => end);
    const upright = corners.every(([x, y], i) => !i || x === corners[i - 1][0] || y === corners[i - 1][1]);
    const straight = segments.every(({ at }) => at === null);
    const axes = [0, 1].map((axis) => [...new Set(corners.map((point) => point[axis]))].sort((a, b) => a - b));
    const four = new Set(corners.map(String)).size === 4;
    if (!four || axes.some(({ length }) => length !== 2) || !upright || !straight) return null;
    const [low, high] = [0, 1].map((i) => axes.map((axis) => axis[i]));
    return inner.unread || flat(inner.matrix) ? null : { name: "clip-path", matrix: inner.matrix, low, high };
  }

  /* Enter an <svg> or a <symbol>: its place, its size, its viewBox. */
  inView(own, around) {
    const numbers = numbersIn(own, "viewBox"), box = numbers.length ? numbers : null;
    const outer = this.open.length === 1;
    if (box && (box.length !== 4 || Math.min(box[2], box[3]) < 0)) {
      unread(own, "viewBox", "give left, top, width and height");
    }
    const place = ["x", "y"].map((name) => (outer ? 0 : this.lengths.read(own, name, around.view, 0)));
    const size = outer ? this.outerSize(own, box)
      : SIZE.map((name, i) => this.lengths.read(own, name, around.view, around.view[i]));
    if (Math.min(...size.map((length) => length ?? 0)) < 0) {
      throw new InputError("the width or height of an <svg> is below 0; correct it");
    }
    const shift = [1, 0, 0, 1, ...place];
    if (size.includes(null)) {
      if (box) throw new InputError("an <svg> in another has no size; give it width and height");
      return { ...around, matrix: product(around.matrix, shift), view: size };
    }
    const clips = [...around.clips];
    if (!outer && !["visible", "auto"].includes(own.overflow) && !flat(around.matrix)) {
      const high = place.map((low, i) => low + size[i]);
      clips.push({ name: "<svg>", matrix: around.matrix, low: place, high });
    }
    const view = !box ? size : size.includes(0) ? [0, 0] : box.slice(2);
    const fits = box && !view.includes(0);
    const inner = fits ? fitted(own, place, size, box) : shift;
    return { ...around, matrix: product(around.matrix, inner), view, clips };
  }

  /* Width and height of the drawing; what is missing, or in per cent, follows from the viewBox. */
  outerSize(own, box) {
    const read = (name) => this.lengths.read(own, name, [null, null]);
    const size = SIZE.map((name) => (own[name]?.endsWith("%") ? null : read(name)));
    if (!box) return size;
    this.lengths.sized = size.some((length) => length !== null);
    const scales = size.map((length, i) => length && box[2 + i] && length / box[2 + i]);
    const scale = scales.find((each) => each) ?? 1;
    return size.map((length, i) => length ?? scale * box[2 + i]);
  }
}

/* Tell whether a clip hides one of some points, in pixels. */
function hides({ matrix: [a, b, c, d, e, f], low, high }, points) {
  const size = a * d - b * c, slack = 1e-6 * Math.max(high[0] - low[0], high[1] - low[1]);
  const back = [d / size, -b / size, -c / size, a / size, (c * f - d * e) / size, (b * e - a * f) / size];
  return points.some((point) => {
    const own = moved(back, point);
    return own.some((value, i) => value < low[i] - slack || value > high[i] + slack);
  });
}

/* The name of an element, with its namespace if that is another than SVG's. */
function kindOf({ tag }) {
  return tag.startsWith(SVG) ? tag.slice(SVG.length) : tag;
}

/* The children that are shown; those of a <switch> are alternatives. */
function partsOf(element) {
  if (kindOf(element) !== "switch") return element.children;
  return element.children.filter(({ attributes }) => !attributes.requiredExtensions).slice(0, 1);
}

/* Tell whether an element is hidden with all that it holds. */
function hidden(own) {
  const opacity = trimmedEnd(own.opacity ?? "1", "%");
  const transparent = opacity.trim() !== "" && Number(opacity) <= 0;
  return transparent || own.display?.toLowerCase() === "none" || Boolean(own.requiredExtensions);
}

function flat([a, b, c, d]) {
  return a * d === b * c;
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
  for (const { kind, id, segments, clips } of shapes) {
    counts[kind] = (counts[kind] ?? 0) + 1;
    const count = counts[kind], name = id || `${kind}${count}`;
    const parts = subpaths(segments).filter(({ points }) => points.length > 1);
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
