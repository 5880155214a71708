/* Numbers as text, as Python writes and reads them: repr(x), f"{x:.3g}", f"{x:.3f}", round(x), float(text).
 *
 * JavaScript finds the same digits, but rounds numbers halfway between two up, Python to the even digit. */

/* A number as Python's repr and json.dumps write a float: the shortest digits that are read back exactly. */
function repr(value) {
  const special = specialText(value);
  if (special !== null) return special;
  if (value === 0) return Object.is(value, -0) ? "-0.0" : "0.0";
  const [mantissa, exponent] = value.toExponential().split("e"), power = Number(exponent);
  if (power < -4 || power >= 16) return mantissa + exponentText(power);
  const text = plainText(mantissa, power);
  return text.includes(".") ? text : `${text}.0`;
}

/* A number with so many significant digits, without zeros at the end: f"{value:.{digits}g}". */
function general(value, digits = 6) {
  const special = specialText(value);
  if (special !== null) return special;
  if (value === 0) return Object.is(value, -0) ? "-0" : "0";
  const [mantissa, exponent] = toEven(value, digits).split("e"), power = Number(exponent);
  const short = mantissa.includes(".") ? mantissa.replace(/\.?0+$/, "") : mantissa;
  return power < -4 || power >= digits ? short + exponentText(power) : plainText(short, power);
}

/* A number with so many decimals: f"{value:.{places}f}". */
function fixed(value, places) {
  const special = specialText(value);
  if (special !== null) return special;
  const size = Math.abs(value), sign = value < 0 || Object.is(value, -0) ? "-" : "";
  if (size >= 1e21) return `${sign}${BigInt(size)}${places ? `.${"0".repeat(places)}` : ""}`;
  const longer = size.toFixed(places + 1);
  return sign + (isTie(size, longer) ? longer.slice(0, -1).replace(/\.$/, "") : size.toFixed(places));
}

/* The nearest whole number; halves go to the even one, as Python's round and numpy.round. */
function roundHalfEven(value) {
  const below = Math.floor(value), over = value - below;
  if (over !== 0.5) return over < 0.5 ? below : below + 1;
  return below % 2 === 0 ? below : below + 1;
}

/* The number that a word stands for, as Python's float reads it; null: the word is no number. */
function pythonNumber(word) {
  const text = word.trim().toLowerCase();
  if (/^[+-]?(inf|infinity|nan)$/.test(text)) {
    return text.endsWith("nan") ? NaN : text.startsWith("-") ? -Infinity : Infinity;
  }
  const number = /^[+-]?(?:D\.?(?:D)?|\.D)(?:e[+-]?D)?$/.source.replaceAll("D", "\\d+(?:_\\d+)*");
  return new RegExp(number).test(text) ? Number(text.replaceAll("_", "")) : null;
}

/* A text in quotes, as Python's repr writes it. */
function pythonText(text) {
  const quote = text.includes("'") && !text.includes('"') ? '"' : "'";
  const escapes = { "\\": "\\\\", "\n": "\\n", "\r": "\\r", "\t": "\\t", [quote]: `\\${quote}` };
  const shown = (sign) => {
    const code = sign.codePointAt(0);
    const [letter, width] = code < 0x100 ? ["x", 2] : code < 0x10000 ? ["u", 4] : ["U", 8];
    const hidden = sign !== " " && /[\p{C}\p{Z}]/u.test(sign);
    return hidden ? `\\${letter}${code.toString(16).padStart(width, "0")}` : sign;
  };
  return quote + Array.from(text, (sign) => escapes[sign] ?? shown(sign)).join("") + quote;
}

function specialText(value) {
  if (Number.isNaN(value)) return "nan";
  return Number.isFinite(value) ? null : value > 0 ? "inf" : "-inf";
}

function exponentText(power) {
  return `e${power < 0 ? "-" : "+"}${String(Math.abs(power)).padStart(2, "0")}`;
}

/* Digits "d.ddd" times a power of ten, without an exponent. */
function plainText(mantissa, power) {
  const sign = mantissa.startsWith("-") ? "-" : "", digits = mantissa.replace(/[-.]/g, "");
  if (power < 0) return `${sign}0.${"0".repeat(-power - 1)}${digits}`;
  if (digits.length <= power + 1) return sign + digits.padEnd(power + 1, "0");
  return `${sign}${digits.slice(0, power + 1)}.${digits.slice(power + 1)}`;
}

/* A number in the form d.ddde+p with so many digits; a tie goes to the even digit. */
function toEven(value, digits) {
  const longer = value.toExponential(digits), [mantissa, power] = longer.split("e");
  if (!isTie(Math.abs(value), longer.replace(/^-/, ""))) return value.toExponential(digits - 1);
  return `${mantissa.slice(0, -1).replace(/\.$/, "")}e${power}`;
}

/* Whether a number is halfway between two shorter ones, of which the one nearer to zero is even. */
function isTie(size, longer) {
  return /[02468]\.?5(e|$)/.test(longer) && isDecimal(size, longer);
}

/* Whether a number above 0 equals a decimal to the last bit, which Number(text) === value does not say. */
function isDecimal(value, text) {
  const [mantissa, exponent] = text.split("e"), [whole, part = ""] = mantissa.split(".");
  const ten = Number(exponent ?? 0) - part.length;
  let scaled = value, two = 0;
  for (; !Number.isInteger(scaled); two--) scaled *= 2;
  const left = BigInt(scaled) * (ten < 0 ? 10n ** BigInt(-ten) : 1n);
  const right = BigInt(whole + part) * (ten > 0 ? 10n ** BigInt(ten) : 1n);
  return left === right << BigInt(-two);
}

export { repr, general, fixed, roundHalfEven, pythonNumber, pythonText };
