/* The one file that a user drops or chooses: what is wrong with it, a drawing as a tree of plain objects, and the
 * question for the unit of a path that does not say it, or for one of several paths. */
import { textOf } from "../data.js";
import { bounds } from "../math.js";
import { InputError, refusing } from "../words.js";
import { byId, digits, element, say } from "./dom.js";

const MOST_BYTES = 20e6;

/* Read it: {name, bytes, tree}, the tree of a drawing, or {refusal}; null: there is none. */
async function oneFile(files) {
  if (files.length === 0) return null;
  if (files.length > 1) return { refusal: "Give one file at a time." };
  const [{ name, size }] = files;
  if (size > MOST_BYTES) {
    return { refusal: `${name} has ${Math.round(size / 1e6)} MB; the page reads up to ${MOST_BYTES / 1e6} MB.` };
  }
  const bytes = await files[0].arrayBuffer().catch(() => null); // null: of a folder, or of a file that is gone
  if (bytes === null) return { refusal: `${name} cannot be read; give a file.` };
  if (!/\.svg$/i.test(name)) return { name, bytes };
  return refusing(() => ({ name, tree: drawingTree(textOf(bytes, name), name) }), ({ message }) => ({ refusal: message }));
}

/* What is wrong with the last file or link, beside the part of the page that it is for; the next one takes it away. */
class Problem {
  place = null;
  words = "";

  /* Say it beside a part, such as path; empty words: nothing is wrong. */
  tell(part, words) {
    if (this.place?.textContent === this.words) say(this.place, "", true);
    this.place = byId(`${part}-problem`);
    this.words = words;
    if (words) say(this.place, words, true);
  }
}

const DEEPEST = 200; // levels; the planner refuses fewer
const LIVE = /http:\/\/www\.w3\.org\/(?=2000\/svg|1999\/xhtml)/g;

/* Read the text of a drawing: {tag, attributes, children, text} of its elements, "{namespace}name" where they have
 * one. */
function drawingTree(text, name) {
  if (text.includes("<?xml-stylesheet")) {
    throw new InputError(`${name}: <?xml-stylesheet> is not read; save the drawing with its style`);
  }
  const page = new DOMParser().parseFromString(text.replace(LIVE, "inert:"), "application/xml");
  const broken = page.querySelector("parsererror");
  if (broken) {
    const [why] = broken.textContent.replace(/^.*?following errors:/, "").split("\n");
    throw new InputError(`${name} is not SVG: ${why.trim()}`);
  }
  return plain(page.documentElement, DEEPEST);
}

function plain(element, levels) {
  const live = (words) => words.replaceAll("inert:", "http://www.w3.org/");
  const named = ({ namespaceURI, localName }) => (namespaceURI ? `{${live(namespaceURI)}}${localName}` : localName);
  const given = Array.from(element.attributes).filter(({ name }) => !/^xmlns(?::|$)/.test(name));
  return {
    tag: named(element),
    attributes: Object.fromEntries(given.map((attribute) => [named(attribute), live(attribute.value)])),
    children: levels ? Array.from(element.children, (child) => plain(child, levels - 1)) : [],
    text: Array.from(element.childNodes, (node) => ([3, 4].includes(node.nodeType) ? node.data : "")).join(""),
  };
}

const UNITS = { mm: 0.1, cm: 1, m: 100, in: 2.54 };

/* Ask; the promise resolves with {points [cm], closed, name}, or null if the user takes none. others: sizes of further
 * units by their names [cm]. */
function askUnit({ paths, unit }, others) {
  if (unit !== null && paths.length === 1) return Promise.resolve(inUnit(paths[0], unit));
  const dialog = byId("unit-dialog"), asks = unit === null, several = paths.length > 1;
  const scales = Object.entries(asks ? { ...UNITS, ...others } : { "as the file says": unit });
  const choice = (group, value, words, checked) => {
    const input = element("input", { type: "radio", name: group, value, checked, autofocus: checked });
    return element("label", { class: "choice" }, input, words);
  };
  const chosen = (name) => Number(dialog.querySelector(`[name=${name}]:checked`)?.value ?? 0);
  const sizes = () => {
    const size = bounds(paths[chosen("path")].points).map(([low, high]) => high - low);
    return scales.map(([name, scale]) => `${name}: ${size.map((value) => digits(value * scale)).join(" × ")} cm`);
  };
  const names = paths.map((path, i) => choice("path", i, path.name || `path ${i + 1}`, i === 0));
  byId("path-choices").replaceChildren(...(several ? names : []));
  const units = sizes().map((words, i) => choice("unit", scales[i][1], words, i === Number(asks)));
  byId("unit-choices").replaceChildren(...units);
  byId("unit-title").textContent = several ? "Which path of this file?" : "Which unit has this file?";
  byId("unit-words").textContent = asks ? "The file does not say its unit. Width and height would be:" : "";
  dialog.onchange = () => sizes().forEach((words, i) => (units[i].lastChild.data = words));
  dialog.returnValue = ""; // else that of the file before, where Escape leaves it
  dialog.showModal();
  return new Promise((resolve) => {
    const closed = () => resolve(dialog.returnValue === "take" ? inUnit(paths[chosen("path")], chosen("unit")) : null);
    dialog.addEventListener("close", closed, { once: true });
  });
}

function inUnit({ points, closed, name }, scale) {
  return { points: points.map((point) => point.map((value) => value * scale)), closed, name };
}

export { askUnit, drawingTree, oneFile, Problem };
