/* Paths from CSV tables.
 *
 * Mirrors planner/paths/path_files.py. A drawing is {path, unit}: unit is the size of the path's unit in metres,
 * null: the numbers have no unit. */
import { InputError, naming } from "./input_error.js";
import { pathOf } from "./path.js";
import { splitName, toSi } from "./si_units.js";
import { parseTable } from "./text_tables.js";

/* Read a path from a table with columns x, y (or x_mm, y_mm and so on); without names the first two columns.
 *
 * bytes: content of the file. where: its name, for messages. closed: join the end to the start; null: as in the
 * file. read_path */
function readTablePath(bytes, where, closed = null) {
  const table = parseTable(bytes, where, false), bare = table.names.every((name) => typeof name === "number");
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
  return { path: naming(where, () => pathOf(points, closed)), unit: units.length ? size : null };
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
    const names = table.names.join(", ");
    throw new InputError(`${where} has columns ${names}; give x and y, or with a unit x_mm, y_mm`);
  }
  return columns[0];
}

export { readTablePath };
