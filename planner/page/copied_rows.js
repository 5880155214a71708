/* Rows of a measured table that were copied. Mirrors calibration/swimmer/copied_rows.py, which has the formula. */
import { median } from "./arrays.js";

const CHANCE = 0.01; // equal pairs that are expected by chance
const ROUNDING = 1e-9; // relative difference below which two numbers are one
const TYPICAL = 0.01; // relative standard deviation where no repeats but copies are left

/* Find copied rows: pairs of a place and the place of the row that it repeats.
 *
 * inputs, outputs: lists of columns. */
function findCopies(inputs, outputs) {
  const count = inputs[0].length, first = new Map(), copies = new Map();
  const words = (columns, place) => columns.map((column) => column[place]).join();
  for (let place = 0; place < count; place++) {
    const row = words([...inputs, ...outputs], place);
    if (first.has(row)) copies.set(place, first.get(row));
    else first.set(row, place);
  }
  if (!copies.size) return [];
  const condition = Array.from({ length: count }, (_, place) => words(inputs, place)), sizes = new Map();
  for (const name of condition) sizes.set(name, (sizes.get(name) ?? 0) + 1);
  const pairs = [...sizes.values()].reduce((total, size) => total + (size * (size - 1)) / 2, 0);
  const kept = condition.map((_, place) => place).filter((place) => !copies.has(place));
  const places = kept.map((place) => condition[place]);
  const chances = outputs.map((column) => equal(kept.map((place) => column[place]), places));
  return pairs * chances.reduce((product, chance) => product * chance, 1) < CHANCE ? [...copies] : [];
}

/* Estimate the probability that two repeats of an output are equal. _equal */
function equal(values, condition) {
  const distinct = [...new Set(values)].sort((a, b) => a - b);
  const gaps = distinct.slice(1).flatMap((value, i) => {
    const gap = value - distinct[i];
    return gap > ROUNDING * Math.abs(value) ? [gap] : [];
  });
  if (!gaps.length) return 1;
  const groups = new Map();
  condition.forEach((name, i) => groups.set(name, [...(groups.get(name) ?? []), values[i]]));
  let square = 0;
  for (const group of groups.values()) {
    const mean = group.reduce((total, value) => total + value, 0) / group.length;
    for (const value of group) square += (value - mean) ** 2;
  }
  const repeats = values.length - groups.size;
  const scatter = repeats ? Math.sqrt(square / repeats) : TYPICAL * median(values.map(Math.abs));
  return scatter ? Math.min(1, gaps.reduce((a, b) => Math.min(a, b)) / (2 * Math.sqrt(Math.PI) * scatter)) : 1;
}

export { findCopies };
