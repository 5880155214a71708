/* Tables as text: comma, semicolon, tab or blanks between columns, comment lines, quotes as in CSV; numbers and
 * missing values as people write them; paths in tables. */
import { CONSTANTS } from "./constants.js";
import { pathOf } from "./path.js";
import { findUnit, splitName, timesOf, toSi, unbracketed } from "./units.js";
import { InputError, naming, quoted, refusing, repr, trimmedEnd, whole } from "./words.js";

const { NUMBER, MISSING, COMMA, POINT, THOUSANDS, WHOLE_LINE, THREE, OTHER, FORMULA } = CONSTANTS.number_words;
const { COMMENT, MARKED_NUMBER, BLANKS, SEPARATORS } = CONSTANTS.tables;
const EACH_BLANK = new RegExp(BLANKS, "g");

/* Say whether a word is a number, with a decimal point or comma; whether it stands for a missing value; and whether a
 * line is a comment. */
const [isNumber, isMissing] = [NUMBER, MISSING].map(whole).map((form) => (word) => form.test(word));
const isMarked = (line) => line.search(COMMENT) === 0;

/* Refuse numbers that can be read in two ways. */
function checkMarks(columns, where, separator) {
  const texts = columns.map((words) => words.join("\n"));
  const first = (kind) => texts.map((text) => kind.exec(text)).find((match) => match)?.[0];
  const thousands = first(THOUSANDS), [comma, point] = [COMMA, POINT].map(first);
  if (thousands) {
    const number = quoted(thousands);
    throw new InputError(`${where} has the number ${number}; write numbers without separators of thousands`);
  }
  if (comma && point) {
    throw new InputError(
      `${where} has numbers with a decimal comma (${comma}) and with a decimal point (${point}); use one of them`,
    );
  }
  for (const mark of separator === ";" ? ",." : ",") {
    const alone = mark === "," && !first(OTHER[","]);
    for (const text of texts) {
      const three = THREE[mark].exec(text);
      if (!three || OTHER[mark].test(text) || !(alone || WHOLE_LINE.test(text))) continue;
      const [word] = three, small = trimmedEnd(word.replace(mark, "."), "0");
      throw new InputError(
        `${where} has the number ${quoted(word)}, which may be ${word.replace(mark, "")} or ${small}; write it without `
        + "separators of thousands, or with another number of decimals",
      );
    }
  }
}

/* The cells of a column with decimal points, and null for a missing value. */
function plainWords(words) {
  return words.map((word) => {
    if (isMissing(word)) return null;
    return isNumber(word) ? word.replace(",", ".") : plainText(word);
  });
}

/* Leave out the apostrophe before a text that a spreadsheet would take for a formula. */
function plainText(word) {
  return word.startsWith("'") && word.search(FORMULA) === 0 ? word.slice(1) : word;
}

/* Convert the plain cells of a column to numbers, with NaN for what is none; times to the unit of its name. */
function numbersOf(words, name = "") {
  const numbers = Float64Array.from(words, numberOf), { unit } = splitName(String(name));
  return unit?.kind === "time" ? timesOf(words, numbers, unit.suffix) : numbers;
}

function numberOf(word) {
  if (word === null || !isNumber(word)) return NaN;
  return /inf/i.test(word) ? (word.startsWith("-") ? -Infinity : Infinity) : Number(word);
}

/* The values of a column as Python shows them: numbers if all cells are, otherwise the words. */
function textsOf(words) {
  if (!words.every((word) => word === null || isNumber(word))) return words.map((word) => word ?? "nan");
  const isWhole = (word) => word !== null && WHOLE_LINE.test(word) && Number.isSafeInteger(Number(word));
  const whole = words.every(isWhole);
  return words.map((word) => (whole ? String(Number(word)) : repr(numberOf(word))));
}

/* Parse a table as its plain words: {names, words, lines}, with a column of words for each name, and the line of each
 * row; a table of numbers alone has the names 0, 1, … bytes: content of the file. where: its name, for messages. */
