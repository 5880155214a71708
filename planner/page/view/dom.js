/* Elements of HTML and SVG. Text is always set as text, never as markup. */

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

export { byId, describe, element, figure, save, say };
