/* Elements of HTML and SVG, whose text is always set as text, never as markup; numbers for readers, lengths in cm and
 * times in s, min or h; the picture as a file of its own. */

const SVG = "http://www.w3.org/2000/svg";

/* Make an element of HTML with attributes (functions become listeners) and children (strings become text). */
function element(tag, attributes = {}, ...children) {
  return furnished(document.createElement(tag), attributes, children);
}

/* Make an element of SVG. */
function figure(tag, attributes = {}, ...children) {
  return furnished(document.createElementNS(SVG, tag), attributes, children);
}

function furnished(node, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") node.addEventListener(name, value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== null && value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children.flat());
  return node;
}

/* Find an element of the page by its id. */
function byId(id) {
  return document.getElementById(id);
}

/* Show words in an element; as an error where `bad`. */
function say(node, words, bad = false) {
  node.textContent = words;
  node.classList.toggle("bad", bad);
  node.hidden = words === "";
}

/* Fill a description list with pairs of a term and its description. */
function describe(list, pairs) {
  list.replaceChildren(...pairs.flatMap(([term, words]) => [element("dt", {}, term), element("dd", {}, words)]));
}

/* Offer a text as a file to save. */
function save(name, text, type = "text/plain") {
  const address = URL.createObjectURL(new Blob([text], { type }));
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

const LEAST = 0.001; // cm: the grid of points

/* A number to three digits, without an exponent where that is readable. */
function digits(value, count = 3) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(count - 1).replace("-", "−");
  const places = Math.max(0, count - 1 - Math.floor(Math.log10(size)));
  return value.toFixed(Math.min(places, 8)).replace("-", "−");
}

function duration(seconds) {
  const [size, unit] = seconds < 90 ? [1, "s"] : seconds < 5400 ? [60, "min"] : [3600, "h"];
  return `${digits(seconds / size)} ${unit}`;
}

/* Minutes and seconds of a clock: 3:07.5 */
function clock(seconds) {
  const tenths = Math.round(10 * seconds);
  return `${Math.floor(tenths / 600)}:${((tenths % 600) / 10).toFixed(1).padStart(4, "0")}`;
}

function degrees(radians) {
  return digits((radians * 180) / Math.PI);
}

/* A length in cm; with `tails`, in tail lengths behind it. */
function length(centimetres, tailLength, tails) {
  if (centimetres < LEAST) return `below ${LEAST} cm`;
  return tails ? `${digits(centimetres)} cm (${digits(centimetres / tailLength)} l)` : `${digits(centimetres)} cm`;
}

/* Write an SVG element with its styles as text. Colours are those of light paper. */
function pictureText(svg, title, style) {
  const copy = svg.cloneNode(true);
  copy.setAttribute("viewBox", `0 0 ${svg.clientWidth} ${svg.clientHeight}`);
  for (const name of ["tabindex", "aria-labelledby", "aria-busy", "data-mode"]) copy.removeAttribute(name);
  copy.prepend(figure("title", {}, title), figure("style", {}, drawingRules(style)));
  return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(copy)}\n`;
}

/* The rules of the page that concern lines and letters: those before the first condition. */
function drawingRules(style) {
  const lines = style.slice(style.indexOf("svg text"), style.indexOf("/* end of lines */"));
  return style.slice(0, style.indexOf("@media")) + lines.replace("0.75rem", "12px");
}

export { byId, clock, degrees, describe, digits, duration, element, figure, length, pictureText, save, say };
