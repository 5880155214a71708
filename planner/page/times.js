/* Times in a table: numbers, durations, times of day and dates. Mirrors sim/io/times.py, which explains them. */
import { convertUnit } from "./si_units.js";

const CLOCK = /^(?:([0-9]+) days?,? )?([0-9]+):([0-5][0-9]):([0-5][0-9](?:[.,][0-9]*)?)$/;
const DATE = new RegExp(
  "^([0-9]{4})-([0-9]{2})-([0-9]{2})(?:[T ]([0-9]{2}):([0-9]{2})(?::([0-9]{2}(?:[.,][0-9]+)?))?)?" +
    "(Z|[+-][0-9]{2}:?[0-9]{2})?$",
);
const EPOCH = 3e8, LATEST = 1e11; // s: what is longer is a date; beyond it no date, but another unit

/* Convert a column of times, words and the numbers where they are, to numbers in a unit; NaN for what is none. */
function timesOf(words, numbers, unit) {
  if (numbers.some(Number.isNaN)) {
    for (const kind of [dateOf, clockOf]) {
      const seconds = Float64Array.from(words, (word) => (word === null ? NaN : kind(word)));
      if (seconds.every(Number.isNaN)) continue;
      const from = kind === dateOf ? earliest(seconds) : 0;
      return seconds.map((value) => convertUnit(value - from, "s", unit));
    }
  }
  const times = numbers.map((value) => (convertUnit(Math.abs(value), unit, "s") < LATEST ? value : NaN));
  const first = earliest(times), size = convertUnit(first, unit, "s");
  return EPOCH < size && size < LATEST ? times.map((value) => value - first) : times;
}

function earliest(values) {
  return values.reduce((least, value) => (value < least ? value : least), Infinity);
}

function clockOf(word) {
  const match = CLOCK.exec(word);
  if (!match) return NaN;
  const [, days = "0", hours, minutes, seconds] = match;
  return 86400 * Number(days) + 3600 * Number(hours) + 60 * Number(minutes) + Number(seconds.replace(",", "."));
}

function dateOf(word) {
  const match = DATE.exec(word);
  if (!match) return NaN;
  const [, year, month, day, hours = "0", minutes = "0", seconds = "0", zone = "Z"] = match;
  const parts = [year, month, day, hours, minutes].map(Number), date = new Date(0);
  date.setUTCFullYear(parts[0], parts[1] - 1, parts[2]);
  date.setUTCHours(parts[3], parts[4]);
  const read = [date.getUTCFullYear(), date.getUTCMonth() + 1, date.getUTCDate(), date.getUTCHours()];
  if (parts[4] > 59 || parts[0] < 1 || read.some((part, i) => part !== parts[i])) return NaN;
  const offset = zone.slice(1).replace(":", "");
  const ahead = offset ? 60 * Number(offset.slice(0, 2)) + Number(offset.slice(2)) : 0;
  const shift = ahead * (offset && zone[0] === "+" ? -60 : 60);
  return date.getTime() / 1000 + shift + Number(seconds.replace(",", "."));
}

export { timesOf };
