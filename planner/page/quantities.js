/* Columns in the units that a program needs: R_yr_mm or "R_yr [mm]" becomes R_yr_cm.
 *
 * Mirrors sim/io/quantities.py. A table is {names, columns}; it may have `texts`, values as they are shown. */
import { pythonText, repr } from "./format.js";
import { InputError } from "./input_error.js";
import { convertUnit, findUnit, splitName, unitText, unitsOfKind } from "./si_units.js";

const CASE_COUNTS = new Set(["l", "r"]); // L and R are the head's

/* Rename and convert columns to those that are wanted: {table, notes}; all others stay as they are.
 *
 * where: the table's name, for messages. synonyms: a map of other names of a quantity, in lower case, to its name
 * without unit; a name may be a unit ("rpm"). convert_columns */
function convertColumns(table, wanted, where, synonyms = new Map()) {
  const names = table.names.map(String), columns = [...table.columns], texts = table.texts && [...table.texts];
  const notes = [];
  for (const name of wanted) {
    const candidates = names.filter((column) => column === name);
    candidates.push(...names.filter((column) => isAlike(column, name, synonyms)));
    if (candidates.length > 1) {
      throw new InputError(`${where}: ${candidates.join(" and ")} are the same quantity; drop all but one`);
    }
    if (!candidates.length) checkBare(names, name, where, synonyms);
    if (!candidates.length || candidates[0] === name) continue;
    const [column] = candidates, at = names.indexOf(column);
    const given = unitOf(column, synonyms), target = splitName(name).unit;
    if (given === null || target === null || given.suffix === target.suffix) {
      notes.push(`column ${column} read as ${name}`);
    } else {
      columns[at] = columns[at].map((value) => convertUnit(value, given.suffix, target.suffix));
      if (texts) texts[at] = Array.from(columns[at], repr);
      notes.push(`column ${column} converted from ${unitText(given)} to ${unitText(target)} (${name})`);
    }
    names[at] = name;
  }
  return { table: { ...table, names, columns, ...(texts && { texts }) }, notes };
}

/* Whether a column of another name holds a quantity, in any unit of its kind. */
function isAlike(column, wanted, synonyms) {
  const { quantity, unit: target } = splitName(wanted), unit = unitOf(column, synonyms);
  if (column === wanted || (unit?.kind ?? null) !== (target?.kind ?? null)) return false;
  return isSame(target ? splitName(column).quantity : column, quantity, synonyms);
}

function isSame(given, quantity, synonyms) {
  const name = synonyms.get(given.toLowerCase()) ?? given, low = name.toLowerCase();
  return name === quantity || (low === quantity.toLowerCase() && !CASE_COUNTS.has(low));
}

function unitOf(column, synonyms) {
  return splitName(column).unit ?? (synonyms.has(column.toLowerCase()) ? findUnit(column) : null);
}

/* Refuse a column that has the right name and no unit. */
function checkBare(names, wanted, where, synonyms) {
  const { quantity, unit } = splitName(wanted);
  const bare = names.find((column) => findUnit(column) === null && isSame(column, quantity, synonyms));
  if (unit && bare !== undefined) {
    const choices = unitsOfKind(unit.kind).map((suffix) => `${quantity}_${suffix}`).join(", ");
    throw new InputError(`${where}: column ${pythonText(bare)} has no unit; name it one of ${choices}`);
  }
}

export { convertColumns };
