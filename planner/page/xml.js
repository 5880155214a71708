/* XML as drawings are written in it: elements with attributes and text; comments are left out.
 *
 * Stands for xml.etree.ElementTree in planner/paths/svg_drawing.py; refusals have the words of its parser. Nothing
 * of a drawing is put into the page. */

const NAME = /[^\s<>/=!?"'&]+/y;
const ENTITIES = { lt: "<", gt: ">", amp: "&", quot: '"', apos: "'" };
const MARKS = [["<!--", "-->"], ["<?", "?>"]]; // what is skipped, from and to
const VERBATIM = "<![CDATA[", OWN_ENTITY = /<!ENTITY\s+([^\s%]+)\s+(?:"([^"&%]*)"|'([^'&%]*)')\s*>/g;

class XmlError extends Error {}

/* Parse a document: {tag, attributes, children, text}. A tag or attribute in a namespace is "{namespace}name". */
function parseXml(text) {
  return new XmlParser(text.replace(/^\ufeff/, "")).document();
}

class XmlParser {
  constructor(text) {
    this.text = text;
    this.at = 0;
    this.entities = { ...ENTITIES };
  }

  refuse(reason, at = this.at) {
    const lines = this.text.slice(0, at).split("\n");
    throw new XmlError(`${reason}: line ${lines.length}, column ${lines[lines.length - 1].length}`);
  }

  document() {
    const open = [];
    let root = null;
    for (;;) {
      const next = this.text.indexOf("<", this.at);
      const between = this.text.slice(this.at, next < 0 ? undefined : next);
      if (!open.length && between.trim()) this.refuse(root ? "junk after document element" : "syntax error");
      if (next < 0) {
        if (root && !open.length) return root;
        this.refuse("no element found", this.text.length);
      }
      this.at = next;
      if (open.length) open[open.length - 1].text += this.decoded(between);
      if (open.length && this.text.startsWith(VERBATIM, next)) {
        open[open.length - 1].text += this.verbatim();
        continue;
      }
      if (this.skipped()) continue;
      if (this.text.startsWith("</", next)) {
        this.close(open);
        continue;
      }
      if (root && !open.length) this.refuse("junk after document element");
      const { element, empty } = this.element(open[open.length - 1]?.spaces ?? {});
      if (root) open[open.length - 1].children.push(element);
      else root = element;
      if (!empty) open.push(element);
    }
  }

  /* Read a text that is marked as such. */
  verbatim() {
    const end = this.text.indexOf("]]>", this.at);
    if (end < 0) this.refuse("unclosed CDATA section");
    const text = this.text.slice(this.at + VERBATIM.length, end);
    this.at = end + 3;
    return text;
  }

  /* Skip a comment or a declaration, of which entities are kept. */
  skipped() {
    for (const [from, to] of MARKS) {
      if (!this.text.startsWith(from, this.at)) continue;
      const end = this.text.indexOf(to, this.at + from.length);
      if (end < 0) this.refuse("unclosed token");
      this.at = end + to.length;
      return true;
    }
    if (!this.text.startsWith("<!", this.at)) return false;
    const end = /^<![^[>]*(?:\[[^\]]*\]\s*)?>/.exec(this.text.slice(this.at));
    if (!end) this.refuse("unclosed token");
    for (const [, name, one, two] of end[0].matchAll(OWN_ENTITY)) this.entities[name] ??= one ?? two;
    this.at += end[0].length;
    return true;
  }

  close(open) {
    const end = this.text.indexOf(">", this.at), element = open.pop();
    if (end < 0) this.refuse("unclosed token");
    if (!element || this.text.slice(this.at + 2, end).trim() !== element.name) {
      this.refuse("mismatched tag", this.at + 2);
    }
    this.at = end + 1;
  }

  name() {
    NAME.lastIndex = this.at;
    const [name] = NAME.exec(this.text) ?? [""];
    if (!name) this.refuse(this.at < this.text.length ? "not well-formed (invalid token)" : "unclosed token");
    this.at += name.length;
    return name;
  }

  blanks() {
    while (/\s/.test(this.text[this.at] ?? "")) this.at++;
  }

  element(outer) {
    const start = this.at++, name = this.name(), given = new Map();
    for (this.blanks(); this.at < this.text.length && !/[/>]/.test(this.text[this.at]); this.blanks()) {
      const key = this.name();
      if (given.has(key)) this.refuse("duplicate attribute");
      this.blanks();
      if (this.text[this.at++] !== "=") this.refuse("not well-formed (invalid token)", this.at - 1);
      this.blanks();
      given.set(key, this.quoted(start));
    }
    if (this.at >= this.text.length) this.refuse("unclosed token", start);
    const empty = this.text[this.at] === "/";
    this.at += empty ? 2 : 1;
    if (empty && this.text[this.at - 1] !== ">") this.refuse("not well-formed (invalid token)", this.at - 1);
    const spaces = { ...outer };
    for (const [key, value] of given) {
      if (key === "xmlns") spaces[""] = value;
      else if (key.startsWith("xmlns:")) spaces[key.slice(6)] = value;
    }
    const attributes = {};
    for (const [key, value] of given) {
      const isSpace = key === "xmlns" || key.startsWith("xmlns:");
      if (!isSpace) attributes[key.includes(":") ? full(key, spaces) : key] = value;
    }
    return { element: { tag: full(name, spaces), name, attributes, children: [], text: "", spaces }, empty };
  }

  quoted(start) {
    const quote = this.text[this.at];
    if (quote !== '"' && quote !== "'") this.refuse("not well-formed (invalid token)");
    const end = this.text.indexOf(quote, this.at + 1);
    if (end < 0) this.refuse("unclosed token", start);
    const value = this.text.slice(this.at + 1, end);
    if (value.includes("<")) this.refuse("not well-formed (invalid token)", this.at + 1 + value.indexOf("<"));
    this.at = end + 1;
    return this.decoded(value.replace(/[\t\n\r]/g, " "));
  }

  decoded(text) {
    return text.replace(/&([^;]*);/g, (_, name) => this.entity(name));
  }

  entity(name) {
    const code = /^#(?:x([\da-fA-F]+)|(\d+))$/.exec(name);
    if (code) return String.fromCodePoint(code[1] ? parseInt(code[1], 16) : Number(code[2]));
    return this.entities[name] ?? this.refuse("undefined entity");
  }
}

/* The name with its namespace. */
function full(name, spaces) {
  const [prefix, local] = name.includes(":") ? name.split(":") : ["", name];
  return spaces[prefix] ? `{${spaces[prefix]}}${local}` : local;
}

export { XmlError, parseXml };
