/* Numbers and missing values as people write them. Mirrors sim/io/number_words.py, which has the rule in words. */
import { pythonText, repr } from "./format.js";
import { InputError } from "./input_error.js";
import { splitName } from "./si_units.js";
import { timesOf } from "./times.js";

const EXPONENT = "(?:[eE][+-]?[0-9]+)?";
const NUMBER = new RegExp(`^(?:[+-]?(?:[0-9]+[.,]?[0-9]*|[.,][0-9]+)${EXPONENT}|[+-]?(?:inf|infinity))$`, "i");
const MISSING = new RegExp(
  "^(?:[-–—]*|[+-]?nan(?:\\(ind\\))?|<?n/?a>?|null|none|[+-]?1\\.#[a-z]+|#n/?[avd](?: n/a)?|#\\S*[!?]|#{4,}|" +
    "err:[0-9]+)$",
  "i",
);
const COMMA = new RegExp(`^[+-]?[0-9]*,[0-9]+${EXPONENT}$`, "m");
const POINT = new RegExp(`^[+-]?[0-9]*\\.[0-9]+${EXPONENT}$`, "m");
const THOUSANDS = new RegExp(
  "^[+-]?[0-9]{1,3}(?:(?:\\.[0-9]{3})+,[0-9]+|(?:,[0-9]{3})+\\.[0-9]+|(?:\\.[0-9]{3}){2,}|(?:,[0-9]{3}){2,}" +
    "|(?:[ '’\u00a0\u2009\u202f][0-9]{3})+(?:[.,][0-9]*)?)$",
  "m",
);
const WHOLE_LINE = /^[+-]?[0-9]+$/m;
const THREE = (mark) => new RegExp(`^[+-]?[1-9][0-9]{0,2}[${mark}][0-9]{3}$`, "m");
const OTHER = (mark) => // what shows that the mark is decimal
  new RegExp(`^(?![+-]?[1-9][0-9]{0,2}[${mark}][0-9]{3}$)[+-]?[0-9]*[${mark}][0-9]+${EXPONENT}$`, "m");
const FORMULA = /^'+[=+\-@\t\r]/;

/* Say whether a word is a number, with a decimal point or comma. */
function isNumber(word) {
  return NUMBER.test(word);
}

/* Say whether a word stands for a missing value. */
function isMissing(word) {
  return MISSING.test(word);
}

/* Refuse numbers that can be read in two ways. check_marks */
function checkMarks(columns, where, separator) {
  const texts = columns.map((words) => words.join("\n"));
  const first = (kind) => texts.map((text) => kind.exec(text)).find((match) => match)?.[0];
  const thousands = first(THOUSANDS), [comma, point] = [COMMA, POINT].map(first);
  if (thousands) {
    const number = pythonText(thousands);
    throw new InputError(`${where} has the number ${number}; write numbers without separators of thousands`);
  }
  if (comma && point) {
    throw new InputError(
      `${where} has numbers with a decimal comma (${comma}) and with a decimal point (${point}); use one of them`,
    );
  }
  for (const mark of separator === ";" ? ",." : ",") {
    const alone = mark === "," && !first(OTHER(","));
    for (const text of texts) {
      const three = THREE(mark).exec(text);
      if (!three || OTHER(mark).test(text) || !(alone || WHOLE_LINE.test(text))) continue;
      const [word] = three, small = word.replace(mark, ".").replace(/0+$/, "");
      throw new InputError(
        `${where} has the number ${pythonText(word)}, which may be ${word.replace(mark, "")} or ${small}; ` +
        `write it ` +
          "without separators of thousands, or with another number of decimals",
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
  return FORMULA.test(word) ? word.slice(1) : word;
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

export { checkMarks, isMissing, isNumber, numbersOf, plainText, plainWords, textsOf };
