/* TOML as robots are written in it: tables, dotted keys, texts of one line, numbers, truth values, arrays.
 *
 * Mirrors `read_toml` of sim/io/reading.py, which uses Python's tomllib; refusals have its words. Dates, texts of
 * several lines, inline tables and arrays of tables, which no robot has, are refused as invalid values. */
import { InputError } from "./input_error.js";
import { pythonText } from "./format.js";

const MOST_SETTINGS = 2 ** 20; // characters of a robot
const OTHER_BASES = /0(?:x[\da-fA-F](?:_?[\da-fA-F])*|b[01](?:_?[01])*|o[0-7](?:_?[0-7])*)/;
const DECIMAL = /[+-]?(?:0|[1-9](?:_?\d)*)(?:\.\d(?:_?\d)*)?(?:[eE][+-]?\d(?:_?\d)*)?/;
const NUMBER = new RegExp(`${OTHER_BASES.source}|${DECIMAL.source}`, "y");
const ESCAPES = { b: "\b", t: "\t", n: "\n", f: "\f", r: "\r", '"': '"', "\\": "\\" };
const HIDDEN = /[\x00-\x08\x0a-\x1f\x7f]/;
const DECIMAL_COMMA = /^[ \t]*[\w-]+[ \t]*=[ \t]*([+-]?\d{1,20}),(\d{1,20})[ \t]*(?:#.*)?$/m;

/* Read a text: tables as objects without a prototype. where: the file's name, for messages. */
function readToml(text, where) {
  if (text.length > MOST_SETTINGS) {
    throw new InputError(`${where} has more than 1 MiB; such a file is not read`);
  }
  try {
    return new Parser(text.replace(/^\ufeff/, "").replaceAll("\r\n", "\n")).document();
  } catch (broken) {
    if (!(broken instanceof Broken)) throw broken;
    const comma = DECIMAL_COMMA.exec(text);
    const advice = comma ? `; write ${comma[1]}.${comma[2]} for ${comma[1]},${comma[2]}` : "";
    throw new InputError(`${where} is not TOML: ${broken.message}${advice}`);
  }
}

class Broken extends Error {}

class Parser {
  constructor(text) {
    this.text = text;
    this.at = 0;
    this.declared = new Set();
  }

  refuse(reason, at = this.at) {
    const before = this.text.slice(0, at).split("\n");
    const place = `line ${before.length}, column ${before[before.length - 1].length + 1}`;
    throw new Broken(`${reason} (at ${at >= this.text.length ? "end of document" : place})`);
  }

  get sign() {
    return this.text[this.at];
  }

  skip(signs) {
    while (this.at < this.text.length && signs.includes(this.sign)) this.at++;
  }

  comment() {
    if (this.sign !== "#") return;
    for (; this.at < this.text.length && this.sign !== "\n"; this.at++) {
      if (HIDDEN.test(this.sign)) this.refuse(`Found invalid character ${pythonText(this.sign)}`);
    }
  }

  document() {
    const root = Object.create(null);
    let header = [];
    for (;;) {
      this.skip(" \t");
      if (this.at >= this.text.length) return root;
      if (this.sign === "\n") {
        this.at++;
        continue;
      }
      if (this.sign === "[") header = this.table(root);
      else if (/[\w"'-]/.test(this.sign)) this.entry(root, header);
      else if (this.sign !== "#") this.refuse("Invalid statement");
      this.skip(" \t");
      this.comment();
      if (this.at >= this.text.length) return root;
      if (this.sign !== "\n") this.refuse("Expected newline or end of document after a statement");
      this.at++;
    }
  }

  table(root) {
    this.at++;
    this.skip(" \t");
    const key = this.key(), name = JSON.stringify(key);
    if (this.declared.has(name)) {
      this.refuse(`Cannot declare (${key.map(pythonText).join(", ")}${key.length === 1 ? "," : ""}) twice`);
    }
    this.declared.add(name);
    this.nest(root, key);
    if (this.sign !== "]") this.refuse("Expected ']' at the end of a table declaration");
    this.at++;
    return key;
  }

  entry(root, header) {
    const key = this.key();
    if (this.sign !== "=") this.refuse("Expected '=' after a key in a key/value pair");
    this.at++;
    this.skip(" \t");
    const value = this.value(), last = key.pop(), nest = this.nest(root, [...header, ...key]);
    if (last in nest) this.refuse("Cannot overwrite a value");
    nest[last] = value;
  }

  /* The table behind a key, made where it is missing. */
  nest(root, key) {
    let nest = root;
    for (const part of key) {
      if (!(part in nest)) nest[part] = Object.create(null);
      nest = nest[part];
      if (typeof nest !== "object" || Array.isArray(nest)) this.refuse("Cannot overwrite a value");
    }
    return nest;
  }

  key() {
    const parts = [];
    for (;;) {
      parts.push(this.keyPart());
      this.skip(" \t");
      if (this.sign !== ".") return parts;
      this.at++;
      this.skip(" \t");
    }
  }

  keyPart() {
    const bare = /[A-Za-z0-9_-]+/y;
    bare.lastIndex = this.at;
    const [word] = bare.exec(this.text) ?? [""];
    if (word) {
      this.at += word.length;
      return word;
    }
    if (this.sign === '"') return this.basicText();
    if (this.sign === "'") return this.literalText();
    return this.refuse("Invalid initial character for a key part");
  }

  /* A text in double quotes. */
  basicText() {
    let value = "";
    for (this.at++; this.sign !== '"'; this.at++) {
      if (this.at >= this.text.length) this.refuse("Unterminated string");
      if (this.sign === "\\") value += this.escaped();
      else if (HIDDEN.test(this.sign)) this.refuse(`Illegal character ${pythonText(this.sign)}`);
      else value += this.sign;
    }
    this.at++;
    return value;
  }

  /* A text in single quotes, without escapes. */
  literalText() {
    const start = this.at + 1, end = this.text.indexOf("'", start);
    if (end < 0) this.refuse('Expected "\'"', this.text.length);
    const value = this.text.slice(start, end), hidden = HIDDEN.exec(value);
    if (hidden) this.refuse(`Found invalid character ${pythonText(hidden[0])}`, start + hidden.index);
    this.at = end + 1;
    return value;
  }

  /* What an escape stands for; the place moves to its last sign. */
  escaped() {
    const kind = this.text[++this.at];
    if (kind in ESCAPES) return ESCAPES[kind];
    const length = { u: 4, U: 8 }[kind];
    if (!length) this.refuse("Unescaped '\\' in a string", this.at + 1);
    const digits = this.text.slice(this.at + 1, this.at + 1 + length);
    if (!/^[\da-fA-F]+$/.test(digits) || digits.length < length) this.refuse("Invalid hex value", this.at + 1);
    const code = parseInt(digits, 16);
    this.at += length;
    if (code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) {
      this.refuse("Escaped character is not a Unicode scalar value", this.at + 1);
    }
    return String.fromCodePoint(code);
  }

  value() {
    const { text, at } = this;
    if (this.sign === '"' && !text.startsWith('"""', at)) return this.basicText();
    if (this.sign === "'" && !text.startsWith("'''", at)) return this.literalText();
    for (const [word, value] of [["true", true], ["false", false]]) {
      if (text.startsWith(word, at)) {
        this.at += word.length;
        return value;
      }
    }
    if (this.sign === "[") return this.array();
    NUMBER.lastIndex = at;
    const [number] = NUMBER.exec(text) ?? [""];
    if (number && !/^\d{4}-\d\d-|^\d\d:\d\d/.test(text.slice(at, at + 8))) {
      this.at += number.length;
      return Number(number.replaceAll("_", ""));
    }
    const [special] = /^[+-]?(?:inf|nan)/.exec(text.slice(at, at + 4)) ?? [""];
    if (!special) this.refuse("Invalid value");
    this.at += special.length;
    return special.endsWith("nan") ? NaN : special.startsWith("-") ? -Infinity : Infinity;
  }

  array() {
    const values = [];
    this.at++;
    this.blanks();
    while (this.sign !== "]") {
      values.push(this.value());
      this.blanks();
      if (this.sign === "]") break;
      if (this.sign !== ",") this.refuse("Unclosed array");
      this.at++;
      this.blanks();
    }
    this.at++;
    return values;
  }

  /* Skip blanks, ends of lines and comments. */
  blanks() {
    for (let before = -1; before !== this.at; ) {
      before = this.at;
      this.skip(" \t\n");
      this.comment();
    }
  }
}

export { readToml };
