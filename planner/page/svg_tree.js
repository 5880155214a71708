/* The shapes that an SVG drawing shows, each where it is seen.
 *
 * Mirrors planner/paths/svg_tree.py. What the elements around an element do to it is {matrix, view, visible,
 * unread, clips}; a clip is {name, matrix, low, high}; a shape is {kind, id, segments, clips}. */
import { pythonText } from "./format.js";
import { InputError } from "./input_error.js";
import { declarations, declared, readStyleSheet } from "./style_sheet.js";
import { NAMES } from "./svg_names.js";
import { moved, product, transformed } from "./svg_segments.js";
import { Lengths, NUMBER, fitted, numbersIn, shapeSegments, transformOf } from "./svg_shapes.js";
import { XmlError } from "./xml.js";

const MOST_NUMBERS = 50_000, DEEPEST = 100;
const SVG = "{http://www.w3.org/2000/svg}", XLINK = "{http://www.w3.org/1999/xlink}href";
const LINK = /^url\(\s*["']?(#[^"')]+)["']?\s*\)$/;
const VISIBLE = { visible: true, hidden: false, collapse: false };
const SIZE = ["width", "height"];
const AROUND = { matrix: [1, 0, 0, 1, 0, 0], view: [null, null], visible: true, unread: "", clips: [] };

/* Find the shapes of a drawing, and whether its pixels have a size: {shapes, physical}. */
function readTree(root) {
  if (kindOf(root) !== "svg") throw new XmlError(`it begins with <${kindOf(root)}>`);
  const reader = new TreeReader(root);
  reader.walk(root, AROUND, null);
  return { shapes: reader.shapes, physical: reader.lengths.physical };
}

class TreeReader {
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
        `the drawing has more than ${MOST_NUMBERS} shapes and coordinates, or groups in more than ` +
        `${DEEPEST} levels; ` +
          "simplify it",
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
    if (!element)
      throw new InputError(`a <use> shows ${pythonText(link)}, which is not in the drawing; remove it`);
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
      matrix: product(around.matrix, transformOf(own.transform ?? "none")),
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
    const corners = segments.map(({ points }) => points[0]);
    const upright = corners.every(([x, y], i) => !i || x === corners[i - 1][0] || y === corners[i - 1][1]);
    const straight = segments.every(({ kind }) => ["move", "line", "close"].includes(kind));
    const axes = [0, 1].map((axis) => [...new Set(corners.map((point) => point[axis]))].sort((a, b) => a - b));
    const four = new Set(corners.map(String)).size === 4;
    if (!four || axes.some(({ length }) => length !== 2) || !upright || !straight) {
      return null;
    }
    const [low, high] = [0, 1].map((i) => axes.map((axis) => axis[i]));
    return inner.unread || flat(inner.matrix) ? null : { name: "clip-path", matrix: inner.matrix, low, high };
  }

  /* Enter an <svg> or a <symbol>: its place, its size, its viewBox. */
  inView(own, around) {
    const numbers = numbersIn(own, "viewBox"), box = numbers.length ? numbers : null;
    const outer = this.open.length === 1;
    if (box && (box.length !== 4 || Math.min(box[2], box[3]) < 0)) {
      throw new InputError(`viewBox=${pythonText(own.viewBox)} is not read; give left, top, width and height`);
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
    const inner = fits ? fitted(own.preserveAspectRatio, place, size, box) : shift;
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
  const opacity = (own.opacity ?? "1").replace(/%+$/, "");
  const transparent = opacity.trim() !== "" && Number(opacity) <= 0;
  return transparent || own.display?.toLowerCase() === "none" || Boolean(own.requiredExtensions);
}

function flat([a, b, c, d]) {
  return a * d === b * c;
}

export { hides, readTree };
