/* Refusals, progress, and numbers as text. */

const ADVICE_NUMBERS = 'under "Corners as numbers; move, scale, turn"';
const ADVICE = [ // what a message of the planner says, and what the page says instead
  ["compare it with its own plan.json", "open its own plan.json first"],
  ["choose one with --shape, or remove the others", "remove the others"],
  [/simulate this robot's own table \([^)]*\), or measure/, "measure"],
  [/give --smooth (\S+)/, 'set "Smooth over" to $1 cm and press "Smooth this path"'],
  [/scale the path by (\S+)/, `scale it by $1 ${ADVICE_NUMBERS}`],
  [/; scale it$/, `; scale it ${ADVICE_NUMBERS}`],
  ["allow corner = nearest", 'choose another answer to "Corners that are too tight"'],
  [/change the robot, or simulate it \([^)]*\)/, 'change it under "Robot"'],
  ["simulate it (softflagella replay)", 'set "Number of tails N" to 2 or more'],
  [/plan with feedback, make a table of .*, or move the path, /, "move "],
  [/, or make a table of this robot with .*/, ' under "Largest stated error"'],
];
const DECLARING = "finding the nearest path that can be followed";
const REMEDY = "too tight: looking for a change that helps";
const FOLLOWING = "following the path";

/* An error for bad input: one sentence that says what was given, what is allowed, what to change. Others are bugs. */
class InputError extends Error {
  /* about: "options" or "regions" where an option of the plan, or the goal, a region or the walls are wrong; null:
   * what is wrong follows from the question. */
  constructor(message, about = null) {
    super(message);
    this.name = new.target.name;
    this.about = about;
  }
}

/* Do some work; a refusal becomes another answer, or another refusal. Errors of the program pass. */
function refusing(work, instead) {
  try {
    return work();
  } catch (refusal) {
    if (refusal instanceof InputError) return instead(refusal);
    throw refusal;
  }
}

/* Do some work, and write the name of a file before its refusals. */
function naming(where, work) {
  return refusing(work, ({ message }) => {
    throw new InputError(message.includes(where) ? message : `${where}: ${message}`);
  });
}

/* A message of the planner with its advice in the page's words; the lengths of smoothing become cm. */
function inPage(message, robot) {
  const cm = message.replace(/(?<=--smooth )(\S+)l/, (_, tails) => general(100 * robot.tailLength * tails, 3));
  return ADVICE.reduce((words, [from, to]) => words.replace(from, to), cm);
}

/* A number as Python and JSON write a float: the shortest digits that are read back exactly. */
function repr(value) {
  if (!Number.isFinite(value)) return String(value).replace("Infinity", "inf").replace("NaN", "nan");
  if (Object.is(value, -0)) return "-0.0";
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e16)) return exponent(value.toExponential());
  return Number.isInteger(value) ? `${value}.0` : String(value);
}

/* A number with so many significant digits, without zeros at the end: 0.32, 1.2e-05. */
function general(value, digits = 6) {
  if (!Number.isFinite(value)) return repr(value);
  const [mantissa, power] = value.toExponential(digits - 1).split("e").map(Number);
  return power < -4 || power >= digits ? exponent(`${mantissa}e${power}`) : String(Number(value.toPrecision(digits)));
}

/* An exponent of two digits or more, and its sign: 1e-05. */
function exponent(text) {
  return text.replace(/e([+-]?)(\d+)$/, (_, sign, power) => `e${sign || "+"}${power.padStart(2, "0")}`);
}

/* A number with so many decimals; zero has no sign. */
function fixed(value, places) {
  return value.toFixed(places).replace(/^-(0\.?0*)$/, "$1");
}

/* A text in quotes, without what a terminal does not show. */
function quoted(text) {
  const quote = text.includes("'") && !text.includes('"') ? '"' : "'";
  const hidden = (sign) => `\\u${sign.charCodeAt(0).toString(16).padStart(4, "0")}`;
  return quote + text.replace(/[^\S ]|\p{C}/gu, hidden).replaceAll(quote, `\\${quote}`) + quote;
}

/* A text without some signs at its end; a pattern would try each of them as the first. */
function trimmedEnd(text, signs) {
  let end = text.length;
  while (end && signs.includes(text[end - 1])) end -= 1;
  return text.slice(0, end);
}

/* A pattern that matches whole texts. */
function whole(pattern) {
  return new RegExp(`^(?:${pattern.source})$`, pattern.flags);
}

/* The known word that is most like a given one: at most a third of its letters differ; null if there is none. */
function closeMatch(word, known) {
  const far = Array.from(known, (other) => editsBetween(word, other)), least = Math.min(...far);
  return least <= word.length / 3 ? known[far.indexOf(least)] : null;
}

/* The number of letters to insert, remove or replace (Levenshtein's distance). */
function editsBetween(word, other) {
  let row = Array.from({ length: other.length + 1 }, (_, j) => j);
  for (const [i, letter] of Array.from(word).entries()) {
    const above = row;
    row = [i + 1];
    for (let j = 0; j < other.length; j++) {
      row.push(Math.min(row[j] + 1, above[j + 1] + 1, above[j] + (letter === other[j] ? 0 : 1)));
    }
  }
  return row[other.length];
}

export { InputError, refusing, naming, DECLARING, REMEDY, FOLLOWING, inPage, repr, general, fixed, quoted };
export { closeMatch, trimmedEnd, whole };
