/* Units of lengths, times, angles and other quantities: as suffixes of names, in brackets, and in sentences.
 *
 * Mirrors sim/io/units.py. A value v in a unit is (v + zero) · times / over in SI units. */
import { fixed, general, roundHalfEven } from "./format.js";

const PI = Math.PI;
const UNITS = new Map(
  [
    ["m", "length"], ["cm", "length", 1, 100], ["mm", "length", 1, 1000], ["um", "length", 1, 1e6],
    ["in", "length", 0.0254], ["s", "time"], ["ms", "time", 1, 1000], ["min", "time", 60], ["h", "time", 3600],
    ["rad", "angle"], ["deg", "angle", PI, 180], ["rad_s", "angular velocity"],
    ["deg_s", "angular velocity", PI, 180], ["rpm", "angular velocity", 2 * PI, 60],
    ["rps", "angular velocity", 2 * PI], ["Hz", "angular velocity", 2 * PI], ["m_s", "speed"],
    ["cm_s", "speed", 1, 100], ["mm_s", "speed", 1, 1000], ["m_min", "speed", 1, 60],
    ["cm_min", "speed", 1, 6000], ["mm_min", "speed", 1, 60_000], ["Pa", "pressure"], ["kPa", "pressure", 1e3],
    ["MPa", "pressure", 1e6], ["GPa", "pressure", 1e9], ["Pa_s", "viscosity"], ["mPa_s", "viscosity", 1, 1000],
    ["P", "viscosity", 1, 10], ["cP", "viscosity", 1, 1000], ["K", "temperature"],
    ["C", "temperature", 1, 1, 273.15], ["F", "temperature", 5, 9, 459.67], ["1", "number"],
    ["percent", "number", 1, 100],
  ].map(([suffix, kind, times = 1, over = 1, zero = 0]) => [suffix, { suffix, kind, times, over, zero }]),
);
const TEXTS = new Map(
  Object.entries({
    um: "µm", rad_s: "rad/s", deg_s: "degrees/s", rps: "turns/s", deg: "degrees", m_s: "m/s", cm_s: "cm/s",
    mm_s: "mm/s", m_min: "m/min", cm_min: "cm/min", mm_min: "mm/min", Pa_s: "Pa s", mPa_s: "mPa s", C: "°C",
    F: "°F", percent: "%", 1: "",
  }),
);
const SPELLINGS = { // other spellings of units, after signs have become underscores
  meter: "m", metre: "m", meters: "m", metres: "m", inch: "in", inches: "in", sec: "s", second: "s", seconds: "s",
  minutes: "min", hours: "h", hr: "h", degree: "deg", degrees: "deg", radian: "rad", radians: "rad",
  r_min: "rpm", U_min: "rpm", "1_min": "rpm", "min^-1": "rpm", RPM: "rpm", rev_min: "rpm", rev_s: "rps",
  turns_s: "rps", hz: "Hz", "1_s": "Hz", "rad_s^-1": "rad_s", rad_sec: "rad_s", deg_sec: "deg_s",
  degrees_s: "deg_s", "deg_s^-1": "deg_s", "m_s^-1": "m_s", "cm_s^-1": "cm_s", "mm_s^-1": "mm_s", Pas: "Pa_s",
  mPas: "mPa_s", degC: "C", degF: "F", "%": "percent", "-": "1", "": "1",
};
const MOST_PARTS = 2; // of a suffix
const SIGNS = {
  "°": "deg", "º": "deg", "µ": "u", "μ": "u", "/": "_", "·": "_", "*": "_", " ": "_", "⁻": "^-", "¹": "1",
  "−": "-",
};
const OTHERS = new Set(Object.keys(SPELLINGS)); // without what every object has

/* Find a unit by its suffix or another spelling ("deg/s", "°", "U/min"); null if it is no known unit. */
function findUnit(text) {
  const bare = text.trim().replace(/^[[\]()]+|[[\]()]+$/g, "").trim();
  const word = Array.from(bare, (sign) => SIGNS[sign] ?? sign).join("").replace(/_+/g, "_");
  return UNITS.get(OTHERS.has(word) ? SPELLINGS[word] : word) ?? null;
}

/* Split the name of a column or key into {quantity, unit}; unit null if it has none or an unknown one.
 *
 * The unit is a suffix (R_yr_mm) or stands in brackets behind the name ("R_yr [mm]", "X (cm)"). */
function splitName(name) {
  const text = name.trim(), head = text.slice(0, -1), bracket = head.replaceAll("(", "[").lastIndexOf("[");
  const inside = head.slice(bracket + 1);
  if (bracket >= 0 && /[\])]$/.test(text) && !/[\])]/.test(inside)) {
    return { quantity: text.slice(0, bracket).replace(/[_ \t]+$/, "").trim(), unit: findUnit(inside) };
  }
  const parts = text.split("_");
  for (let first = Math.max(1, parts.length - MOST_PARTS); first < parts.length; first++) {
    const unit = UNITS.get(parts.slice(first).join("_"));
    if (unit && unit.suffix !== "1") return { quantity: parts.slice(0, first).join("_"), unit }; // x_1 is a name
  }
  return { quantity: text, unit: null };
}

/* A unit as people write it: rad/s. */
function unitText({ suffix }) {
  return TEXTS.get(suffix) ?? suffix;
}

/* List the suffixes of the units of a kind, such as "length". */
function unitsOfKind(kind) {
  return [...UNITS.values()].filter((unit) => unit.kind === kind).map((unit) => unit.suffix);
}

function toSi(value, suffix) {
  const { times, over, zero } = UNITS.get(suffix);
  return ((value + zero) * times) / over;
}

function fromSi(value, suffix) {
  const { times, over, zero } = UNITS.get(suffix);
  return (value * over) / times - zero;
}

/* Convert a number between units of one kind. */
function convertUnit(value, given, wanted) {
  return given === wanted ? value : fromSi(toSi(value, given), wanted);
}

/* Write a duration as people say it: 0.35 s, 48.2 s, 12.5 min, 3 h 20 min. */
function formatTime(seconds) {
  if (!Number.isFinite(seconds) || Math.abs(seconds) < 90) return `${general(seconds, 3)} s`;
  if (Math.abs(seconds) < 5400) return `${general(seconds / 60, 3)} min`;
  const minutes = roundHalfEven(seconds / 60), rest = minutes - 60 * Math.floor(minutes / 60);
  const hours = `${fixed(Math.floor(minutes / 60), 0)} h`;
  return rest && minutes < 6000 ? `${hours} ${rest} min` : hours;
}

/* Write a length in metres as people say it: 3.2 mm, 12.4 cm, 3.1 m. */
function formatLength(metres) {
  const size = Math.abs(metres);
  if (size && size < 0.01) return `${general(1000 * metres, 3)} mm`;
  return size >= 2 ? `${general(metres, 3)} m` : `${general(100 * metres, 3)} cm`;
}

export { UNITS, findUnit, splitName, unitText, unitsOfKind, toSi, fromSi, convertUnit, formatTime, formatLength };
