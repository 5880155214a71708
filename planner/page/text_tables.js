/* Tables as text: comma, semicolon, tab or blanks between columns; comment lines; quotes as in CSV.
 *
 * Mirrors sim/io/text_tables.py, which explains how the first lines show the form. */
import { pythonText } from "./format.js";
import { InputError } from "./input_error.js";
import { checkMarks, isMissing, isNumber, numbersOf, plainText, plainWords } from "./number_words.js";
import { findUnit } from "./si_units.js";

const COMMENT = /^\s*[#%]/;
const MARKED_NUMBER = /^\s*[#%]+\s*[+-]?[.,]?[0-9]/;
const BLANKS = /("(?:[^"]|"")*")|\s+/g;
const SEPARATORS = [";", "\t", ","];
const MOST_COLUMNS = 10_000;
const MOST_TEXT = 128 * 2 ** 20; // bytes

/* Parse a table: {names, columns, lines}, with a column of numbers for each name, NaN for what is none, and the
 * line of each row.
 *
 * bytes: content of the file. where: its name, for messages. named: the columns must have names; without, a table
 * of numbers alone has the names 0, 1, … */
function parseTable(bytes, where, named = true) {
  const { names, words, lines } = parseWords(bytes, where, named);
  return { names, columns: words.map((column, i) => numbersOf(column, names[i])), lines };
}

/* Parse a table as its plain words: {names, words, lines}, with a column of words for each name. parse_lines */
function parseWords(bytes, where, named = true) {
  if (bytes.length > MOST_TEXT) throw new InputError(`${where} has more than 128 MiB; such a file is not read`);
  const lines = decoded(Uint8Array.from(bytes), where).replaceAll("\r\n", "\n").replaceAll("\r", "\n").split("\n");
  const top = lines.findIndex((line) => line.trim() && !COMMENT.test(line));
  if (top < 0) throw new InputError(`${where} is empty; give a table with one row per line`);
  const separator = separatorOf(lines.slice(top), where);
  const { names, rows } = header(lines, top, separator, where);
  if (names === null && named) {
    throw new InputError(`${where} has no names of columns; write them into its first line`);
  }
  if (!rows.length) throw new InputError(`${where} has no rows; give at least one below the header`);
  const width = names === null ? rows[0].words.length : names.length;
  const long = rows.find(({ words }) => words.slice(width).some((word) => word));
  if (long) {
    throw new InputError(
      `${where}: line ${long.line} has more values than columns; if numbers have decimal commas, ` +
      `separate columns ` +
        "by semicolons",
    );
  }
  const last = (names ?? []).reduce((most, name, i) => (name ? i + 1 : most), 0);
  const longest = rows.reduce((most, { words }) => Math.max(most, words.length), 0);
  if (longest < last) {
    throw new InputError(
      `${where}: all rows have fewer values (${longest}) than there are columns (${last}); correct the names`,
    );
  }
  const cells = Array.from({ length: width }, (_, i) => rows.map(({ words }) => words[i] ?? ""));
  checkMarks(cells, where, separator);
  const kept = cells.flatMap((words, i) => (names === null || names[i] || words.some((word) => word) ? [i] : []));
  return {
    names: kept.map((i) => (names === null ? i : names[i] || `column ${i + 1}`)),
    words: kept.map((i) => plainWords(cells[i])),
    lines: rows.map(({ line }) => line),
  };
}

/* The names of the columns, or null, and the rows below them. _header */
function header(lines, top, separator, where) {
  const rows = rowsOf(lines, top, separator, where), { words } = rows[0];
  if (words.length > MOST_COLUMNS) {
    throw new InputError(`${where} has more than ${MOST_COLUMNS} columns; give a table with one row per line`);
  }
  const above = lines.slice(0, top), commented = commentedNames(above, words.length, separator);
  if (words.every((word) => isNumber(word) || isMissing(word)) || (commented && words.some(isNumber))) {
    if (commented === null) { // what looked like comments may be rows
      const start = above.findIndex((line) => !isComment(lineWords(line, separator)));
      return { names: null, rows: start < 0 ? rows : rowsOf(lines, start, separator, where) };
    }
    checkNames(commented, where);
    return { names: commented, rows };
  }
  checkNames(words, where);
  const next = (from) => {
    const found = rows.findIndex((row, i) => i >= from && !isComment(row.words));
    return found < 0 ? rows.length : found;
  };
  let second = next(1), names = words;
  const units = rows[second]?.words ?? [];
  if (units.length === words.length && areUnits(units)) {
    names = words.map((name, i) => withUnit(name, units[i]));
    second = next(second + 1);
  }
  return { names: names.map(plainText), rows: rows.slice(second) };
}

function isComment(words) {
  if (!words.length) return true;
  return COMMENT.test(words[0]) && !MARKED_NUMBER.test(words.join(" ")) && !isMissing(words[0]);
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

/* What separates the columns. _separator */
function separatorOf(lines, where) {
  const counts = new Map();
  for (const mark of SEPARATORS) {
    let rows;
    try {
      rows = rowsOf(lines, 0, mark, where, 2);
    } catch {
      continue; // quotes that end within a cell: another separator
    }
    const [first, second] = rows.map(({ words }) => words.length);
    if (first > 1 && first === second) return mark;
    counts.set(mark, first);
  }
  const most = Math.max(...counts.values());
  return most > 1 ? [...counts.keys()].find((mark) => counts.get(mark) === most) : " ";
}

/* The words of one line; none if its quotes do not pair. */
function lineWords(line, separator) {
  try {
    return rowsOf([line], 0, separator, "")[0]?.words ?? [];
  } catch {
    return [];
  }
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
function commentedNames(lines, count, separator) {
  const comment = lines.findLast((line) => line.trim()) ?? "", line = comment.trim().replace(/^[#%]+/, "").trim();
  for (const mark of [separator, ...SEPARATORS, " "]) {
    const words = lineWords(line, mark);
    if (words.length === count && !words.some(isNumber)) return words;
  }
  return null;
}

/* Refuse a name that stands above two columns. */
function checkNames(names, where) {
  const twice = names.find((name, i) => name && names.indexOf(name) !== i);
  if (twice) throw new InputError(`${where} has two columns ${pythonText(twice)}; rename or drop one`);
}

/* Split lines, from one of them on, into rows {line, words} without those that are empty; at most so many.
 *
 * Quotes hold separators and ends of lines together, as the module csv of Python has it. */
function rowsOf(lines, start, separator, where, most = Infinity) {
  const rows = [], mark = separator === " " ? "\t" : separator;
  let words = [], word = "", state = "start"; // of a cell; "plain", "quoted" or "closed" within it
  for (let i = start; i < lines.length && rows.length < most; i++) {
    const line = separator === " " ? lines[i].trim().replace(BLANKS, (_, held) => held ?? "\t") : lines[i];
    const broken = (reason) =>
      new InputError(
        `${where} is no CSV table (line ${i + 1}: ${reason}); give a header and one row per line`,
      );
    for (const sign of line) {
      if (state === "quoted") {
        if (sign === '"') state = "closed";
        else word += sign;
      } else if (sign === mark) {
        words.push(word.trim());
        [word, state] = ["", "start"];
      } else if (sign === '"' && state === "closed") {
        word += sign;
        state = "quoted";
      } else if (state === "closed") throw broken(`'${mark}' expected after '"'`);
      else if (state === "start" && sign === '"') state = "quoted";
      else if (state !== "start" || sign !== " ") {
        word += sign;
        state = "plain";
      }
    }
    if (state === "quoted") {
      if (i + 1 < lines.length) continue;
      throw broken("unexpected end of data");
    }
    words.push(word.trim());
    if (words.some((each) => each)) rows.push({ line: i + 1, words });
    [words, word, state] = [[], "", "start"];
  }
  return rows;
}

export { parseTable, parseWords };