function parseWords(bytes, where) {
  const text = decoded(Uint8Array.from(bytes), where).replaceAll("\ufeff", "");
  const lines = text.replaceAll("\r\n", "\n").replaceAll("\r", "\n").split("\n");
  const top = lines.findIndex((line) => line.trim() && !isMarked(line));
  if (top < 0) throw empty(where);
  const separator = separatorOf(lines.slice(top), where);
  const { names, rows } = header(lines, top, separator, where);
  if (!rows.length) throw new InputError(`${where} has no rows; give at least one below the header`);
  const width = names === null ? rows[0].words.length : names.length;
  const long = rows.find(({ words }) => words.slice(width).some((word) => word));
  const last = (names ?? []).reduce((most, name, i) => (name ? i + 1 : most), 0);
  const longest = rows.reduce((most, { words }) => Math.max(most, words.length), 0);
  let fault = "";
  if (long) {
    const commas = "if numbers have decimal commas, separate columns by semicolons";
    fault = `line ${long.line} has more values than columns; ${commas}`;
  } else if (longest < last) {
    fault = `all rows have fewer values (${longest}) than there are columns (${last}); correct the names`;
  }
  if (fault || 2 * (names ?? []).filter((name) => name).length <= Math.max(longest, 2)) {
    const last = separatorOf(lines.filter((line) => line.trim()).slice(-2), where);
    fault = lowerHeader(lines, top, separator, where) || lowerHeader(lines, top, last, where) || fault;
  }
  if (fault) throw new InputError(`${where}: ${fault}`);
  const cells = Array.from({ length: width }, (_, i) => rows.map(({ words }) => words[i] ?? ""));
  checkMarks(cells, where, separator);
  const kept = cells.flatMap((words, i) => (names === null || names[i] || words.some((word) => word) ? [i] : []));
  return {
    names: kept.map((i) => (names === null ? i : names[i] || `column ${i + 1}`)),
    words: kept.map((i) => plainWords(cells[i])),
    lines: rows.map(({ line }) => line),
  };
}

