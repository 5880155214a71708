/* Tables as text: comma, semicolon, tab or blanks between columns; decimal point or comma; comment lines.
 *
 * Mirrors sim/io/text_tables.py, which explains how the first lines show the form, and what pandas does with it.
 * */
import { InputError } from "./input_error.js";
import { pythonText, repr } from "./format.js";
import { findUnit } from "./si_units.js";

const SEPARATORS = [";", "\t", ","];
const DECIMAL_COMMA = /^[+-]?\d*,\d+(?:[eE][+-]?\d+)?$/;
const DECIMAL_POINT = /^[+-]?\d*\.\d+(?:[eE][+-]?\d+)?$/;
const THOUSANDS = /^(?:[+-]?\d{1,3}(?:\.\d{3})+,\d+|[+-]?\d{1,3}(?:,\d{3})+\.\d+)$/;
const NUMBER = /^[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?$/i;
const INFINITE = /^([+-]?)inf(?:inity)?$/i;
const MOST_COLUMNS = 10_000;
const NOTHING = new Set([
  "", "#N/A", "#N/A N/A", "#NA", "-1.#IND", "-1.#QNAN", "-NaN", "-nan", "1.#IND", "1.#QNAN", "<NA>", "N/A", "NA",
  "NULL", "NaN", "None", "n/a", "nan", "null",
]); // words that pandas reads as no value
const SAMPLE = 2 ** 18; // characters from which the form of the text is found out
const MOST_TEXT = 128 * 2 ** 20; // bytes

/* Parse a table: {names, columns}, with a column of numbers for each name, NaN for what is none.
 *
 * bytes: content of the file. where: its name, for messages. named: the columns must have names; without, a table
 * of numbers alone has the names 0, 1, … */
function parseTable(bytes, where, named = true) {
  const { names, words, comma } = parseWords(bytes, where, named);
  return { names, columns: words.map((column) => numbersOf(column, comma)) };
}

/* Parse a table as its words: {names, words, comma}, with a column of words for each name. comma: numbers have
 * decimal commas. */
function parseWords(bytes, where, named = true) {
  if (bytes.length > MOST_TEXT) throw new InputError(`${where} has more than 128 MiB; such a file is not read`);
  let text = decoded(Uint8Array.from(bytes), where).replaceAll("\r\n", "\n").replaceAll("\r", "\n");
  const comment = /^[ \t]*[#%].*(?:\n|(?![\s\S]))/gm, comments = text.slice(0, SAMPLE).match(comment) ?? [];
  if (comments.length) text = text.replace(comment, "");
  text = text.replace(/^(?:[ \t]*\n)+/, "");
  const lines = text.slice(0, SAMPLE).split("\n"), [first] = lines;
  if (!first.trim()) throw new InputError(`${where} is empty; give a table with one row per line`);
  const separator = separatorOf(first), words = wordsOf(first, separator);
  if (words.length > MOST_COLUMNS) {
    throw new InputError(`${where} has more than ${MOST_COLUMNS} columns; give a table with one row per line`);
  }
  const header = !words.every((word) => !word || isNumber(word));
  let names = header ? words : commentedNames(comments, words.length, separator), skipped = header ? 1 : 0;
  if (names === null && named) {
    throw new InputError(`${where} has no names of columns; write them into its first line`);
  }
  checkNames(names ?? [], where);
  const units = header && lines.length > 1 ? wordsOf(lines[1], separator) : [];
  if (names && units.length === names.length && areUnits(units)) {
    names = names.map((name, i) => withUnit(name, units[i]));
    skipped = 2;
  }
  const comma = hasDecimalCommas(text.slice(0, SAMPLE), where, separator);
  const columnNames = (names ?? words.map((_, i) => i)).map((name, i) => (name === "" ? `column ${i + 1}` : name));
  return { names: columnNames, words: wordColumns(text, where, separator, columnNames.length, skipped), comma };
}

/* Decode UTF-8, UTF-16 with a byte order mark, or Windows-1252. */
function decoded(bytes, where) {
  const wide = bytes[0] === 0xff && bytes[1] === 0xfe ? "utf-16le" : bytes[0] === 0xfe && bytes[1] === 0xff
    ? "utf-16be" : null;
  let text;
  try {
    text = new TextDecoder(wide ?? "utf-8", { fatal: true }).decode(bytes);
  } catch {
    if (bytes.some((byte) => [0x81, 0x8d, 0x8f, 0x90, 0x9d].includes(byte))) {
      throw new InputError(`${where} is no text in UTF-8, UTF-16 or Latin-1`);
    }
    text = new TextDecoder("windows-1252").decode(bytes);
  }
  if (text.includes("\0")) {
    throw new InputError(`${where} is no text; give a table as text, .xlsx or .parquet`);
  }
  return text;
}

/* The separator that a line has most often; null: blanks. */
function separatorOf(line) {
  const counts = SEPARATORS.map((mark) => line.split(mark).length - 1), most = Math.max(...counts);
  return most ? SEPARATORS[counts.indexOf(most)] : null;
}

function wordsOf(line, separator) {
  const parts = separator === null ? line.split(/\s+/).filter((word) => word) : line.split(separator);
  return parts.map((word) => word.trim().replace(/^"+|"+$/g, "").trim());
}

/* Say whether a word is a number, with a decimal point or comma. */
function isNumber(word) {
  const text = word.replaceAll(",", ".").trim();
  return NUMBER.test(text) || /^[+-]?(?:inf|infinity|nan)$/i.test(text);
}

/* Say whether words are units, apart from empty ones. */
function areUnits(words) {
  const given = words.filter((word) => word);
  return given.length > 0 && given.every((word) => findUnit(word) !== null && !isNumber(word));
}

/* Write the unit of a column behind its name. */
function withUnit(name, unit) {
  return unit ? `${name} [${unit.replace(/^[[\]()]+|[[\]()]+$/g, "")}]` : name;
}

/* Take names from the last comment, if it has one for each column and no number. */
function commentedNames(comments, count, separator) {
  if (!comments.length) return null;
  const line = comments[comments.length - 1].trim().replace(/^[#%]+/, "").trim();
  for (const mark of [separator, ...SEPARATORS, null]) {
    const words = wordsOf(line, mark);
    if (words.length === count && !words.some(isNumber)) return words;
  }
  return null;
}

/* Find out whether numbers have decimal commas. */
function hasDecimalCommas(text, where, separator) {
  if (separator === "," || !text.includes(",")) return false;
  const words = text.split("\n").flatMap((line) => wordsOf(line, separator));
  const thousands = words.find((word) => THOUSANDS.test(word));
  if (thousands) {
    const number = pythonText(thousands);
    throw new InputError(`${where} has the number ${number}; write numbers without separators of thousands`);
  }
  const [comma, point] = [DECIMAL_COMMA, DECIMAL_POINT].map((form) => words.find((word) => form.test(word)));
  if (comma && point) {
    throw new InputError(
      `${where} has numbers with a decimal comma (${comma}) and with a decimal point (${point}); use one of them`,
    );
  }
  return comma !== undefined;
}

/* Refuse a name that stands above two columns. */
function checkNames(names, where) {
  const twice = names.find((name, i) => name && names.indexOf(name) !== i);
  if (twice) throw new InputError(`${where} has two columns ${pythonText(twice)}; rename or drop one`);
}

/* Read columns of words below the header. */
function wordColumns(text, where, separator, count, skipped) {
  const rows = rowsOf(text, separator).slice(skipped).filter((row) => row.length > 1 || row[0] !== "");
  if (!rows.length) throw new InputError(`${where} has no rows; give at least one below the header`);
  const most = Math.max(count, rows[0].length), long = rows.findIndex((row) => row.length > most);
  if (long >= 0) {
    throw new InputError(
      `${where} is no CSV table (Error tokenizing data. C error: Expected ${most} fields in line ` +
        `${long + skipped + 1}, saw ${rows[long].length}); give a header and one row per line`,
    );
  }
  if (most > count + 1 || (most > count && rows.some((row) => row[count]))) {
    throw new InputError(
      `${where} has a row with more values than columns; if numbers have decimal commas, separate columns by ` +
        "semicolons",
    );
  }
  return Array.from({ length: count }, (_, i) => rows.map((row) => row[i] ?? ""));
}

/* Split a text into rows of words; quotes hold separators and ends of lines together. */
function rowsOf(text, separator) {
  const rows = [], end = separator === null ? " " : separator;
  let row = [], word = "", quoted = false;
  const take = (last) => {
    if (separator !== null || word) row.push(word.trim());
    word = "";
    if (!last) return;
    rows.push(row.length ? row : [""]);
    row = [];
  };
  for (const sign of text) {
    if (sign === '"') quoted = !quoted;
    else if (quoted) word += sign;
    else if (sign === "\n") take(true);
    else if (sign === end || (separator === null && sign === "\t")) take(false);
    else word += sign;
  }
  if (word || row.length) take(true);
  return rows;
}

/* Convert words to numbers, with NaN for what is none; decimal commas count where all words have the form. */
function numbersOf(words, comma) {
  const plain = comma && areNumbers(words, comma) ? words.map((word) => word.replace(",", ".")) : words;
  return Float64Array.from(plain, (word) => {
    if (NUMBER.test(word)) return Number(word);
    const infinite = INFINITE.exec(word);
    return infinite ? (infinite[1] === "-" ? -Infinity : Infinity) : NaN;
  });
}

/* The values of a column as Python shows what pandas reads: numbers if all words are, otherwise the words. */
function textsOf(words, comma) {
  if (!areNumbers(words, comma)) return words.map((word) => (NOTHING.has(word) ? "nan" : word));
  const values = numbersOf(words, comma), whole = words.every((word) => /^[+-]?\d+$/.test(word));
  return Array.from(values, (value) => (whole ? String(value) : repr(value)));
}

function areNumbers(words, comma) {
  const isOne = (word) => NUMBER.test(comma ? word.replace(",", ".") : word) && !(comma && word.includes("."));
  return words.every((word) => NOTHING.has(word) || INFINITE.test(word) || isOne(word));
}

export { numbersOf, parseTable, parseWords, textsOf };
