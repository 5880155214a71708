/* A drawing as a tree of plain objects, read by the browser's parser of XML. The document stays inert, and nothing of it is
 * put into the page: its namespaces are given other names, so that its elements have no style and no script. */

import { InputError } from "../words.js";

const MOST_TEXT = 16 * 2 ** 20;
const DEEPEST = 200; // levels; the planner refuses fewer
const LIVE = /http:\/\/www\.w3\.org\/(?=2000\/svg|1999\/xhtml)/g;

/* Read the text of a drawing: {tag, attributes, children, text} of its elements, "{namespace}name" where they have
 * one. */
function drawingTree(text, name) {
  if (text.length > MOST_TEXT) throw new InputError(`${name} has more than 16 MiB; such a file is not read`);
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

export { drawingTree };