/* The names of the columns, or null, and the rows below them. */
function header(lines, top, separator, where) {
  const rows = rowsOf(lines, top, separator, where);
  if (!rows.length) throw empty(where); // quotes without a text, or separators
  const { words } = rows[0];
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

/* Say in which line the header seems to be: below others, and above rows with two numbers or more. */
function lowerHeader(lines, top, separator, where) {
  const rows = refusing(() => rowsOf(lines, top, separator, where), () => []);
  const columns = [...(rows.at(-1)?.words ?? []).entries()].flatMap(([i, word]) => (isNumber(word) ? [i] : []));
  const cells = rows.map(({ words }) => columns.flatMap((i) => (isMissing(words[i] ?? "") ? [] : [words[i]])));
  const below = cells.findIndex((given, k) => rows[k].words.length > 1 && given.length && given.every(isNumber));
  if (below < 2 || columns.length < 2) return "";
  const count = rows[below - 1].words.length;
  const units = rows[below - 1].words.filter((word) => word && findUnit(word) !== null).length;
  const header = below - (rows[below - 2].words.length === count && count < 2 * units ? 2 : 1);
  const named = cells[header].length === columns.length && !cells[header].some(isNumber);
  if (header < 1 || !named || !cells.slice(below).flat().every(isNumber)) return "";
  return `the header seems to be in line ${rows[header].line}: delete the lines above it`;
}

function isComment(words) {
  if (!words.length) return true;
  return isMarked(words[0]) && words.join(" ").search(MARKED_NUMBER) !== 0 && !isMissing(words[0]);
}

function empty(where) {
  return new InputError(`${where} is empty; give a table with one row per line`);
}

/* Decode UTF-8, UTF-16 with a byte order mark, or Windows-1252. */
function decoded(bytes, where) {
  const wide = bytes[0] === 0xff && bytes[1] === 0xfe ? "utf-16le" : bytes[0] === 0xfe && bytes[1] === 0xff
    ? "utf-16be" : null;
  let text;
  try {
    text = new TextDecoder(wide ?? "utf-8", { fatal: true }).decode(bytes);
  } catch {
    const undefinedBytes = [0x81, 0x8d, 0x8f, 0x90, 0x9d];
    text = bytes.some((byte) => undefinedBytes.includes(byte)) ? "\0" : new TextDecoder("windows-1252").decode(bytes);
  }
  if (text.includes("\0")) throw new InputError(`${where} is no text; give a table as text, .xlsx or .parquet`);
  return text;
}

/* What separates the columns. */
function separatorOf(lines, where) {
  const counts = new Map();
  for (const mark of SEPARATORS) {
    const rows = refusing(() => rowsOf(lines, 0, mark, where, 2), () => []); // none: quotes end within a cell
    const [first = 0, second] = rows.map(({ words }) => words.length);
    if (first > 1 && first === second) return mark;
    counts.set(mark, first);
  }
  const most = Math.max(...counts.values());
  return most > 1 ? [...counts.keys()].find((mark) => counts.get(mark) === most) : " ";
}

/* The words of one line; none if its quotes do not pair. */
function lineWords(line, separator) {
  return refusing(() => rowsOf([line], 0, separator, "")[0]?.words ?? [], () => []);
}

/* Say whether words are units, apart from empty ones. */
function areUnits(words) {
  const given = words.filter((word) => word);
  return given.length > 0 && given.every((word) => findUnit(word) !== null && !isNumber(word));
}

/* Write the unit of a column behind its name. */
function withUnit(name, unit) {
  return unit ? `${name} [${unbracketed(unit)}]` : name;
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
  const twice = names.filter((name) => name).sort().find((name, i, sorted) => name === sorted[i + 1]);
  if (twice) throw new InputError(`${where} has two columns ${quoted(twice)}; rename or drop one`);
}

/* Split lines, from one of them on, into rows {line, words} without those that are empty; at most so many.
 *
 * Quotes hold separators and ends of lines together, as the module csv of Python has it. */
function rowsOf(lines, start, separator, where, most = Infinity) {
  const rows = [], mark = separator === " " ? "\t" : separator;
  let words = [], word = "", state = "start"; // of a cell; "plain", "quoted" or "closed" within it
  for (let i = start; i < lines.length && rows.length < most; i++) {
    const line = separator === " " ? lines[i].trim().replace(EACH_BLANK, (_, held) => held ?? "\t") : lines[i];
    const broken = (reason) =>
      new InputError(`${where} is no CSV table (line ${i + 1}: ${reason}); give a header and one row per line`);
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

/* Read a path {path, unit} from a table {names, columns, lines} with columns x, y (or x_mm, y_mm and so on); without
 * names the first two columns. unit: size of the path's unit in metres, null: the numbers have no unit. */
function readTablePath(table, where) {
  const bare = table.names.every((name) => typeof name === "number");
  const names = bare ? table.names.slice(0, 2) : ["x", "y"].map((axis) => columnNamed(where, table, axis));
  const units = bare ? [] : names.map((name) => splitName(name).unit).filter((unit) => unit !== null);
  if (names.length !== 2 || units.length === 1) {
    throw new InputError(`${where}: give x and y, both with a unit (x_mm and y_mm) or both without`);
  }
  const [x, y] = names.map((name) => table.columns[table.names.indexOf(name)]);
  const broken = x.findIndex((value, i) => !(Number.isFinite(value) && Number.isFinite(y[i])));
  if (broken >= 0) {
    throw new InputError(
      `${where}: x or y of point ${broken + 1} (line ${table.lines[broken]}) is no number; correct the file`,
    );
  }
  const [size, other] = units.length ? units.map((unit) => toSi(1, unit.suffix)) : [1, 1];
  const points = Array.from(x, (value, i) => [value, y[i] * (other / size)]);
  return { path: naming(where, () => pathOf(points)), unit: units.length ? size : null };
}

/* Choose the column of a coordinate, a bare number or a length. */
function columnNamed(where, table, axis) {
  const columns = table.names.filter((column) => {
    const { quantity, unit } = splitName(column);
    return quantity.toLowerCase() === axis && (unit === null || unit.kind === "length");
  });
  if (columns.length > 1) {
    throw new InputError(`${where}: ${columns.join(" and ")} are the same coordinate; drop all but one`);
  }
  if (!columns.length) {
    throw new InputError(`${where} has columns ${table.names.join(", ")}; give x and y, or with a unit x_mm, y_mm`);
  }
  return columns[0];
}

export { numbersOf, textsOf, parseWords, readTablePath };
