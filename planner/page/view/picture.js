/* The large picture as an SVG file of its own. */

/* Write an SVG element with its styles as text. Colours are those of light paper. */
function pictureText(svg, title, style) {
  const copy = svg.cloneNode(true);
  const [width, height] = [svg.clientWidth, svg.clientHeight];
  copy.setAttribute("xmlns", "http://www.w3.org/2000/svg");
  copy.setAttribute("viewBox", `0 0 ${width} ${height}`);
  for (const name of ["tabindex", "aria-labelledby", "aria-busy", "data-mode"]) copy.removeAttribute(name);
  const rules = document.createElementNS("http://www.w3.org/2000/svg", "style");
  rules.textContent = drawingRules(style);
  const name = document.createElementNS("http://www.w3.org/2000/svg", "title");
  name.textContent = title;
  copy.prepend(name, rules);
  return `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(copy)}\n`;
}

/* The rules of the page that concern lines and letters: those before the first condition. */
function drawingRules(style) {
  return (
    style.slice(0, style.indexOf("@media")) +
    style.slice(style.indexOf("svg text"), style.indexOf("/* end of lines */")).replace("0.75rem", "12px")
  );
}

export { pictureText };
